"""Scores of agents and classical policies on scenarios that no training has seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from usm_baselines.benchmark.scoring import Job, Refusal, score_all
from usm_baselines.contender import Contender, contender

from usm_agents.artifact.folder import agent_contender
from usm_agents.learning.plan import TEST_EPISODES, TEST_SEED
from usm_agents.study.dissection import dissected
from usm_agents.study.plans import AGENTS, HOME, TRANSFER
from usm_agents.study.results import (
    MAIN_MODE,
    Claim,
    CurvePoint,
    Rival,
    SeedScores,
    SeedSummary,
    StudyResult,
    Trained,
)
from usm_agents.study.trainings import StudyTraining
from usm_gym.evaluation import Evaluation
from usm_gym.statistics import interquartile_mean, interval, ratio_interval
from usm_gym.suites import unseen
from usm_gym.support.results import Provenance
from usm_gym.support.validation import UsageError
from usm_gym.task.conditions import FIELD
from usm_gym.task.metrics import ANGLE_ERROR, MAX_ERROR, attitude_of, axes_of
from usm_gym.task.nominal import shared_nominal
from usm_gym.task.scenario import Mode

# Kept of every episode, by axis and besides; so are the errors of the attitude.
ERRORS, OTHERS = ("max_error", "settled_error"), ("thrust_variation", "thrust_effort")


def jobs(
    chosen: Sequence[StudyTraining], rivals: Sequence[str], episodes: int = TEST_EPISODES
) -> dict[tuple[str, str], Job]:
    """What is scored, by policy and set: all at home, agents and rivals also elsewhere."""
    modes = {training.plan.mode for training in chosen}
    sets = {
        (mode, name): unseen(
            mode, conditions, TEST_SEED, episodes if name == HOME else episodes // 2
        )
        for mode in sorted(modes)
        for name, conditions in {HOME: FIELD, **TRANSFER}.items()
    }
    planned = {}

    def add(name: str, policy: Contender, mode: Mode, everywhere: bool) -> None:
        for (its, kind), chosen in sets.items():
            if its == mode and (everywhere or kind == HOME):
                nominal = shared_nominal(chosen)
                planned[name, kind] = Job(policy, tuple(chosen), nominal)

    for training in chosen:
        agent = agent_contender(str(training.folder))
        add(training.folder.name, agent, training.plan.mode, training.name in AGENTS)
    for mode in sorted(modes):
        for id in rivals:
            add(rival_name(id, mode), contender(id), mode, everywhere=True)
    return planned


def rival_name(id: str, mode: Mode) -> str:
    """The name of a classical policy's scores."""
    return id if mode == MAIN_MODE else f"{id} ({mode})"


def score(
    chosen: Mapping[tuple[str, str], Job],
    workers: int,
    cache: Path,
    progress: Callable[[int], object],
) -> dict[tuple[str, str], Evaluation]:
    """Score policies.

    Raises:
        UsageError: If a policy is refused.
    """
    outcomes = score_all(list(chosen.values()), workers, cache, progress)
    scores = {}
    for key, outcome in zip(chosen, outcomes, strict=True):
        if isinstance(outcome, Refusal):
            raise UsageError(f"{key[0]} on {key[1]} is refused: {outcome.reason}")
        scores[key] = outcome
    return scores


def study(
    chosen: Sequence[StudyTraining],
    scores: Mapping[tuple[str, str], Evaluation],
    rivals: Sequence[str],
    episodes: int,
    provenance: Provenance,
) -> StudyResult:
    """One row per agent and ablation over its seeds, and one per rival."""
    rows: dict[str, Trained] = {}
    sets = [HOME, *TRANSFER]
    for name in dict.fromkeys(training.name for training in chosen):
        its = [training for training in chosen if training.name == name]
        parts = {
            kind: [scores[training.folder.name, kind] for training in its]
            for kind in sets
            if (its[0].folder.name, kind) in scores
        }
        plan = its[0].plan
        rows[name] = Trained(
            agent=name in AGENTS,
            mode=plan.mode,
            base=plan.base,
            command=plan.command(name),
            curves={str(training.plan.seed): training.curve for training in its},
            scores={kind: over_seeds(seeds) for kind, seeds in parts.items()},
        )
    modes: dict[Mode, None] = dict.fromkeys(training.plan.mode for training in chosen)
    others = {
        name: Rival(mode=mode, scores={kind: over_seeds([scores[name, kind]]) for kind in sets})
        for mode in modes
        for name in (rival_name(id, mode) for id in rivals)
    }
    return StudyResult(
        study="residual",
        home=HOME,
        seed=TEST_SEED,
        rows=rows,
        rivals=others,
        against=claims(rows, others),
        episodes=episodes,
        dissected=dissected(chosen),
        provenance=provenance,
    )


def over_seeds(parts: Sequence[Evaluation]) -> SeedScores:
    """Scores of some seeds, all of which have met the same episodes."""
    scores = parts[0].per_episode
    kept = [f"{name}_{axis}" for name in ERRORS for axis in axes_of(scores)]
    kept += [angle + ANGLE_ERROR for angle in attitude_of(scores)]
    tables = {
        name: np.array([part.per_episode[name] for part in parts]) for name in (*kept, *OTHERS)
    }
    return summarised(tables, failures=sum(int(part.failed.sum()) for part in parts))


def summarised(tables: Mapping[str, NDArray[np.float64]], failures: int) -> SeedScores:
    """Scores from tables by metric, (seeds, episodes), of which both are resampled."""
    return SeedScores(
        failures=failures,
        per_episode={name: tuple(table.ravel().tolist()) for name, table in tables.items()},
        metrics={
            name: SeedSummary(
                mean=float(table.mean()),
                ci95=interval(np.mean, table),
                iqm=float(interquartile_mean(table.ravel())),
                iqm_ci95=interval(interquartile_mean, table),
                worst=float(table.max()),
                seeds=tuple(table.mean(axis=1).tolist()),
            )
            for name, table in tables.items()
        },
    )


def claims(rows: Mapping[str, Trained], rivals: Mapping[str, Rival]) -> dict[str, dict[str, Claim]]:
    """What agents are to the classical policies of their mode at home, scenario by scenario."""
    return {
        name: {
            rival: against(row.scores[HOME], other.scores[HOME])
            for rival, other in rivals.items()
            if other.mode == row.mode
        }
        for name, row in rows.items()
        if row.agent
    }


def against(ours: SeedScores, theirs: SeedScores) -> Claim:
    """What an agent is to a policy without seeds."""
    ratios, intervals, better, seeds = [], [], [], []
    for metric in (MAX_ERROR + axis for axis in ours.axes):
        our, their = ours.table(metric), theirs.table(metric)
        ratios.append(float(our.mean() / their.mean()))
        intervals.append(ratio_interval(our, their))
        better.append(our[0] < their[0])
        seeds.append(our.mean(axis=1) < their.mean())
    return Claim(
        ratio=tuple(ratios),
        ratio_ci95=tuple(intervals),
        better_in_both=float(np.mean(np.all(better, axis=0))),
        better_seeds=int(np.sum(np.all(seeds, axis=0))),
    )


def best_so_far(curves: Mapping[str, Sequence[CurvePoint]]) -> dict[int, float]:
    """By steps: validated objective of the best agent so far, the median over the seeds, mm."""
    best = [
        np.minimum.accumulate([point.objective for point in curve]) for curve in curves.values()
    ]
    points = zip(next(iter(curves.values())), zip(*best, strict=False), strict=False)
    return {point.steps: float(np.median(values)) for point, values in points}


def steps_to(curves: Mapping[str, Sequence[CurvePoint]], objective: float) -> int | None:
    """After how many steps the best agents so far are as good as that; see `best_so_far`."""
    return next((steps for steps, best in best_so_far(curves).items() if best <= objective), None)
