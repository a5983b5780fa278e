"""`usm study`: train and compare agents."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.markdown import Markdown

from usm_cli.options import add_computing, check_installed, computing, output_folder
from usm_cli.terminal import output_console, progress_bar
from usm_gym.support.files import holding, write_text
from usm_gym.support.results import Provenance
from usm_gym.support.validation import require

DESCRIPTION = """\
Train the shipped agents of several tiers, and ablations that lack one thing, with several seeds.
Score them and the classical policies of their tier on unseen scenarios, under the training
conditions and under others, and examine what the agents do to their bases. Writes study.json,
study.md and figures (extra `render`) into a folder, and the trainings into the folder `runs` there.
After an interruption, run it again to continue, even in the middle of a training. This runs the
training's checkpoint, which is code, if its plan is the study's, so give --output only a folder of
your own. A folder that holds another training, or parts of one without its plan, is refused. An
agent whose base is another agent is trained on the shipped one, and left out as long as there is
none. Takes hours on two cores. Needs the extra `agents`.
"""
EXAMPLES = """\
examples:
  usm study residual --workers 2                             all of it
  usm study residual --only residual-ppo,rl-only --seeds 2   two agents with two seeds
  usm study residual --only scale-6,thrusters --steps 20000 --output try
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "study",
        help="train and compare agents",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("subject", choices=["residual"], help="what to study")
    add(
        "--only",
        metavar="A,B",
        help="some agents and ablations, by name (default: all whose base is shipped)",
    )
    add("--seeds", type=int, default=10, metavar="N", help="largest number of seeds (default: 10)")
    add("--steps", type=int, metavar="N", help="steps of a training (default: as planned)")
    add("--episodes", type=int, default=100, metavar="N", help="unseen scenarios (default: 100)")
    add_computing(parser)
    add("--output", default="results/study", metavar="DIR", help="default: results/study")
    add(
        "--ship",
        metavar="DIR",
        help="write the agents, with seed 0, into folders there",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Train, score, write the folder, print the tables."""
    check_installed("usm study", "agents", "sb3_contrib")
    from usm_agents.learning.plan import TEST_SEED
    from usm_agents.study import figures, page, plans, scores, trainings

    for name, least in (("seeds", 1), ("episodes", 2), ("steps", 1)):
        value = getattr(arguments, name)
        require(value is None or value >= least, f"--{name}", value, f"{least} or more")
    names = list(filter(trainings.has_base, plans.PLANS))
    if arguments.only is not None:
        names = arguments.only.split(",")
    folder = output_folder(arguments.output)
    with holding(folder):
        chosen = trainings.planned(names, arguments.seeds, folder, arguments.steps)
        rivals = scores.rivals(chosen)  # refuses what cannot be read before anything is trained
        with computing(arguments) as workers, progress_bar() as bar:
            line = bar.add_task("trainings", total=len(chosen))
            trainings.train_all(chosen, workers, lambda training: bar.advance(line))
            jobs = scores.jobs(chosen, rivals, arguments.episodes)
            line = bar.add_task("episodes", total=sum(len(job.scenarios) for job in jobs.values()))
            cache = folder / "cache"
            outcomes = scores.score(jobs, workers, cache, lambda count: bar.advance(line, count))
            origin = Provenance.here({"trainings": arguments.seeds, "scenarios": TEST_SEED})
            result = scores.study(chosen, rivals, outcomes, arguments.episodes, origin)
        result.write(folder / "study.json")
        if arguments.ship is not None:
            trainings.ship(chosen, Path(arguments.ship), origin.command)
        text = page.markdown(result)
        write_text(folder / "study.md", text)
        figures.draw_all(result, folder)
    output_console().print(Markdown(text))
