"""`usm compare`: is one policy better than another?"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from usm_agents.policies import named

from usm_cli.selection import (
    POLICIES,
    add_scenarios,
    add_scoring,
    by_name,
    chosen_scenarios,
    leave_if_refused,
    scored,
    seeds,
    tasks,
)
from usm_cli.terminal import output_console
from usm_gym.statistics import Comparison, compare
from usm_gym.support.files import check_writable, read_json, write_json
from usm_gym.support.provenance import provenance
from usm_gym.support.text import mm
from usm_gym.support.validation import in_one_line, require
from usm_gym.task.scenario import Scenario

DESCRIPTION = """\
Compare two policies episode by episode, on the same scenarios and noise. Printed are the mean
difference of the largest position error (B - A) with its 95 % bootstrap interval, the probability
that B does better in an episode, and whether the data decide. A and B are policies, or results that
`usm evaluate --output` has written: FILE.json, or FILE.json:POLICY where it has several.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm compare pd sta                                both are evaluated on the operation suite
  usm compare sta sta@sta.json --seed 1 --episodes 200
  usm compare results.json:sta results.json:pd      nothing is evaluated
  usm compare results.json:sta my_module:Mine       evaluated on the scenarios of the file
"""
SCORES = ("max_error_x", "max_error_y")
Scores = Mapping[str, list[float]]


@dataclass(frozen=True)
class Results:
    """A policy's part of a file of results.

    Attributes:
        scenarios: The file's scenarios.
        scores: The scores per episode.
    """

    scenarios: list[Scenario]
    scores: Scores


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "compare",
        help="decide between two policies",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    parser.add_argument("first", metavar="A", help="policy, or file of results")
    parser.add_argument("second", metavar="B", help="policy, or file of results")
    add_scenarios(parser)
    add_scoring(parser)
    parser.add_argument("--output", metavar="FILE", help="write the comparison as JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Compare, print, write the file."""
    if arguments.output:
        check_writable(arguments.output)
    names = (arguments.first, arguments.second)
    require(names[0] != names[1], "B", names[1], "another than A")
    files = {name: read_results(name) for name in names if is_results(name)}
    scenarios = chosen_scenarios(arguments)
    if files:
        options = ("suite", "seed", "episodes", "mode", "conditions")
        given = [f"--{name}" for name in options if getattr(arguments, name) is not None]
        require(not given, " ".join(given), names, "policies only: a file has its own scenarios")
        scenarios, *others = [each.scenarios for each in files.values()]
        require(all(other == scenarios for other in others), "B", names[1], "the scenarios of A")
    missing = [named(name) for name in names if name not in files]
    chosen = tasks(missing, scenarios, arguments.time_limit) if missing else []
    scores: dict[str, Scores] = {name: each.scores for name, each in files.items()}
    found, refused = by_name(chosen, scored(chosen, arguments))
    leave_if_refused(refused)
    for name, evaluation in found.items():
        scores[name] = {key: evaluation.per_episode[key].tolist() for key in SCORES}
    first, second = (scores[name] for name in names)
    comparisons = {name: compare(first[name], second[name]) for name in SCORES}
    console = output_console()
    for name, comparison in comparisons.items():
        console.print(sentence(name[-1], comparison, *names), markup=False, soft_wrap=True)
    if arguments.output:
        document = {
            "first": names[0],
            "second": names[1],
            "episodes": len(scenarios),
            "comparisons": {
                name: {**asdict(each), "decided": each.decided, "verdict": each.verdict(*names)}
                for name, each in comparisons.items()
            },
            "provenance": provenance({"files": list(files)} if files else seeds(arguments)),
        }
        write_json(arguments.output, document)


def is_results(name: str) -> bool:
    """Whether a name is that of a file of results."""
    return "@" not in name and name.partition(":")[0].endswith(".json")


def read_results(name: str) -> Results:
    """Read FILE.json or FILE.json:POLICY, as `usm evaluate` has written it."""
    path, _, policy = name.partition(":")
    try:
        document = read_json(path)
        results: dict[str, Any] = document["results"]
        scenarios = [Scenario.from_dict(each) for each in document["scenarios"]]
        scores = {
            id: {key: row["per_episode"][key] for key in SCORES} for id, row in results.items()
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path} is no file of results: {in_one_line(error)}") from error
    several = ", ".join(f"{path}:{id}" for id in results)
    require(policy or len(results) == 1, "results", name, several)
    require(not policy or policy in results, "results", name, several)
    return Results(scenarios, scores[policy or next(iter(results))])


def sentence(axis: str, comparison: Comparison, first: str, second: str) -> str:
    """A comparison in words."""
    low, high = comparison.difference_ci95
    least, most = comparison.improvement_ci95
    return (
        f"{axis}: {first} {mm(comparison.first)} mm, {second} {mm(comparison.second)} mm, "
        f"difference {mm(comparison.difference)} [{mm(low)}, {mm(high)}] mm over "
        f"{comparison.episodes} episodes; {second} does better with probability "
        f"{comparison.improvement:.2f} [{least:.2f}, {most:.2f}]: "
        f"{comparison.verdict(first, second)}."
    )
