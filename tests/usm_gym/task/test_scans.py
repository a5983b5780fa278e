"""Scans: many shifts from early on, the first of which do not count."""

import dataclasses

import numpy as np
import pytest
import usm_baselines

import usm_gym
from usm_gym import Conditions, Robot, Scenario
from usm_gym.task import metrics
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named, sample
from usm_gym.task.scenario import MODES, Mode

DRAWS = 500


def scans(
    conditions: Conditions, robot: Robot | str = "paper", count: int = DRAWS
) -> list[Scenario]:
    random = np.random.default_rng(0)
    return [sample("operation", conditions, random, robot) for _ in range(count)]


@pytest.mark.parametrize("preset", ["basin", "sea"])
def test_shifts_follow_each_other_from_four_seconds_on_to_the_end(preset: str) -> None:
    drawn = scans(PRESETS[preset])
    assert {(s.duration, s.settle_time, s.steps) for s in drawn} == {(60.0, 20.0, 3000)}
    gaps = np.concatenate([np.diff(s.shifts, prepend=0.0) for s in drawn])
    assert 4.0 <= gaps.min() < 4.05
    assert 5.95 < gaps.max() <= 6.0
    np.testing.assert_allclose(np.histogram(gaps, 4, (4.0, 6.0))[0] / gaps.size, 0.25, atol=0.03)
    last = np.array([s.shifts[-1] for s in drawn])
    assert last.max() <= 56.0  # it has the time of a gap to settle
    assert last.min() > 50.0  # else another one would have followed
    assert {len(s.shifts) for s in drawn} <= set(range(9, 15))


def test_every_shift_has_a_size_and_a_side_of_its_own() -> None:
    sizes = [np.array(s.inspection.deflections) for s in scans(PRESETS["basin"])]
    joined = np.concatenate(sizes)
    assert 0.7 <= np.abs(joined).min() < 0.71
    assert 1.74 < np.abs(joined).max() <= 1.75
    quarters = np.histogram(np.abs(joined), 4, (0.7, 1.75))[0] / joined.size
    np.testing.assert_allclose(quarters, 0.25, atol=0.03)
    assert (joined > 0).mean() == pytest.approx(0.5, abs=0.03)
    first, second = np.array([each[:2] for each in sizes]).T
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.15
    frequencies = [s.inspection.filter_frequency for s in scans(PRESETS["basin"])]
    assert 4.0 <= min(filter(None, frequencies)) <= max(filter(None, frequencies)) <= 8.0


@pytest.mark.parametrize("gaps", [(4.0, 4.0), (4.0, 30.0), (15.0, 20.0), (30.0, 30.0)])
def test_whatever_the_gaps_a_scan_has_shifts_to_its_end_and_a_score(
    gaps: tuple[float, float],
) -> None:
    conditions = dataclasses.replace(PRESETS["field"], shift_gap_range=gaps)
    for scenario in [named("nominal", "operation", conditions), *scans(conditions, count=50)]:
        shifts = np.array(scenario.shifts)
        assert shifts.size >= 1
        assert 60.0 - shifts[-1] <= gaps[0] + gaps[1] + 1e-9
        time = np.arange(1, 3001) * 0.02
        recovery = metrics.recovery_from(scenario.shifts)
        error = np.ones((time.size, 2))
        for shift in shifts:
            error[(time >= shift) & (time < shift + recovery)] = 9.0
        settled = metrics.settled_error(time, error, scenario.shifts, 20.0, recovery)
        assert settled.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("mode", MODES)
def test_nominal_scans_are_regular(mode: Mode) -> None:
    scenario = named("nominal", mode, PRESETS["sea"])
    assert (scenario.duration, scenario.settle_time) == (60.0, 20.0)
    if mode == "torpedo":
        assert scenario.shifts == ()
    else:
        assert scenario.shifts == tuple(np.arange(5.0, 56.0, 5.0))
        assert set(scenario.inspection.deflections) == {0.98, -0.98}
        assert scenario.inspection.bending_joints == 11


def test_a_torpedo_swims_as_long_and_keeps_straight() -> None:
    random = np.random.default_rng(0)
    for preset in ("basin", "sea"):
        scenario = sample("torpedo", PRESETS[preset], random)
        assert (scenario.duration, scenario.settle_time, scenario.shifts) == (60.0, 20.0, ())
        assert scenario.look_ahead == 2.24


def test_the_first_shifts_do_not_count_and_those_of_field_leave_seven_seconds_out() -> None:
    assert metrics.recovery_from(()) == metrics.recovery_from((10.0,)) == metrics.RECOVERY
    for scenario in usm_gym.suite("operation"):
        assert metrics.recovery_from(scenario.shifts) == metrics.RECOVERY
    for scenario in usm_gym.suite("operation-basin"):
        assert metrics.recovery_from(scenario.shifts) == metrics.SCAN_RECOVERY


def test_a_scan_has_a_score_under_any_conditions() -> None:
    # Its shifts come too fast for what is left out after those of other episodes.
    scan = usm_gym.suite("operation-basin")[0].under(PRESETS["ideal"])
    scores = usm_gym.evaluate(usm_baselines.make("lqg", scan.nominal), [scan]).per_episode
    assert 0.0 < scores["settled_error_x"][0] <= scores["max_error_x"][0] < 0.01
