"""Statistics of a suite: means with bootstrap intervals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 10_000


def mean_interval(values: NDArray[np.float64]) -> tuple[float, tuple[float, float]]:
    """Mean of the episodes and its 95 % percentile bootstrap interval, without randomness.

    Args:
        values: One value per episode, (episodes,).
    """
    from scipy.stats import bootstrap  # here, because its import takes longer than a first step

    mean = float(np.mean(values))
    if len(values) < 2:
        return mean, (mean, mean)
    interval = bootstrap(
        (values,), np.mean, n_resamples=RESAMPLES, method="percentile", rng=np.random.default_rng(0)
    ).confidence_interval
    return mean, (float(interval.low), float(interval.high))
