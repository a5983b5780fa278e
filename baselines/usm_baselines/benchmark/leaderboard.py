"""The leaderboard: every policy on every frozen suite, and what follows from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from usm_baselines.benchmark.scoring import TIME_LIMIT, Refusal, Task, shared_nominal
from usm_baselines.contender import Contender, contender
from usm_baselines.gains import FRONT, read_gains
from usm_baselines.registry import ids
from usm_gym.evaluation import Evaluation
from usm_gym.robot import Robot
from usm_gym.statistics import compare, interquartile_mean, interval
from usm_gym.suites import NAMES, suite
from usm_gym.task.scenario import Scenario

MAIN = "operation"
STILL = "operation, joints still"
# Kept episode by episode, in the order of the suite's scenarios.
KEPT = ("max_error_x", "max_error_y", "thrust_variation")

Document = dict[str, Any]


@dataclass(frozen=True)
class Cell:
    """One policy on one suite.

    Attributes:
        suite: Name of the suite; that of `front` for gains tuned with other weights.
        task: What is scored.
    """

    suite: str
    task: Task


def suites() -> dict[str, list[Scenario]]:
    """The frozen suites, and the control row: the main one with the joints still."""
    found = {name: suite(name) for name in NAMES}
    found[STILL] = [
        replace(each, conditions=replace(each.conditions, motion=False)) for each in found[MAIN]
    ]
    return found


def everyone() -> list[Contender]:
    """All registered policies, also those that are slow or no competitors."""
    return [contender(id) for id in ids()]


def front() -> dict[str, list[Contender]]:
    """Policies with the shipped gains of other weights, from the smallest weight on, by id."""
    found: dict[str, list[tuple[float, Contender]]] = {}
    for file in sorted(FRONT.glob("*.json")):
        gains = read_gains(file)
        row = found.setdefault(gains.policy, [])
        row.append((gains.weight, contender(f"{gains.policy}@{file}")))
    return {
        id: [each for _, each in sorted(row, key=lambda pair: pair[0])] for id, row in found.items()
    }


def cells(
    contenders: Sequence[Contender],
    fronts: Mapping[str, Sequence[Contender]],
    chosen: Mapping[str, Sequence[Scenario]],
    time_limit: float = TIME_LIMIT,
) -> list[Cell]:
    """Every policy on every suite, and the fronts on the main one."""
    robot = Robot()
    found = []
    for name, scenarios in chosen.items():
        nominal = shared_nominal(robot, scenarios)
        besides = [each for row in fronts.values() for each in row] if name == MAIN else []
        for each in (*contenders, *besides):
            found.append(Cell(name, Task(each, tuple(scenarios), nominal, robot, time_limit)))
    return found


def document(
    scored: Sequence[tuple[Cell, Evaluation | Refusal]], fronts: Mapping[str, Sequence[Contender]]
) -> Document:
    """Rows by suite, best first; the fronts; and the reasons why rows are missing."""
    refused: dict[str, dict[str, str]] = {}
    scores: dict[str, dict[str, tuple[Contender, Evaluation]]] = {}
    for cell, outcome in scored:
        contender = cell.task.contender
        if isinstance(outcome, Refusal):
            refused.setdefault(cell.suite, {})[contender.name] = outcome.reason
        else:
            scores.setdefault(cell.suite, {})[contender.name] = contender, outcome
    main = scores.get(MAIN, {})
    found = {
        id: [point(main.pop(each.name)[1]) for each in row if each.name in main]
        for id, row in fronts.items()
    }
    suites = {name: ranked(list(pairs.values())) for name, pairs in scores.items() if pairs}
    return {"suites": suites, "front": found, "refused": refused}


def ranked(scores: Sequence[tuple[Contender, Evaluation]]) -> dict[str, dict[str, Any]]:
    """The rows of a suite: competitors first, the smaller error first."""
    order = sorted(scores, key=lambda pair: (pair[0].privileged, total(pair[1]).mean()))
    rows = {contender.name: row(outcome, contender) for contender, outcome in order}
    for (better, one), (worse, other) in pairwise(order):
        if not worse.privileged:
            rows[better.name]["beats_next"] = beaten(other, one)
    return rows


def total(scores: Evaluation) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Error in x plus error in y of each episode, m: what rows are ordered by."""
    return scores.per_episode["max_error_x"] + scores.per_episode["max_error_y"]


def row(scores: Evaluation, contender: Contender) -> dict[str, Any]:
    """A policy's row: the summary of its scores, interquartile means, and the main episodes."""
    found = scores.summary()
    for name in ("max_error_x", "max_error_y"):
        episodes = scores.per_episode[name]
        found[name]["iqm"] = float(interquartile_mean(episodes))
        found[name]["iqm_ci95"] = list(interval(interquartile_mean, episodes))
    found["per_episode"] = {name: found["per_episode"][name] for name in (*KEPT, "failed")}
    found["competitor"] = not contender.privileged
    return found


def beaten(worse: Evaluation, better: Evaluation) -> dict[str, Any]:
    """Whether the data decide that a row is better than the next."""
    found = compare(total(worse), total(better))
    return {
        "episodes": found.episodes,
        "probability": found.improvement,
        "ci95": list(found.improvement_ci95),
        "decided": found.decided,
    }


def point(scores: Evaluation) -> dict[str, float]:
    """A point of the front: errors, m, and thrust variation, N/s."""
    return {name: float(scores.per_episode[name].mean()) for name in KEPT}
