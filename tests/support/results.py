"""Results that are made up, on any axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from usm_agents.learning.checkpoint import CURVE
from usm_agents.study import scores as scoring
from usm_agents.study.results import StudyResult
from usm_agents.study.trainings import planned
from usm_baselines.benchmark.results import CompetitorScores, EvaluationResult, Summary

from usm_gym import statistics
from usm_gym.evaluation import Evaluation, metric_names
from usm_gym.robot import Robot
from usm_gym.support.files import write_json
from usm_gym.support.results import Provenance
from usm_gym.task.scenario import Scenario
from usm_gym.world import world_of

PROVENANCE = Provenance(
    version="0.1.0", commit=None, packages={"python": "3"}, seeds={}, command="usm"
)


def summary(mean: float) -> Summary:
    """Return the summary of a metric."""
    return Summary(mean=mean, ci95=(0.9 * mean, 1.1 * mean), worst=2.0 * mean)


def scores(axes: Sequence[str], size: float, episodes: int) -> CompetitorScores:
    """Return scores that grow from axis to axis."""
    errors = {axis: size * (k + 1) for k, axis in enumerate(axes)}
    metrics = {f"max_error_{axis}": summary(error) for axis, error in errors.items()}
    metrics |= {f"settled_error_{axis}": summary(0.5 * error) for axis, error in errors.items()}
    metrics |= {f"rms_error_{axis}": summary(0.3 * error) for axis, error in errors.items()}
    metrics |= {name: summary(3.0) for name in ("thrust_effort", "thrust_variation")}
    per_episode = {f"max_error_{axis}": (error,) * episodes for axis, error in errors.items()}
    per_episode["thrust_variation"] = (3.0,) * episodes
    return CompetitorScores(metrics=metrics, failures=0, per_episode=per_episode, competitor=True)


def evaluation(
    axes: Sequence[str], policies: Sequence[str], scenarios: Sequence[Scenario]
) -> EvaluationResult:
    """Return an evaluation of policies, the first of which is the best."""
    return EvaluationResult(
        suite=None,
        conditions=scenarios[0].conditions,
        conditions_override=None,
        settle_time=scenarios[0].settle_time,
        episodes=len(scenarios),
        scenarios=tuple(scenarios),
        results={
            name: scores(axes, 1e-3 * (k + 1), len(scenarios)) for k, name in enumerate(policies)
        },
        refused={},
        provenance=PROVENANCE,
    )


def study(names: Sequence[str], seeds: int, episodes: int) -> StudyResult:
    """Return a study of agents that learn by estimates, whose scores are drawn at random."""
    random = np.random.default_rng(0)
    metrics = metric_names(world_of(Robot()), by_shift=True)
    few = patch.object(statistics, "RESAMPLES", 100)
    with few, TemporaryDirectory() as folder:
        chosen = planned(names, seeds, Path(folder))
        for training in chosen:
            training.folder.mkdir(parents=True)
            points = [dict.fromkeys(metrics, 1e-3 / (k + 1)) for k in range(3)]
            for k, point in enumerate(points):
                point |= {"steps": 100 * k, "seconds": 1.0, "failures": 0}
            write_json(training.folder / CURVE, points)
        rivals = scoring.rivals(chosen)
        outcomes = {
            scoring.Key(home, policy, where): Evaluation(
                {name: random.lognormal(-6.0, 0.5, episodes) for name in metrics},
                np.zeros(episodes, bool),
            )
            for home, others in rivals.items()
            for where in home.sets
            for policy in (*others, *(training.folder.name for training in chosen))
        }
        return scoring.study(chosen, rivals, outcomes, episodes, PROVENANCE)
