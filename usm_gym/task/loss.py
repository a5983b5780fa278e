"""When a robot is lost, and what is reported of it then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Further from its reference than this in any axis a robot is lost, and counts at least this, m.
LOST_ERROR = 0.5


def is_lost(error: NDArray[np.float64], attitude_error: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which robots are lost: their error is too large, or their state no longer finite.

    Compiled code takes all numbers to be finite, so that this is the place to look.

    Args:
        error: True position errors, m, (size, axes).
        attitude_error: Attitude errors, rad, (size, angles).
    """
    distance = np.abs(error[:, 0])
    for axis in range(1, error.shape[1]):
        np.maximum(distance, np.abs(error[:, axis]), out=distance)
    for angle in range(attitude_error.shape[1]):
        distance += 0.0 * attitude_error[:, angle]
    return np.asarray(~(distance <= LOST_ERROR))


def make_finite(errors: NDArray[np.float64], lost: NDArray[np.bool_]) -> None:
    """Make what is reported of lost robots finite, in place; errors: (size, numbers)."""
    errors[lost] = np.nan_to_num(
        errors[lost], nan=LOST_ERROR, posinf=LOST_ERROR, neginf=-LOST_ERROR
    )
