"""`usm train`: train an agent on the residual task."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from usm_cli.options import check_installed, parse_conditions
from usm_cli.terminal import output_console, progress_bar
from usm_gym.support.validation import require
from usm_gym.task.conditions import PRESETS

DESCRIPTION = """\
Train an agent that adds residual thrust to a base policy, or corrects what the base believes. The
command first prints what it trains, with which settings, and how often it validates. The progress
bar shows the last validation: mean largest errors x / y, heading error, and thrust variation. The
folder then holds the agent, which --policies takes, its learning curve on held-out scenarios of the
training distribution, logs for TensorBoard, and the last checkpoint. Training never uses frozen
suites. `usm train --resume --output DIR` continues from the last checkpoint and ends as if it had
never been interrupted. A checkpoint is code, and resuming runs it, so resume only your own
trainings. Without --resume, a folder that holds any part of a training is refused, and nothing in
it is opened. Needs the extra `agents`, unless the learner is your own (docs/residual.md).
"""
EXAMPLES = """\
examples:
  usm train --output mine                             PPO on the paper's controller
  usm train --algorithm tqc --base pd --output mine   another algorithm on another base
  usm train --algorithm estimator --action estimates --base lqg-joints-basin --conditions basin \\
      --steps 4600000 --output believing              learn what to believe in a basin
  usm train --resume --output mine                    continue after an interruption
  usm evaluate --policies sta,mine                    score the agent
"""
# The options of the plan, by the names of its fields.
OPTIONS = (
    (
        "algorithm",
        str,
        "A",
        "ppo, smooth-ppo, recurrent-ppo, sac, td3, tqc, estimator (with --action estimates), or "
        "my_module:mine, where importing my_module registers your own learner as mine "
        "(default: ppo)",
    ),
    ("env", str, "ID", "residual task (default: usm_agents:USM-OperationResidual-v0)"),
    ("base", str, "NAME", "base policy: an id or ID@gains.json (default: sta)"),
    ("residual_scale", float, "N", "largest residual, N and N m (default: 20)"),
    (
        "action",
        str,
        "KIND",
        "what the agent adds to: the base's force, wrench or thrusters, the estimates that it acts "
        "on, or the velocities that it wants of the head; or joints, which the agent then moves "
        "alone (default: force)",
    ),
    ("frames", int, "K", "how many observations the agent sees at once (default: 1)"),
    ("seed", int, "S", "seed of all random numbers (default: 0)"),
    ("steps", int, "N", "steps of all robots together (default: 1000000)"),
    ("interval", int, "N", "steps between checkpoints (default: 100000)"),
)


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "train",
        help="train an agent",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    for name, kind, metavar, text in OPTIONS:
        add(f"--{name.replace('_', '-')}", type=kind, metavar=metavar, help=text)
    add("--omit", metavar="A,B", help="entries of the observation to hide from the agent")
    add("--conditions", metavar="C", help=f"{', '.join(PRESETS)}, or JSON (default: field)")
    add("--output", metavar="DIR", required=True, help="folder of the training and of its agent")
    add(
        "--resume",
        action="store_true",
        help="continue from the last checkpoint there; this runs code, so resume only your own",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Train with a progress bar, and print the result."""
    folder = Path(arguments.output)
    from usm_agents.learning.learner import settings_of
    from usm_agents.learning.plan import Plan, read_plan
    from usm_agents.learning.settings import SETTINGS
    from usm_agents.learning.training import train
    from usm_agents.learning.validation import best_of, in_words

    names = [name for name, *_ in OPTIONS] + ["omit", "conditions"]
    given = {name: getattr(arguments, name) for name in names}
    given = {name: value for name, value in given.items() if value is not None}
    if "omit" in given:
        given["omit"] = tuple(given["omit"].split(","))
    if arguments.resume:
        require(
            not given, "--resume", ", ".join(given), "--output alone; the plan is in that folder"
        )
        plan = read_plan(folder)
    else:
        named = given.pop("conditions", "field")
        mode = Plan(**given).mode
        plan = Plan(**given, conditions=parse_conditions(named, mode))
    if plan.algorithm in SETTINGS:
        check_installed("usm train", "agents", "sb3_contrib")
    print_schedule(plan, settings_of(plan.algorithm))
    with progress_bar() as bar:
        line = bar.add_task("", total=plan.steps)

        def report(steps: int, validation: str) -> None:
            bar.update(line, completed=steps, description=validation)

        curve = train(plan, folder, report, arguments.resume)
    console = output_console()
    for name, point in (("before", curve[0]), ("best", best_of(curve)), ("last", curve[-1])):
        steps, seconds = point["steps"], point["seconds"]
        console.print(f"{name}: {in_words(point)} after {steps} steps, {seconds:.0f} s")


def print_schedule(plan: Any, settings: Mapping[str, Any]) -> None:
    """Say what will be trained, and how."""
    on = f"{plan.algorithm} on the {plan.action} of {plan.base}"
    if plan.action == "estimates":
        on = f"{plan.algorithm} on what {plan.base} believes"
    told = ", ".join(f"{name} {value}" for name, value in settings.items())
    console = output_console()
    for line in (
        f"{on}: {plan.steps} steps, a validation every {plan.interval}",
        f"settings: {told}",
    ):
        console.print(line, markup=False, highlight=False)
