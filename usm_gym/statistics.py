"""Statistics of episodes: means, quartiles and paired comparisons with bootstrap intervals.

The methods are those that Agarwal et al., "Deep reinforcement learning at the edge of the
statistical precipice" (NeurIPS 2021), recommend: percentile intervals of 95 %, without randomness.
Policies meet the same scenarios and noise, so that comparisons are paired: episodes are resampled,
not policies.

Seeds of a training all meet the same scenarios, so their scores are a crossed table, and no two of
them are independent. There, seeds and scenarios are drawn each for themselves and then crossed, the
two-way bootstrap of Owen, "The pigeonhole bootstrap" (Annals of Applied Statistics, 2007). With one
seed it is the ordinary bootstrap of the episodes and says nothing about another training. Few seeds
vary less than all there could be: an interval of five covers some 87 % where seeds dominate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.support.validation import require

RESAMPLES = 10_000
# Into so many parts they are cut, to bound the memory.
PARTS = 20
# Single episodes are chaotic: from fewer no conclusion is drawn.
FEWEST_EPISODES = 50
# Quantiles between which a 95 % interval lies.
LIMITS = (0.025, 0.975)

Array = NDArray[np.float64]
Interval = tuple[float, float]


def interval(statistic: Callable[..., Any], values: ArrayLike) -> Interval:
    """95 % percentile bootstrap interval of a statistic, always the same for the same values.

    Args:
        statistic: A function of an array and an `axis`, for instance `np.mean`.
        values: One value per episode, (episodes,), or per seed and episode, (seeds, episodes).
    """
    table = np.atleast_2d(np.asarray(values, np.float64))
    return _interval(
        lambda seeds, episodes: statistic(_crossed(table, seeds, episodes), axis=-1), *table.shape
    )


def mean_interval(values: Array) -> tuple[float, Interval]:
    """Mean of the episodes and its 95 % interval.

    Args:
        values: One value per episode, (episodes,).
    """
    return float(np.mean(values)), interval(np.mean, values)


def ratio_interval(first: ArrayLike, second: ArrayLike, *, same_seeds: bool = False) -> Interval:
    """Interval of the mean of first scores over that of second ones, on the same episodes.

    Both meet the same draw of episodes; the seeds of each are drawn for themselves.

    Args:
        first: Scores of the first policy, (episodes,) or (seeds, episodes).
        second: The same of the second policy, with its own number of seeds.
        same_seeds: Whether both are scores of the same trainings, whose seeds are drawn once.

    Raises:
        ValueError: If the numbers of episodes differ, or those of the same seeds.
    """
    one, other = _tables(first, second)

    def ratio(ours: Any, theirs: Any, episodes: Any) -> Any:
        mean = _crossed(one, ours, episodes).mean(axis=-1)
        return mean / _crossed(other, theirs, episodes).mean(axis=-1)

    if same_seeds:
        require(len(one) == len(other), "seeds of the second", len(other), f"{len(one)}")
        return _interval(lambda seeds, episodes: ratio(seeds, seeds, episodes), *one.shape)
    return _interval(ratio, len(one), len(other), one.shape[1])


def crossed_improvement(first: ArrayLike, second: ArrayLike) -> tuple[float, Interval]:
    """Probability that a first policy does better than a second in an episode, and its interval.

    Every seed of one meets every seed of the other, on the same episodes; ties count half. For the
    interval, both have their seeds drawn for themselves, and one draw of episodes.

    Args:
        first: Scores of the first policy, less being better, (episodes,) or (seeds, episodes).
        second: The same of the second policy, with its own number of seeds.

    Raises:
        ValueError: If the numbers of episodes differ.
    """
    one, other = _tables(first, second)
    better = 0.5 - 0.5 * np.sign(one[:, None] - other[None])

    def share(ours: Any, theirs: Any, episodes: Any) -> Any:
        drawn = ours[:, :, None, None], theirs[:, None, :, None], episodes[:, None, None, :]
        return better[drawn].mean(axis=(1, 2, 3))

    return float(better.mean()), _interval(share, len(one), len(other), one.shape[1])


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
        return _decided(self.episodes, self.difference_ci95)

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


def compare(first: ArrayLike, second: ArrayLike) -> Comparison:
    """Compare two policies on the same episodes.

    Args:
        first: Scores of the first policy, one per episode, less being better, (episodes,).
        second: The same of the second policy, in the same order.

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
        difference_ci95=interval(np.mean, differences),
        improvement=float(improvement(differences)),
        improvement_ci95=interval(improvement, differences),
    )


def told_apart(scores: ArrayLike) -> NDArray[np.bool_]:
    """Between which policies the data decide, as `compare` says of two, (policies, policies).

    Args:
        scores: Scores of each policy on the same episodes, (policies, episodes).
    """
    table = np.asarray(scores, np.float64)
    count, episodes = table.shape
    apart = np.zeros((count, count), bool)
    if episodes < FEWEST_EPISODES:
        return apart
    draws = _draws(np.random.default_rng(0), episodes)
    means = np.concatenate([table[:, part].mean(axis=-1) for part in draws], axis=-1)
    for index in range(count - 1):
        low, high = np.quantile(means[index + 1 :] - means[index], LIMITS, axis=-1)
        apart[index, index + 1 :] = (low > 0.0) | (high < 0.0)
    return apart | apart.T


def performance_profile(values: ArrayLike, thresholds: ArrayLike) -> tuple[Array, Array]:
    """Share of episodes with a score up to each threshold, and its pointwise 95 % interval.

    Args:
        values: A score per episode, (episodes,), or per seed and episode, (seeds, episodes).
        thresholds: Thresholds, (thresholds,).

    Returns:
        Shares, (thresholds,), and their lower and upper limits, (2, thresholds).
    """
    table = np.atleast_2d(np.asarray(values, np.float64))
    below = (table[:, :, None] <= np.asarray(thresholds, np.float64)).astype(np.float64)
    rng = np.random.default_rng(0)
    counts = [
        rng.multinomial(size, np.full(size, 1 / size), RESAMPLES) for size in table.shape[::-1]
    ]
    drawn = np.concatenate(
        [
            np.einsum("re,ret->rt", episodes, np.tensordot(seeds, below, 1), optimize=True)
            for episodes, seeds in zip(*(np.array_split(o, PARTS) for o in counts), strict=True)
        ]
    )
    limits = np.quantile(drawn / table.size, LIMITS, axis=0)
    return below.mean(axis=(0, 1)), limits


def _decided(episodes: int, difference_ci95: Interval) -> bool:
    low, high = difference_ci95
    return episodes >= FEWEST_EPISODES and not low <= 0.0 <= high


def _interval(statistic: Callable[..., Any], *sizes: int) -> Interval:
    """Interval of a statistic of indices, of which each kind is drawn for itself.

    Args:
        statistic: A function of one array of indices per kind, (resamples, size).
        sizes: How many there are of each kind.
    """
    rng = np.random.default_rng(0)
    kinds = []
    for size in sizes:
        kinds.append(_draws(deepcopy(rng), size))
        for _ in _draws(rng, size):  # all of a kind are drawn before the next kind
            pass
    values = np.concatenate([statistic(*part) for part in zip(*kinds, strict=True)])
    low, high = np.quantile(values, LIMITS)
    return float(low), float(high)


def _draws(rng: np.random.Generator, size: int) -> Iterator[NDArray[np.int64]]:
    """Draw indices below `size` part by part, (resamples of the part, size)."""
    for part in np.array_split(np.arange(RESAMPLES), PARTS):
        yield rng.integers(size, size=(part.size, size))


def _tables(first: ArrayLike, second: ArrayLike) -> tuple[Array, Array]:
    """Scores of two policies as (seeds, episodes), on the same episodes."""
    one, other = (np.atleast_2d(np.asarray(scores, np.float64)) for scores in (first, second))
    count = one.shape[1]
    require(other.shape[1] == count, "episodes of the second", other.shape[1], f"{count}")
    return one, other


def _crossed(table: Array, seeds: Any, episodes: Any) -> Array:
    """Every drawn seed on every drawn episode, (resamples, seeds * episodes)."""
    drawn = table[seeds[:, :, None], episodes[:, None, :]]
    return np.asarray(drawn.reshape(len(drawn), -1))
