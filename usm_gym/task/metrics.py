"""The score of an episode: Table 1 of the paper and what is shown beside it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.kernels.compile import piece
from usm_gym.support.validation import real_array, require

# Controllers are given this long after a change of the joint references, s, and where one follows
# another within `SCAN_GAP`, as in a scan.
RECOVERY, SCAN_RECOVERY, SCAN_GAP = 7.0, 3.0, 6.0
TIME_TOLERANCE = 1e-9
# Begins the names of the metric of Table 1, one per axis, and ends those of attitude errors.
MAX_ERROR, ANGLE_ERROR = "max_error_", "_error"
# What thrust variation costs in the objective, mm per N/s, and an error of the attitude, mm per
# degree: ten degrees are as bad as half a millimetre.
VARIATION_WEIGHT, ATTITUDE_WEIGHT = 0.002, 0.05


def max_error(time: ArrayLike, error: ArrayLike, settle_time: float = 5.0) -> NDArray[np.float64]:
    """Largest absolute position error after settling, per axis: Table 1 of the paper.

    Args:
        time: Times, s, shape (samples,).
        error: True position errors, m, shape (samples, axes).
        settle_time: From when on errors count, s.

    Returns:
        Largest |error| by axis over time >= settle_time, m, shape (axes,).

    Raises:
        ValueError: If shapes do not match, a value is not finite or no sample is late enough.
    """
    _, errors, late = _checked(time, error, settle_time)
    return np.asarray(np.abs(errors[late]).max(axis=0))


def settled_error(
    time: ArrayLike,
    error: ArrayLike,
    shifts: Sequence[float],
    settle_time: float = 5.0,
    recovery: float = RECOVERY,
) -> NDArray[np.float64]:
    """The same maximum, leaving out a while after every change of the joint references.

    Args:
        time: Times, s, shape (samples,).
        error: True position errors, m, shape (samples, axes).
        shifts: When the joint references change, s.
        settle_time: From when on errors count, s.
        recovery: How long is left out, s.

    Returns:
        Largest |error| by axis, m, shape (axes,).
    """
    times, errors, late = _checked(time, error, settle_time)
    for shift in shifts:
        late &= (times < shift) | (times >= shift + recovery)
    require(late.any(), "shifts", shifts, f"some of the time up to {times[-1]} s left")
    return np.asarray(np.abs(errors[late]).max(axis=0))


def recovery_from(shifts: Sequence[float]) -> float:
    """How long after each change of the joint references a settled error does not count, s."""
    scan = bool(np.any(np.diff(shifts) < SCAN_GAP))
    return SCAN_RECOVERY if scan else RECOVERY


def shift_errors(time: ArrayLike, error: ArrayLike, shifts: Sequence[float]) -> NDArray[np.float64]:
    """Largest absolute error from every change of the joint references to the next.

    Args:
        time: Times, s, shape (samples,).
        error: True position errors, m, shape (samples, axes).
        shifts: When the joint references change, s, rising.

    Returns:
        Largest |error| by shift and axis, m, shape (shifts, axes).

    Raises:
        ValueError: If shapes do not match, a value is not finite or no sample follows a shift.
    """
    times, errors, _ = _checked(time, error, 0.0)
    first = np.searchsorted(times, np.asarray(shifts) - TIME_TOLERANCE)
    require((first < times.size).all(), "shifts", shifts, f"times up to {times[-1]} s")
    return np.maximum.reduceat(np.abs(errors), first) if first.size else errors[:0]


def rms_error(time: ArrayLike, error: ArrayLike, settle_time: float = 5.0) -> NDArray[np.float64]:
    """Root mean square of the position error after settling, per axis, m, shape (axes,)."""
    _, errors, late = _checked(time, error, settle_time)
    return np.asarray(np.sqrt(np.mean(errors[late] ** 2, axis=0)))


def thrust_effort(command: ArrayLike) -> float:
    """Mean absolute thruster command over thrusters and time, N; command: (samples, thrusters)."""
    return float(np.mean(np.abs(command)))


def thrust_variation(command: ArrayLike, control_period: float) -> float:
    """How much the commands chatter: sum of |change| per second, mean over the thrusters, N/s.

    Args:
        command: Thruster commands after saturation, N, shape (samples, thrusters).
        control_period: Time between samples, s.
    """
    commands = np.asarray(command, np.float64)
    duration = len(commands) * control_period
    return float(np.abs(np.diff(commands, axis=0)).sum(axis=0).mean() / duration)


def saturation_share(command: ArrayLike, limit: float) -> float:
    """Share of commands that are at the thruster limit; command: N, (samples, thrusters)."""
    return float(np.mean(np.abs(command) >= limit))


def axes_of(names: Iterable[str]) -> tuple[str, ...]:
    """The axes of scores, from the names of their columns `max_error_AXIS`, in order."""
    return tuple(name.removeprefix(MAX_ERROR) for name in names if name.startswith(MAX_ERROR))


def attitude_of(names: Iterable[str]) -> tuple[str, ...]:
    """The angles of scores, from the names of their columns `ANGLE_error`, in order."""
    return tuple(name.removesuffix(ANGLE_ERROR) for name in names if name.endswith(ANGLE_ERROR))


def objective(scores: Mapping[str, Any], variation_weight: float = VARIATION_WEIGHT) -> Any:
    """What gains and agents are chosen by and tables are ordered by, mm; less is better.

    It is the largest errors of all axes, added up, plus what the largest errors of the attitude
    and thrust variation cost.

    Args:
        scores: Numbers or arrays by the names of metrics: `max_error_AXIS`, m, `ANGLE_error`, rad,
            and `thrust_variation`, N/s.
        variation_weight: Cost of thrust variation, mm per N/s.
    """
    error = sum(scores[MAX_ERROR + axis] for axis in axes_of(scores))
    attitude = sum(np.degrees(scores[angle + ANGLE_ERROR]) for angle in attitude_of(scores))
    variation = scores["thrust_variation"]
    return 1e3 * error + ATTITUDE_WEIGHT * attitude + variation_weight * variation


@piece
def note_largest(fleet, robot):
    """Note the largest errors of a robot since settling, if they count by now."""
    if fleet.instant[robot] >= fleet.settled[robot]:
        for axis in range(fleet.error.shape[1]):
            size_now = abs(fleet.error[robot, axis])
            if size_now > fleet.max_error[robot, axis]:
                fleet.max_error[robot, axis] = size_now


def _checked(
    time: ArrayLike, error: ArrayLike, settle_time: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    times = real_array("time", time).astype(np.float64)
    errors = real_array("error", error).astype(np.float64)
    settled = real_array("settle_time", settle_time)
    require(settled.ndim == 0, "settle_time", settle_time, "a number, s")
    require(times.ndim == 1, "time", times.shape, "one dimension")
    fitting = errors.ndim == 2 and len(errors) == times.size and errors.shape[1] > 0
    require(fitting, "error", errors.shape, f"shape ({times.size}, axes)")
    require(np.isfinite(times).all(), "time", "not finite", "finite numbers")
    require(np.isfinite(errors).all(), "error", "not finite", "finite numbers")
    # Sample times are multiples of a period and may fall short of a decimal by rounding.
    late = times >= settle_time - TIME_TOLERANCE
    require(late.any(), "settle_time", settle_time, "a time before the last sample")
    return times, errors, late
