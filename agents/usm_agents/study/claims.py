"""What follows from scores over seeds: summaries, claims of one policy against another, curves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from usm_agents.study.results import Claim, CurvePoint, Estimated, SeedScores, SeedSummary
from usm_gym.evaluation import SHIFT_METRICS, Evaluation
from usm_gym.statistics import (
    crossed_improvement,
    interquartile_mean,
    interval,
    ratio_interval,
)
from usm_gym.task.metrics import ANGLE_ERROR, MAX_ERROR, attitude_of, axes_of

# Kept of every episode, by axis and besides; so are the errors of the attitude.
ERRORS, OTHERS = ("max_error", "settled_error"), ("thrust_variation", "thrust_effort")
# The shifts of a scan whose errors are compared.
EARLY, LATE = "first_shift_error", "fifth_shift_error"


def over_seeds(parts: Sequence[Evaluation], by_shift: bool = False) -> SeedScores:
    """Scores of some seeds, all of which have met the same episodes.

    Args:
        parts: The scores of every seed.
        by_shift: Whether to keep the errors after the shifts of scans, where there are some.
    """
    scores = parts[0].per_episode
    errors = [*ERRORS, *(SHIFT_METRICS if by_shift else ())]
    names = [f"{name}_{axis}" for name in errors for axis in axes_of(scores)]
    names += [angle + ANGLE_ERROR for angle in attitude_of(scores)]
    tables = {
        name: np.array([part.per_episode[name] for part in parts])
        for name in (*names, *OTHERS)
        if name in scores
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


def against(ours: SeedScores, theirs: SeedScores) -> Claim:
    """What one policy is to another in the same episodes, each under its own seeds."""
    errors = [MAX_ERROR + axis for axis in ours.axes]
    metrics = [*errors, *(angle + ANGLE_ERROR for angle in ours.attitude), "thrust_variation"]
    tables = {metric: (ours.table(metric), theirs.table(metric)) for metric in metrics}
    tables["objective"] = ours.objectives, theirs.objectives
    better = [
        np.array(ours.metrics[metric].seeds) < theirs.metrics[metric].mean for metric in errors
    ]
    return Claim(
        ratios={
            metric: Estimated(
                value=float(mine.mean() / other.mean()), ci95=ratio_interval(mine, other)
            )
            for metric, (mine, other) in tables.items()
            if other.mean() > 0.0
        },
        improvements={
            axis: Estimated(*crossed_improvement(ours.table(metric), theirs.table(metric)))
            for axis, metric in zip(ours.axes, errors, strict=True)
        },
        better_seeds=int(np.sum(np.all(better, axis=0))),
    )


def adaptation(scores: SeedScores) -> dict[str, Estimated]:
    """Ratio of the mean errors after the fifth and the first shift of scans, by axis; else none."""
    if not scores.by_shift:
        return {}
    pairs = {
        axis: [scores.table(f"{name}_{axis}") for name in (LATE, EARLY)] for axis in scores.axes
    }
    return {
        axis: Estimated(
            value=float(late.mean() / early.mean()),
            ci95=ratio_interval(late, early, same_seeds=True),
        )
        for axis, (late, early) in pairs.items()
    }


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
