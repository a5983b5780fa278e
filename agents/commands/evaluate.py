"""`usm evaluate`: score policies on a frozen suite or on sampled scenarios."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from agents.terminal import figures, output_console, progress_bar
from baselines.policy import Policy
from baselines.registry import entry, ids, make
from usm_gym.evaluation import evaluate
from usm_gym.files import check_writable, write_json
from usm_gym.nominal import nominal_of
from usm_gym.provenance import provenance
from usm_gym.robot import Robot
from usm_gym.scenario import MODES, Conditions, Mode, Scenario, conditions_of, sample
from usm_gym.seeding import EVALUATION, stream
from usm_gym.suites import NAMES, suite
from usm_gym.validation import in_one_line, require

DESCRIPTION = """\
Score policies: per episode and axis, the largest true position error after settling (5 s), as in
Table 1 of the paper. All policies meet the same scenarios and the same noise. Printed are means
over episodes with 95 % bootstrap intervals; a lost robot counts 0.5 m or more in both axes.
"""
EXAMPLES = """\
examples:
  usm evaluate                                          all competitors, fifty frozen scenarios
  usm evaluate --policies sta,pd --suite torpedo        two of them in torpedo mode
  usm evaluate --policies sta --seed 7 --episodes 200   sampled scenarios
  usm evaluate --conditions ideal                       the suite without noise, lag and current
  usm evaluate --conditions '{"position_noise": 0}'     one field other than in "field"
  usm evaluate --policies sta --output sta.json         keep everything, episode by episode
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "evaluate",
        help="score policies",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--policies", metavar="A,B", help="names, by commas (default: all competitors)")
    add(
        "--suite",
        metavar="NAME",
        help=f"frozen suite ({', '.join(NAMES)}; default: operation) or a file of scenarios",
    )
    add("--seed", type=int, metavar="S", help="sample scenarios under this seed instead")
    add("--episodes", type=int, metavar="N", help="how many to sample (default: 50)")
    add("--mode", choices=MODES, help="mode of sampled scenarios (default: operation)")
    add(
        "--conditions",
        metavar="C",
        help="ideal, field, rough, or a JSON object of fields on top of field; "
        "on a suite it overrides the suite's own (default: the suite's; field)",
    )
    add("--workers", type=int, default=1, metavar="N", help="processes (default: 1)")
    add("--output", metavar="FILE", help="write the results as JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Evaluate, print the table, write the file."""
    if arguments.output:
        check_writable(arguments.output)
    conditions = None if arguments.conditions is None else parse_conditions(arguments.conditions)
    scenarios = chosen_scenarios(arguments, conditions)
    robot = Robot()
    policies = chosen_policies(arguments.policies, robot, scenarios)
    results: dict[str, Any] = {}
    with progress_bar() as bar:
        task = bar.add_task("", total=len(policies) * len(scenarios))
        for id, policy in policies.items():
            bar.update(task, description=id)
            scores = evaluate(
                policy,
                scenarios,
                robot=robot,
                workers=arguments.workers,
                progress=lambda episodes: bar.advance(task, episodes),
            )
            results[id] = scores.summary()
    name = None if sampled(arguments) else arguments.suite or "operation"
    output_console().print(table(results, f"{name or 'sampled'}, {len(scenarios)} episodes"))
    if arguments.output:
        document = {
            "suite": name,
            "conditions": scenarios[0].to_dict()["conditions"],
            "conditions_override": arguments.conditions,
            "settle_time": scenarios[0].settle_time,
            "episodes": len(scenarios),
            "scenarios": [scenario.to_dict() for scenario in scenarios],
            "results": results,
            "provenance": provenance(
                {"seed": arguments.seed or 0} if sampled(arguments) else {"suite": name}
            ),
        }
        write_json(arguments.output, document)


def sampled(arguments: argparse.Namespace) -> bool:
    """Whether scenarios are to be sampled."""
    return any(value is not None for value in (arguments.seed, arguments.episodes, arguments.mode))


def chosen_scenarios(
    arguments: argparse.Namespace, conditions: Conditions | None
) -> list[Scenario]:
    """The scenarios that the arguments ask for."""
    if not sampled(arguments):
        scenarios = read_suite(arguments.suite or "operation")
        return [each.under(conditions) for each in scenarios] if conditions else scenarios
    require(
        arguments.suite is None,
        "--suite",
        arguments.suite,
        "no suite beside --seed, --episodes, --mode",
    )
    episodes = 50 if arguments.episodes is None else arguments.episodes
    seed = arguments.seed or 0
    require(episodes >= 1, "--episodes", episodes, "1 or more")
    require(seed >= 0, "--seed", seed, "0 or more")
    mode: Mode = arguments.mode or "operation"
    return [
        sample(mode, conditions or Conditions(), stream(seed, EVALUATION, i))
        for i in range(episodes)
    ]


def read_suite(name: str) -> list[Scenario]:
    """The scenarios of a frozen suite, or of a JSON file that holds a list of them."""
    if not name.endswith(".json"):
        return suite(name)
    try:
        listed = json.loads(Path(name).read_text(encoding="utf-8"))["scenarios"]
        require(isinstance(listed, list) and listed, "scenarios", listed, "a list of one or more")
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{name} is no file of scenarios: {error!r}") from error
    scenarios = []
    for index, data in enumerate(listed):
        try:
            scenarios.append(Scenario.from_dict(data))
        except ValueError as error:
            raise ValueError(f"{name}, scenario {index}: {in_one_line(error)}") from error
    return scenarios


def parse_conditions(text: str) -> Conditions:
    """Conditions from a preset's name or a JSON object."""
    if text.lstrip()[:1] not in ("{", "["):
        return conditions_of(text)
    try:
        return conditions_of(json.loads(text))
    except json.JSONDecodeError as error:
        raise ValueError(f"--conditions is {text!r}: no JSON ({error})") from error


def chosen_policies(
    names: str | None, robot: Robot, scenarios: list[Scenario]
) -> dict[str, Policy]:
    """Policies by name, made from the nominal knowledge that goes with the scenarios."""
    if names is None:
        chosen = [id for id in ids() if not (entry(id).slow or entry(id).privileged)]
    else:
        chosen = [name.strip() for name in names.split(",") if name.strip()]
    require(len(chosen) > 0, "--policies", names, "one name or more")
    nominal, *others = {nominal_of(robot, scenario) for scenario in scenarios}
    require(not others, "scenarios", f"{len(others) + 1} kinds", "one nominal knowledge for all")
    return {name: make(name, nominal) for name in chosen}


def table(results: dict[str, Any], title: str) -> Table:
    """The scores for the terminal, errors in mm."""
    rows = Table(
        "policy",
        title=f"largest position error after settling, mm: mean [95 % interval] ({title})",
        title_justify="left",
        title_style="",
        box=SIMPLE_HEAD,
        pad_edge=False,
    )
    for heading in ("x", "y", "worst x", "worst y", "settled x", "settled y"):
        rows.add_column(heading, justify="right")
    for heading in ("thrust\nN", "variation\nN/s", "lost"):
        rows.add_column(heading, justify="right")
    for name, row in results.items():
        cells = []
        for axis in "xy":
            score = row[f"max_error_{axis}"]
            low, high = score["ci95"]
            cells.append(f"{mm(score['mean'])} [{mm(low)}, {mm(high)}]")
        cells += [mm(row[f"max_error_{axis}"]["worst"]) for axis in "xy"]
        cells += [mm(row[f"settled_error_{axis}"]["mean"]) for axis in "xy"]
        cells += [figures(row[key]["mean"]) for key in ("thrust_effort", "thrust_variation")]
        rows.add_row(name, *cells, str(row["failures"]))
    return rows


def mm(metres: float) -> str:
    """A length in mm to three figures."""
    return figures(1e3 * metres)
