"""The scores are what they are called, on signals whose scores are known."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

import usm_gym
from usm_gym.task import metrics

Array = NDArray[np.float64]

PERIOD = 0.02
TIME = np.arange(1, 2001) * PERIOD  # the control instants of 40 s, after each step


def errors(x: float = 0.0, y: float = 0.0) -> Array:
    """Return constant errors."""
    return np.full((TIME.size, 2), (x, y))


def at(time: float) -> int:
    """Return the index of a sample."""
    return round(time / PERIOD) - 1


def test_max_error_is_the_largest_absolute_error_of_each_axis() -> None:
    error = errors(1e-3, -2e-3)
    error[at(12.0), 0] = -0.05
    error[at(33.0), 1] = 0.07
    assert metrics.max_error(TIME, error).tolist() == [0.05, 0.07]
    assert metrics.max_error(TIME, -error).tolist() == [0.05, 0.07]
    assert metrics.max_error(TIME, errors(-1.0, 2.0)).tolist() == [1.0, 2.0]
    assert usm_gym.max_error is metrics.max_error


def test_max_error_of_a_sine_is_its_amplitude() -> None:
    phase = 2.0 * np.pi * TIME / 4.0  # a quarter period is a whole number of samples
    error = np.stack([0.03 * np.sin(phase), 0.01 * np.cos(phase)], axis=1)
    np.testing.assert_allclose(metrics.max_error(TIME, error), [0.03, 0.01], rtol=1e-12)
    np.testing.assert_allclose(
        metrics.rms_error(TIME, error), np.array([0.03, 0.01]) / math.sqrt(2.0), rtol=2e-3
    )


def test_errors_count_from_the_settle_time_on_and_not_before() -> None:
    error = errors()
    error[at(5.0) - 1] = (9.0, 9.0)
    error[at(5.0)] = (0.1, 0.2)
    assert TIME[at(5.0)] == 5.0
    assert metrics.max_error(TIME, error).tolist() == [0.1, 0.2]
    assert metrics.max_error(TIME, error, settle_time=5.0 - PERIOD).tolist() == [9.0, 9.0]
    assert metrics.max_error(TIME, error, settle_time=5.0 + PERIOD).tolist() == [0.0, 0.0]
    assert metrics.rms_error(TIME, error, settle_time=5.0).max() < 0.1


def test_max_error_takes_lists_and_a_single_sample() -> None:
    assert metrics.max_error([6.0], [[-0.3, 0.1]]).tolist() == [0.3, 0.1]
    assert metrics.max_error([5.0], [[-0.3, 0.1]]).tolist() == [0.3, 0.1]


def test_rms_error_of_a_constant_is_the_constant() -> None:
    np.testing.assert_allclose(metrics.rms_error(TIME, errors(0.3, -0.4)), [0.3, 0.4], rtol=1e-12)


def test_settled_error_leaves_out_seven_seconds_after_each_shift() -> None:
    shifts = (10.0, 20.0, 30.5)
    error = errors(1e-3, 2e-3)
    for shift in shifts:
        error[at(shift) : at(shift + 7.0)] = (0.5, 0.6)
    assert metrics.settled_error(TIME, error, shifts).tolist() == [1e-3, 2e-3]
    assert metrics.max_error(TIME, error).tolist() == [0.5, 0.6]
    for edge in (at(10.0) - 1, at(17.0), at(30.5) - 1, at(37.5), at(5.0)):
        seen = error.copy()
        seen[edge] = (-0.7, 0.8)
        assert metrics.settled_error(TIME, seen, shifts).tolist() == [0.7, 0.8]


def test_settled_error_without_shifts_is_the_maximum() -> None:
    error = np.random.default_rng(0).normal(size=(TIME.size, 2))
    expected = metrics.max_error(TIME, error)
    np.testing.assert_array_equal(metrics.settled_error(TIME, error, ()), expected)
    later = metrics.max_error(TIME, error, 11.0)
    np.testing.assert_array_equal(metrics.settled_error(TIME, error, (), 11.0), later)


def test_thrust_effort_is_the_mean_size_of_a_command() -> None:
    command = np.zeros((100, 5))
    command[:, 1] = -10.0
    command[:50, 3] = 5.0
    assert metrics.thrust_effort(command) == pytest.approx(2.0 + 0.5)


def test_thrust_variation_is_the_change_per_second_of_a_thruster() -> None:
    # One thruster of two switches between -1 and 1 N at every instant of 10 s: 2 N in 0.02 s.
    command = np.zeros((500, 2))
    command[:, 1] = np.resize([1.0, -1.0], 500)
    assert metrics.thrust_variation(command, PERIOD) == pytest.approx(0.5 * 2.0 / PERIOD, rel=0.01)
    assert metrics.thrust_variation(command, 2 * PERIOD) == pytest.approx(25.0, rel=0.01)
    assert metrics.thrust_variation(np.full((500, 2), 7.0), PERIOD) == 0.0
    # A slow swing by 3 N and back counts twice, however many samples it takes.
    swing = 3.0 * np.sin(np.linspace(0.0, np.pi, 501))[:, None]
    assert metrics.thrust_variation(swing, PERIOD) == pytest.approx(6.0 / 10.0, rel=0.01)


def test_saturation_share_counts_commands_at_the_limit_of_either_sign() -> None:
    command = np.array([[20.0, -20.0, 19.999, 0.0], [-20.0, 1.0, 2.0, 3.0]])
    assert metrics.saturation_share(command, 20.0) == 3 / 8


@pytest.mark.parametrize(
    ("time", "error", "settle_time", "named"),
    [
        (TIME, errors()[:-1], 5.0, "error"),
        (TIME, errors().T, 5.0, "error"),
        (TIME, errors()[:, :0], 5.0, "error"),
        (TIME[:, None], errors(), 5.0, "time"),
        (TIME, errors(np.nan), 5.0, "error"),
        (TIME, errors(0.0, np.inf), 5.0, "error"),
        (TIME, errors(), 40.5, "settle_time"),
        ([], np.empty((0, 2)), 0.0, "settle_time"),
        (np.full(TIME.size, np.nan), errors(), 5.0, "time"),
    ],
)
def test_bad_input_is_named(time: Array, error: Array, settle_time: float, named: str) -> None:
    for metric in (metrics.max_error, metrics.rms_error):
        with pytest.raises(ValueError, match=named):
            metric(time, error, settle_time)
    with pytest.raises(ValueError, match=named):
        metrics.settled_error(time, error, (), settle_time)


def test_a_nan_before_settling_is_refused_all_the_same() -> None:
    error = errors()
    error[0, 0] = np.nan
    with pytest.raises(ValueError, match="error"):
        metrics.max_error(TIME, error)


def test_no_settled_time_at_all_is_refused() -> None:
    with pytest.raises(ValueError, match="shifts"):
        metrics.settled_error(TIME, errors(), (5.0, 12.0, 19.0, 26.0, 33.0, 34.0))


def test_what_is_left_out_after_shifts_is_shorter_where_they_come_thick() -> None:
    assert metrics.recovery_from((10.0, 16.0, 30.0)) == 7.0
    assert metrics.recovery_from((10.0, 15.9, 30.0)) == 3.0
    shifts = tuple(np.arange(5.0, 38.0, 4.0).tolist())
    error = errors(1e-3, 2e-3)
    for shift in shifts:
        error[at(shift) : at(shift + 3.0)] = (0.5, 0.6)
    assert metrics.settled_error(TIME, error, shifts, 5.0, 3.0).tolist() == [1e-3, 2e-3]
    assert metrics.settled_error(TIME, error, shifts, 5.0, 2.9).tolist() == [0.5, 0.6]


def test_each_shift_has_the_largest_error_up_to_the_next_one() -> None:
    shifts = (4.5, 9.28, 20.0, 39.98)
    error, expected = errors(1e-4, -1e-4), []
    error[: at(4.5)] = 9.0  # before the first one
    for k, (first, last) in enumerate(zip(shifts, (*shifts[1:], 40.02), strict=True)):
        size = 0.1 * (k + 1)
        # At its first and its last instant, of either sign.
        error[at(first), 0], error[at(last) - 1, 1] = -size, 2 * size
        expected.append([size, 2 * size])
    np.testing.assert_array_equal(metrics.shift_errors(TIME, error, shifts), expected)
    assert metrics.shift_errors(TIME, error, ()).shape == (0, 2)
    # A shift between two instants is felt at the next one.
    between = metrics.shift_errors(TIME, error, (4.49, 9.27, 19.99, 39.97))
    np.testing.assert_array_equal(between, expected)


def test_the_largest_error_of_all_shifts_is_the_maximum_after_the_first() -> None:
    error = np.random.default_rng(0).normal(size=(TIME.size, 3))
    by_shift = metrics.shift_errors(TIME, error, (7.0, 12.0, 12.5, 33.3))
    assert by_shift.shape == (4, 3)
    np.testing.assert_array_equal(by_shift.max(axis=0), metrics.max_error(TIME, error, 7.0))


def test_a_shift_after_the_end_has_no_error() -> None:
    for shifts in ((40.5,), (10.0, 41.0)):
        with pytest.raises(ValueError, match=r"shifts is .*; allowed: times up to 40.0 s"):
            metrics.shift_errors(TIME, errors(), shifts)
    with pytest.raises(ValueError, match="error"):
        metrics.shift_errors(TIME, errors(np.nan), (10.0,))
