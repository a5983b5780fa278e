"""`usm tune`: search for better gains of a policy."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from usm_baselines.gains import Budget

from usm_cli.options import (
    add_computing,
    add_mode,
    check_installed,
    computing,
    count,
    parse_conditions,
)
from usm_cli.terminal import output_console, progress_bar
from usm_gym.support.files import check_writable, holding, write_json
from usm_gym.support.provenance import provenance
from usm_gym.support.text import figures
from usm_gym.task.conditions import PRESETS
from usm_gym.task.metrics import VARIATION_WEIGHT

DESCRIPTION = """\
Search for the gains of a policy with the smallest objective: the mean over scenarios of the largest
errors, summed over the axes, in mm, plus 0.05 mm per degree of the largest error of the attitude
and a weight times the thrust variation. In every eighth scenario, for the head in every second, the
vehicle reacts later than the policy is told. Scenarios are sampled for tuning only; tuning never
uses a frozen suite. After an interruption, run the same command again to continue. The result is
the same for any number of workers. Needs the extra `tune`.
"""
EXAMPLES = """\
examples:
  usm tune sta                                      writes sta.json, trials in sta.db
  usm tune sta --trials 50 --workers 2              a quick look
  usm tune sta --weight 0.01 --output calm.json     less chattering, more error
  usm tune lqg --conditions basin                   gains for other conditions
  usm evaluate --policies sta,sta@sta.json          score the new gains
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "tune",
        help="search for better gains",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("policy", metavar="POLICY", help="id of a policy that declares ranges of gains")
    add("--trials", type=int, metavar="N", help="sets of gains to try (default: 300)")
    add("--episodes", type=int, metavar="N", help="scenarios per set (default: 50)")
    add("--weight", type=float, metavar="W", help="mm per N/s of variation (default: 0.002)")
    add_mode(parser)
    add("--conditions", metavar="C", help=f"{', '.join(PRESETS)}, or JSON (default: field)")
    add("--seed", type=int, metavar="S", help="seed of scenarios and search (default: 0)")
    add("--output", metavar="FILE", help="file of gains and provenance (default: POLICY.json)")
    add("--storage", metavar="URL", help="Optuna's storage (default: SQLite, beside the output)")
    add_computing(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Tune, write the gains, print their scores."""
    check_installed("usm tune", "tune", "optuna")
    from usm_baselines.benchmark.tuning import Problem, tune

    output = Path(arguments.output or f"{arguments.policy}.json")
    check_writable(output)
    problem = Problem(
        policy=arguments.policy,
        budget=Budget(count(arguments, "trials", 300), count(arguments, "episodes", 50)),
        weight=VARIATION_WEIGHT if arguments.weight is None else arguments.weight,
        mode=arguments.mode,
        conditions=parse_conditions(arguments.conditions or "field", arguments.mode),
        seed=count(arguments, "seed", 0, least=0),
    )
    storage = arguments.storage or f"sqlite:///{output.with_suffix('.db').absolute()}"
    with holding(output), computing(arguments) as workers, progress_bar() as bar:
        line = bar.add_task(problem.policy, total=problem.budget.trials)

        def show(trials: int, best: float) -> None:
            bar.update(line, completed=trials, description=f"best {best:.3f} mm")

        result = tune(problem, storage, workers, show)
        document = {
            "policy": problem.policy,
            "gains": result.gains,
            "objective": result.objective,
            "validation": {"own_gains": result.start, "these": result.validation},
            "budget": asdict(problem.budget),
            "weight": problem.weight,
            "mode": problem.mode,
            "conditions": asdict(problem.conditions),
            "space": {name: asdict(bounds) for name, bounds in problem.space.items()},
            "provenance": provenance({"seed": problem.seed}),
        }
        write_json(output, document)
    console = output_console()
    for name, gain in result.gains.items():
        console.print(f"{name} = {figures(gain)} {problem.space[name].unit}", markup=False)
    console.print(
        f"objective on {problem.budget.episodes} other scenarios: {figures(result.validation)} mm, "
        f"with the policy's own gains {figures(result.start)} mm",
    )
