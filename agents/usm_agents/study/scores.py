"""Scores of agents and classical policies on scenarios that no training has seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from usm_baselines.benchmark.scoring import Refusal, Task, score_all, shared_nominal
from usm_baselines.contender import Contender, contender

from usm_agents.artifact.folder import agent_contender
from usm_agents.learning.plan import TEST_EPISODES, TEST_SEED
from usm_agents.study.plans import AGENTS, HOME, TRANSFER
from usm_agents.study.trainings import StudyTraining
from usm_gym.evaluation import Evaluation, joined
from usm_gym.robot import Robot
from usm_gym.statistics import interquartile_mean, interval, ratio_interval
from usm_gym.suites import unseen
from usm_gym.task.conditions import FIELD
from usm_gym.task.scenario import Mode

# Kept of each episode.
KEPT = (
    "max_error_x",
    "max_error_y",
    "settled_error_x",
    "settled_error_y",
    "thrust_variation",
    "thrust_effort",
)

Document = dict[str, Any]


def tasks(
    chosen: Sequence[StudyTraining], rivals: Sequence[str], episodes: int = TEST_EPISODES
) -> dict[tuple[str, str], Task]:
    """What is scored, by policy and set: all at home, agents and rivals also elsewhere."""
    robot = Robot()
    modes = {run.plan.mode for run in chosen}
    sets = {
        (mode, name): unseen(
            mode, conditions, TEST_SEED, episodes if name == HOME else episodes // 2
        )
        for mode in sorted(modes)
        for name, conditions in {HOME: FIELD, **TRANSFER}.items()
    }
    found = {}

    def add(name: str, policy: Contender, mode: Mode, everywhere: bool) -> None:
        for (its, kind), chosen in sets.items():
            if its == mode and (everywhere or kind == HOME):
                nominal = shared_nominal(robot, chosen)
                found[name, kind] = Task(policy, tuple(chosen), nominal, robot)

    for run in chosen:
        agent = agent_contender(str(run.folder))
        add(run.folder.name, agent, run.plan.mode, run.name in AGENTS)
    for mode in sorted(modes):
        for id in rivals:
            add(rival_name(id, mode), contender(id), mode, everywhere=True)
    return found


def rival_name(id: str, mode: Mode) -> str:
    """The name of a classical policy's scores."""
    return id if mode == "operation" else f"{id} ({mode})"


def score(
    chosen: Mapping[tuple[str, str], Task],
    workers: int,
    cache: Path,
    progress: Callable[[int], object],
) -> dict[tuple[str, str], Evaluation]:
    """Score the tasks.

    Raises:
        ValueError: If a policy is refused.
    """
    outcomes = score_all(list(chosen.values()), workers, cache, progress)
    found = {}
    for key, outcome in zip(chosen, outcomes, strict=True):
        if isinstance(outcome, Refusal):
            raise ValueError(f"{key[0]} on {key[1]} is refused: {outcome.reason}")
        found[key] = outcome
    return found


def document(
    chosen: Sequence[StudyTraining],
    scores: Mapping[tuple[str, str], Evaluation],
    rivals: Sequence[str],
) -> Document:
    """A row for each agent and ablation over its seeds, and one for each rival."""
    rows: dict[str, Any] = {}
    sets = [HOME, *TRANSFER]
    for name in dict.fromkeys(run.name for run in chosen):
        its = [run for run in chosen if run.name == name]
        parts = {
            kind: [scores[run.folder.name, kind] for run in its]
            for kind in sets
            if (its[0].folder.name, kind) in scores
        }
        rows[name] = {
            "agent": name in AGENTS,
            "mode": its[0].plan.mode,
            "base": its[0].plan.base,
            "command": its[0].plan.command(name),
            "curves": {str(run.plan.seed): run.curve for run in its},
            "scores": {kind: row(each) for kind, each in parts.items()},
        }
    modes: dict[Mode, None] = dict.fromkeys(run.plan.mode for run in chosen)
    others = {
        name: {
            "mode": mode,
            "scores": {kind: row([scores[name, kind]]) for kind in sets},
        }
        for mode in modes
        for name in (rival_name(id, mode) for id in rivals)
    }
    return {
        "kind": "study",
        "study": "residual",
        "home": HOME,
        "seed": TEST_SEED,
        "rows": rows,
        "rivals": others,
        "against": claims(rows, others),
    }


def row(parts: Sequence[Evaluation]) -> dict[str, Any]:
    """Scores over seeds, as `Evaluation.summary` has them, with middle half and the seeds' means.

    Seeds are strata of the bootstrap, whose episodes are resampled; episodes are in the order of
    the seeds.
    """
    scores = joined(parts)
    labels = [str(seed) for seed, part in enumerate(parts) for _ in part.failed]
    found: dict[str, Any] = {"failures": int(scores.failed.sum()), "per_episode": {}}
    for name in KEPT:
        values = scores.per_episode[name]
        found["per_episode"][name] = values.tolist()
        found[name] = {
            "mean": float(values.mean()),
            "ci95": list(interval(np.mean, values, labels)),
            "iqm": float(interquartile_mean(values)),
            "iqm_ci95": list(interval(interquartile_mean, values, labels)),
            "worst": float(values.max()),
            "seeds": [float(part.per_episode[name].mean()) for part in parts],
        }
    return found


def claims(rows: Mapping[str, Any], rivals: Mapping[str, Any]) -> dict[str, Any]:
    """What agents are to the classical policies of their mode at home, scenario by scenario.

    Args:
        rows: Agents and ablations, as in `document`.
        rivals: Classical policies, the same.

    Returns:
        For each agent and rival: the ratio of their means in x and y over all seeds, with its
        intervals; in what share of scenarios the agent, as its seed 0, is better in both axes; and
        how many of its seeds are better in the mean of both.
    """
    return {
        name: {
            rival: against(each["scores"][HOME], other["scores"][HOME])
            for rival, other in rivals.items()
            if other["mode"] == each["mode"]
        }
        for name, each in rows.items()
        if each["agent"]
    }


def against(ours: Mapping[str, Any], theirs: Mapping[str, Any]) -> dict[str, Any]:
    """What the row of an agent is to the row of a policy without seeds; see `claims`."""
    ratios, intervals, better, seeds = [], [], [], []
    for axis in ("max_error_x", "max_error_y"):
        their = np.array(theirs["per_episode"][axis])
        our = np.array(ours["per_episode"][axis]).reshape(-1, len(their))
        labels = [str(seed) for seed, part in enumerate(our) for _ in part]
        ratios.append(float(our.mean() / their.mean()))
        intervals.append(ratio_interval(our.ravel(), np.tile(their, len(our)), labels))
        better.append(our[0] < their)
        seeds.append(our.mean(axis=1) < their.mean())
    return {
        "ratio": ratios,
        "ratio_ci95": intervals,
        "better_in_both": float(np.mean(np.all(better, axis=0))),
        "better_seeds": int(np.sum(np.all(seeds, axis=0))),
    }


def best_so_far(curves: Mapping[str, Any]) -> dict[int, float]:
    """By steps: validated error x + y of the best agent so far, the median over the seeds, m."""
    errors = [
        np.minimum.accumulate([point["max_error_x"] + point["max_error_y"] for point in curve])
        for curve in curves.values()
    ]
    points = zip(next(iter(curves.values())), zip(*errors, strict=False), strict=False)
    return {point["steps"]: float(np.median(each)) for point, each in points}


def steps_to(curves: Mapping[str, Any], error: float) -> int | None:
    """After how many steps the best agents so far are as good as that; see `best_so_far`."""
    return next((steps for steps, each in best_so_far(curves).items() if each <= error), None)
