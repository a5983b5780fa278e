"""Intervals, middle halves and verdicts are what they are called."""

import itertools
import random
from fractions import Fraction
from statistics import fmean

import numpy as np
import pytest
import scipy

from usm_gym import statistics
from usm_gym.statistics import (
    compare,
    crossed_improvement,
    improvement,
    interquartile_mean,
    interval,
    ratio_interval,
    told_apart,
)


def test_an_interval_covers_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    limits = [interval(np.mean, rng.exponential(size=60)) for _ in range(100)]
    assert 88 <= sum(low <= 1.0 <= high for low, high in limits) <= 99


@pytest.mark.parametrize("episodes", [49, 50])
@pytest.mark.parametrize("lead", [0.0, 0.2, 0.3, 1.0, -1.0])
def test_two_are_told_apart_where_their_comparison_decides(episodes: int, lead: float) -> None:
    rng = np.random.default_rng(2)
    table = rng.standard_normal((3, episodes))
    table[1] += lead
    found = told_apart(table)
    for one, other in itertools.product(range(3), repeat=2):
        assert found[one, other] == compare(table[one], table[other]).decided


def test_intervals_have_no_randomness() -> None:
    values = np.random.default_rng(1).random(50)
    assert interval(np.mean, values) == interval(np.mean, values)
    assert interval(np.mean, [2.0]) == (2.0, 2.0)


def test_seeds_and_scenarios_are_drawn_each_for_themselves_and_crossed() -> None:
    rng, source = np.random.default_rng(5), random.Random(0)
    table = rng.exponential(size=(3, 1)) + rng.exponential(size=8) + rng.exponential(size=(3, 8))
    rows = table.tolist()
    means = []
    for _ in range(20_000):
        episodes = source.choices(range(8), k=8)
        means.append(fmean(row[k] for row in source.choices(rows, k=3) for k in episodes))
    low, high = np.quantile(means, (0.025, 0.975))
    assert interval(np.mean, table) == pytest.approx((low, high), abs=0.03 * (high - low))


def test_with_one_seed_it_is_the_ordinary_bootstrap() -> None:
    values = np.random.default_rng(6).exponential(size=60)
    for statistic in (np.mean, interquartile_mean):
        options = {"n_resamples": statistics.RESAMPLES, "method": "percentile"}
        rng = np.random.default_rng(1)
        ordinary = scipy.stats.bootstrap([values], statistic, rng=rng, **options)
        low, high = ordinary.confidence_interval
        found = interval(statistic, values)
        assert found == interval(statistic, values[None])
        assert found == pytest.approx((low, high), abs=0.03 * (high - low))


def test_indices_are_drawn_in_parts_to_the_bits_of_one_draw() -> None:
    rng = np.random.default_rng(8)
    one, other = rng.exponential(size=(3, 11)), rng.exponential(size=(5, 11))
    source = np.random.default_rng(0)
    ours, theirs, episodes = (
        source.integers(size, size=(statistics.RESAMPLES, size)) for size in (3, 5, 11)
    )
    means = [
        table[seeds[:, :, None], episodes[:, None, :]].reshape(len(seeds), -1).mean(axis=1)
        for table, seeds in ((one, ours), (other, theirs))
    ]
    low, high = np.quantile(means[0] / means[1], (0.025, 0.975))
    assert ratio_interval(one, other) == (low, high)


def test_equal_seeds_add_nothing() -> None:
    values = np.random.default_rng(7).exponential(size=60)
    low, high = interval(np.mean, values)
    several = interval(np.mean, np.tile(values, (5, 1)))
    assert several == pytest.approx((low, high), abs=0.03 * (high - low))


def test_a_table_is_covered_where_resampling_episodes_within_each_seed_is_too_narrow() -> None:
    rng = np.random.default_rng(8)
    crossed = within = 0
    for _ in range(80):
        seeds, episodes = rng.normal(size=(8, 1)), rng.normal(size=30)
        table = 0.5 * (seeds + episodes + rng.normal(size=(8, 30)))
        low, high = interval(np.mean, table)
        crossed += low <= 0.0 <= high
        drawn = [row[rng.integers(30, size=(1000, 30))].mean(axis=1) for row in table]
        low, high = np.quantile(np.mean(drawn, axis=0), (0.025, 0.975))
        within += low <= 0.0 <= high
    assert 66 <= crossed <= 79  # 83 to 99 %
    assert within < 40


def test_where_scenarios_cancel_a_ratio_is_one_of_seeds() -> None:
    # Scores are a product of seed and scenario: the ratio of any draw is that of the drawn seeds.
    scenarios = np.random.default_rng(9).exponential(size=20)
    ours, theirs = np.array([1.0, 2.0, 4.0]), np.array([3.0, 5.0])
    draws = itertools.product(
        itertools.product(ours, repeat=3), itertools.product(theirs, repeat=2)
    )
    ratios = sorted(Fraction(fmean(our)) / Fraction(fmean(their)) for our, their in draws)
    limits = [float(ratios[int(share * len(ratios))]) for share in (0.025, 0.975)]
    tables = ours[:, None] * scenarios, theirs[:, None] * scenarios
    assert ratio_interval(*tables) == pytest.approx(limits)
    # A rival without seeds meets the same draw of scenarios.
    assert ratio_interval(tables[0][:1], scenarios) == pytest.approx((1.0, 1.0))
    with pytest.raises(ValueError, match="episodes of the second"):
        ratio_interval(tables[0], scenarios[:-1])


def test_the_seeds_of_one_training_are_drawn_once_for_both_scores() -> None:
    scores = np.random.default_rng(10).exponential(size=(4, 20))
    assert ratio_interval(0.5 * scores, scores, same_seeds=True) == pytest.approx((0.5, 0.5))
    low, high = ratio_interval(0.5 * scores, scores)
    assert low < 0.5 < high
    with pytest.raises(ValueError, match="seeds of the second"):
        ratio_interval(scores, scores[:3], same_seeds=True)


def test_a_crossed_improvement_counts_all_pairs_of_seeds_in_an_episode() -> None:
    rng, source = np.random.default_rng(11), random.Random(1)
    one = rng.integers(4, size=(3, 9)).astype(float)
    other = rng.integers(5, size=(4, 9)).astype(float)

    def counted(ours: list[int], theirs: list[int], episodes: list[int]) -> float:
        wins = [
            1.0 if one[i, e] < other[j, e] else 0.5 if one[i, e] == other[j, e] else 0.0
            for i in ours
            for j in theirs
            for e in episodes
        ]
        return fmean(wins)

    value, found = crossed_improvement(one, other)
    assert value == pytest.approx(counted([0, 1, 2], [0, 1, 2, 3], list(range(9))))
    draws = [[source.choices(range(n), k=n) for n in (3, 4, 9)] for _ in range(10_000)]
    low, high = np.quantile([counted(*draw) for draw in draws], (0.025, 0.975))
    assert found == pytest.approx((low, high), abs=0.04 * (high - low))
    # Against a policy without seeds it is the share of the differences.
    share, limits = crossed_improvement(one, other[0])
    assert share == pytest.approx(improvement((one - other[0]).ravel()))
    assert limits == pytest.approx(interval(improvement, one - other[0]), abs=0.02)


def test_a_ratio_is_of_pairs_and_its_interval_covers_the_truth() -> None:
    rng = np.random.default_rng(2)
    episodes = rng.exponential(size=60)
    assert ratio_interval(0.25 * episodes, episodes) == (0.25, 0.25)
    draws = [(rng.exponential(size=60), rng.exponential(2.0, size=60)) for _ in range(100)]
    limits = [ratio_interval(ours, theirs) for ours, theirs in draws]
    assert 88 <= sum(low <= 0.5 <= high for low, high in limits) <= 99


def test_the_interquartile_mean_is_that_of_the_middle_half() -> None:
    assert interquartile_mean([1e9, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, -1e9]) == 2.5
    assert interquartile_mean(np.arange(16.0).reshape(2, 8)).tolist() == [3.5, 11.5]


def test_ties_are_half_an_improvement() -> None:
    assert improvement([-1.0, -2.0, 0.0, 5.0]) == 0.625


def test_pairs_decide_where_the_spread_between_episodes_hides_it() -> None:
    rng = np.random.default_rng(2)
    first = rng.lognormal(sigma=1.0, size=50)
    second = first - 0.02 + 0.01 * rng.standard_normal(50)
    found = compare(first, second)
    assert found.decided
    assert found.difference == pytest.approx(second.mean() - first.mean())
    assert found.difference_ci95[0] < found.difference < found.difference_ci95[1] < 0
    assert found.improvement == np.mean(second < first)
    assert found.verdict("A", "B") == "the data decide: B is better than A"
    assert compare(second, first).verdict("B", "A") == "the data decide: B is better than A"
    # Not paired, the same numbers would decide nothing.
    alone = [interval(np.mean, values) for values in (first, second)]
    assert alone[0][0] < alone[1][1]


def test_equal_policies_are_rarely_told_apart() -> None:
    rng = np.random.default_rng(3)
    decided = [compare(*rng.exponential(size=(2, 50))).decided for _ in range(100)]
    assert sum(decided) <= 12
    assert "do not decide" in compare(np.arange(60.0), np.arange(60.0)).verdict("A", "B")


def test_no_conclusion_is_drawn_from_few_episodes() -> None:
    found = compare(np.ones(49), np.zeros(49))
    assert not found.decided
    assert "no conclusion: 49 episodes" in found.verdict("A", "B")
    assert compare(np.ones(50), np.zeros(50)).decided


def test_unequal_numbers_of_episodes_are_refused() -> None:
    with pytest.raises(ValueError, match="second"):
        compare(np.ones(3), np.ones(4))


def test_a_performance_profile_is_a_distribution_function() -> None:
    values = np.random.default_rng(4).lognormal(size=50)
    thresholds = np.sort(values)[[0, 24, 49]]
    shares, (low, high) = statistics.performance_profile(values, thresholds)
    assert shares == pytest.approx([0.02, 0.5, 1.0])
    assert (low <= shares).all()
    assert (shares <= high).all()
    assert 0.1 < low[1] < 0.45 < 0.55 < high[1] < 0.9


def test_a_profile_over_seeds_draws_seeds_and_episodes_each_for_themselves() -> None:
    table = np.random.default_rng(12).lognormal(size=(3, 1)) + np.arange(10.0) / 5
    thresholds = np.quantile(table, (0.3, 0.6))
    shares, limits = statistics.performance_profile(table, thresholds)
    for share, limit, threshold in zip(shares, limits.T, thresholds, strict=True):
        below = (table <= threshold).astype(float)
        assert share == pytest.approx(below.mean())
        assert limit == pytest.approx(interval(np.mean, below), abs=0.05)
