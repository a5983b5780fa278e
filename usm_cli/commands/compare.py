"""`usm compare`: decide whether one policy is better than another."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from usm_agents.policies import named
from usm_baselines.benchmark.results import ComparisonResult, Difference, EvaluationResult

from usm_cli.selection import (
    POLICIES,
    add_scenarios,
    add_scoring,
    by_name,
    chosen_scenarios,
    jobs,
    leave_if_refused,
    scored,
    seeds,
)
from usm_cli.terminal import output_console
from usm_gym.statistics import compare
from usm_gym.support.files import check_writable
from usm_gym.support.results import Provenance
from usm_gym.support.text import degrees, figures, mm
from usm_gym.support.validation import require
from usm_gym.task.metrics import ANGLE_ERROR, MAX_ERROR, attitude_of, axes_of, objective
from usm_gym.task.modes import AnyScenario
from usm_gym.task.stored_scenario import OtherScenario

DESCRIPTION = """\
Compare two policies episode by episode, on the same scenarios and noise. Prints the mean
difference (B - A) of the largest position and heading errors, and of the objective that tables are
ordered by, with its 95 % bootstrap interval, the probability that B does better in an episode, and
whether the data decide. A and B are policies or results from
`usm evaluate --output`: FILE.json, or FILE.json:POLICY if the file has several policies.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm compare pd sta                                evaluates both on the operation suite
  usm compare sta sta@sta.json --seed 1 --episodes 200
  usm compare results.json:sta results.json:pd      evaluates nothing
  usm compare results.json:sta my_module:Mine       evaluates Mine on the scenarios of the file
"""
Scores = Mapping[str, Any]
# The name of the objective among the metrics that are compared.
OBJECTIVE = "objective"


@dataclass(frozen=True)
class PolicyScores:
    """A policy's part of a file of results.

    Attributes:
        scenarios: The file's scenarios.
        scores: What is compared of the episodes, by metric: see `metrics_of`.
    """

    scenarios: list[AnyScenario | OtherScenario]
    scores: Scores


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "compare",
        help="decide between two policies",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    parser.add_argument("first", metavar="A", help="policy or file of results")
    parser.add_argument("second", metavar="B", help="policy or file of results")
    add_scenarios(parser)
    add_scoring(parser)
    parser.add_argument("--output", metavar="FILE", help="write the comparison as JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Compare, print, write the file."""
    if arguments.output:
        check_writable(arguments.output)
    names = (arguments.first, arguments.second)
    require(names[0] != names[1], "B", names[1], "another policy than A")
    files = {name: read_results(name) for name in names if is_results(name)}
    missing = [named(name) for name in names if name not in files]
    scenarios: Sequence[AnyScenario | OtherScenario]
    scenarios = common_scenarios(arguments, names, files) if files else chosen_scenarios(arguments)
    ours = [scenario for scenario in scenarios if not isinstance(scenario, OtherScenario)]
    known = not missing or len(ours) == len(scenarios)
    require(known, "policies", names, "two results, as these scenarios are of another world")
    chosen = jobs(missing, ours, arguments.time_limit) if missing else []
    scores = {name: part.scores for name, part in files.items()}
    evaluated, refused = by_name(chosen, scored(chosen, arguments))
    leave_if_refused(refused)
    scores |= {name: metrics_of(evaluation.per_episode) for name, evaluation in evaluated.items()}
    first, second = (scores[name] for name in names)
    require(list(first) == list(second), "B", names[1], "a policy on the axes of A")
    compared = {name: compare(first[name], second[name]) for name in first}
    result = ComparisonResult(
        first=names[0],
        second=names[1],
        episodes=len(scenarios),
        comparisons={name: Difference.of(pair, *names) for name, pair in compared.items()},
        provenance=Provenance.here({"files": list(files)} if files else seeds(arguments)),
    )
    console = output_console()
    for name, difference in result.comparisons.items():
        console.print(sentence(name, difference, *names), markup=False, soft_wrap=True)
    if arguments.output:
        result.write(arguments.output)


def common_scenarios(
    arguments: argparse.Namespace, names: Sequence[str], files: Mapping[str, PolicyScores]
) -> list[AnyScenario | OtherScenario]:
    """The common scenarios of the files; refuse files with different ones."""
    options = ("suite", "seed", "episodes", "mode", "conditions")
    given = [f"--{name}" for name in options if getattr(arguments, name) is not None]
    require(not given, " ".join(given), names, "policies only: a file has its own scenarios")
    scenarios, *others = [part.scenarios for part in files.values()]
    require(all(other == scenarios for other in others), "B", names[1], "the scenarios of A")
    return scenarios


def is_results(name: str) -> bool:
    """Whether a name names a file of results."""
    return "@" not in name and name.partition(":")[0].endswith(".json")


def read_results(name: str) -> PolicyScores:
    """Read FILE.json or FILE.json:POLICY from `usm evaluate`."""
    path, _, policy = name.partition(":")
    result = EvaluationResult.read(path)
    several = ", ".join(f"{path}:{id}" for id in result.results) or "a file with scores"
    require(
        policy in result.results if policy else len(result.results) == 1, "results", name, several
    )
    scores = result.results[policy or next(iter(result.results))]
    return PolicyScores(list(result.scenarios), metrics_of(scores.per_episode))


def metrics_of(per_episode: Mapping[str, Any]) -> Scores:
    """What is compared, by metric: the largest errors and those of the attitude, and the objective.

    The objective is in mm, errors are in m and rad.
    """
    names = [MAX_ERROR + axis for axis in axes_of(per_episode)]
    names += [angle + ANGLE_ERROR for angle in attitude_of(per_episode)]
    arrays = {name: np.asarray(values, float) for name, values in per_episode.items()}
    return {**{name: arrays[name] for name in names}, OBJECTIVE: objective(arrays)}


def sentence(metric: str, difference: Difference, first: str, second: str) -> str:
    """Describe a difference in one sentence."""
    label, unit = metric.removeprefix(MAX_ERROR), "mm"
    written: Callable[[float], str] = figures if metric == OBJECTIVE else mm
    if metric.endswith(ANGLE_ERROR):
        label, unit, written = metric.removesuffix(ANGLE_ERROR), "°", degrees
    low, high = difference.difference_ci95
    least, most = difference.improvement_ci95
    return (
        f"{label}: {first} {written(difference.first)} {unit}, "
        f"{second} {written(difference.second)} {unit}, difference "
        f"{written(difference.difference)} [{written(low)}, {written(high)}] {unit} over "
        f"{difference.episodes} episodes; {second} does better with probability "
        f"{difference.improvement:.2f} [{least:.2f}, {most:.2f}]: "
        f"{difference.verdict}."
    )
