"""Statistics of episodes: means, quartiles and paired comparisons with bootstrap intervals.

The methods are those that Agarwal et al., "Deep reinforcement learning at the edge of the
statistical precipice" (NeurIPS 2021), recommend, on the bootstrap of scipy: stratified (every
stratum is resampled by itself), percentile intervals of 95 %, without randomness. Policies meet
the same scenarios and noise, so that comparisons are paired: episodes are resampled, not policies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.support.validation import require

RESAMPLES = 10_000
# Single episodes are chaotic: from fewer no conclusion is drawn.
FEWEST_EPISODES = 50

Array = NDArray[np.float64]
Interval = tuple[float, float]


def interval(
    statistic: Callable[..., Any], values: ArrayLike, strata: Sequence[str] | None = None
) -> Interval:
    """95 % percentile bootstrap interval of a statistic, always the same for the same values.

    Args:
        statistic: A function of an array and an `axis`, for instance `np.mean`.
        values: One value per episode, (episodes,).
        strata: To which stratum each episode belongs; without it, all are one.
    """
    from scipy.stats import bootstrap  # here, because its import takes longer than a first step

    sample = np.asarray(values, np.float64)
    if sample.size < 2:
        value = float(statistic(sample, axis=-1))
        return value, value
    labels = np.zeros(sample.size) if strata is None else np.asarray(strata)
    parts = [sample[labels == label] for label in dict.fromkeys(labels.tolist())]
    limits = bootstrap(
        parts,
        lambda *drawn, axis: statistic(np.concatenate(drawn, axis=axis), axis=axis),
        n_resamples=RESAMPLES,
        method="percentile",
        vectorized=True,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(limits.low), float(limits.high)


def mean_interval(values: Array) -> tuple[float, Interval]:
    """Mean of the episodes and its 95 % interval.

    Args:
        values: One value per episode, (episodes,).
    """
    return float(np.mean(values)), interval(np.mean, values)


def ratio_interval(
    first: ArrayLike, second: ArrayLike, strata: Sequence[str] | None = None
) -> Interval:
    """Interval of the mean of a first policy over that of a second, on the same episodes.

    Args:
        first: Scores of the first policy, one per episode, (episodes,).
        second: The same of the second policy, in the same order.
        strata: To which stratum each episode belongs; without it, all are one.
    """
    one, other = np.asarray(first, np.float64), np.asarray(second, np.float64)

    def ratio(drawn: Array, axis: int) -> Any:
        index = drawn.astype(np.intp)
        return one[index].mean(axis=axis) / other[index].mean(axis=axis)

    return interval(ratio, np.arange(one.size), strata)


def interquartile_mean(values: Any, axis: int = -1) -> Any:
    """Mean of the middle half of the episodes, which no outlier moves."""
    from scipy.stats import trim_mean

    return trim_mean(values, 0.25, axis=axis)


def improvement(differences: ArrayLike, axis: int = -1) -> Any:
    """Share of episodes with a difference below 0, ties counting half."""
    return 0.5 - 0.5 * np.mean(np.sign(differences), axis=axis)


@dataclass(frozen=True)
class Comparison:
    """How a second policy differs from a first on the same episodes; less is better.

    Attributes:
        episodes: How many.
        first: Mean of the first policy.
        second: Mean of the second policy.
        difference: Mean of second - first, pair by pair.
        difference_ci95: Its interval.
        improvement: Probability that the second does better in an episode.
        improvement_ci95: Its interval.
    """

    episodes: int
    first: float
    second: float
    difference: float
    difference_ci95: Interval
    improvement: float
    improvement_ci95: Interval

    @property
    def decided(self) -> bool:
        """Whether the data decide: enough episodes, and an interval that leaves out 0."""
        low, high = self.difference_ci95
        return self.episodes >= FEWEST_EPISODES and not low <= 0.0 <= high

    def verdict(self, first: str, second: str) -> str:
        """Say in words what follows, given the policies' names."""
        if self.episodes < FEWEST_EPISODES:
            return (
                f"no conclusion: {self.episodes} episodes, and {FEWEST_EPISODES} are the fewest "
                "from which one is drawn"
            )
        if not self.decided:
            return f"the data do not decide between {first} and {second}"
        better, worse = (first, second) if self.difference > 0 else (second, first)
        return f"the data decide: {better} is better than {worse}"


def compare(first: ArrayLike, second: ArrayLike, strata: Sequence[str] | None = None) -> Comparison:
    """Compare two policies on the same episodes.

    Args:
        first: Scores of the first policy, one per episode, less being better, (episodes,).
        second: The same of the second policy, in the same order.
        strata: To which stratum each episode belongs; without it, all are one.

    Raises:
        ValueError: If the numbers of episodes differ, or there is none.
    """
    one, other = np.asarray(first, np.float64), np.asarray(second, np.float64)
    require(one.shape == other.shape, "second", other.shape, f"the shape of the first, {one.shape}")
    require(one.ndim == 1 and one.size > 0, "first", one.shape, "one episode or more")
    differences = other - one
    return Comparison(
        episodes=one.size,
        first=float(one.mean()),
        second=float(other.mean()),
        difference=float(differences.mean()),
        difference_ci95=interval(np.mean, differences, strata),
        improvement=float(improvement(differences)),
        improvement_ci95=interval(improvement, differences, strata),
    )


def performance_profile(values: ArrayLike, thresholds: ArrayLike) -> tuple[Array, Array]:
    """Share of episodes with a score up to each threshold, and its pointwise 95 % interval.

    Args:
        values: A score per episode, (episodes,).
        thresholds: Thresholds, (thresholds,).

    Returns:
        Shares, (thresholds,), and their lower and upper limits, (2, thresholds).
    """
    sample = np.asarray(values, np.float64)
    below = sample[:, None] <= np.asarray(thresholds, np.float64)
    shares = below.mean(axis=0)
    drawn = np.random.default_rng(0).multinomial(
        sample.size, np.full(sample.size, 1 / sample.size), RESAMPLES
    )
    return shares, np.quantile(drawn @ below / sample.size, (0.025, 0.975), axis=0)
