"""When a robot is lost, and what is reported of it then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import watchful

# Further from its reference than this in any axis a robot is lost, and counts at least this, m.
LOST_ERROR = 0.5


@watchful
def find_lost(error, attitude_error, limit, lost):
    """Find the robots that are lost: their error is too large, or their state no longer finite.

    Other kernels take all numbers to be finite, so this is the place to look.

    Args:
        error: True position errors, m, (size, axes).
        attitude_error: Attitude errors, rad, (size, angles).
        limit: Largest error in an axis of a robot that is not lost, m.
        lost: Where to write which robots are lost, (size,).

    Returns:
        Whether any is.
    """
    some = False
    for k in range(lost.size):
        lost[k] = False
        for axis in range(error.shape[1]):
            lost[k] |= not abs(error[k, axis]) <= limit
        for angle in range(attitude_error.shape[1]):
            lost[k] |= not np.isfinite(attitude_error[k, angle])
        some |= lost[k]
    return some


def make_finite(
    errors: NDArray[np.float64], lost: NDArray[np.bool_], largest: float = LOST_ERROR
) -> None:
    """Make what is reported of lost robots finite, in place.

    Args:
        errors: Errors of all robots, (size, numbers).
        lost: Which robots are lost, (size,).
        largest: What stands for infinity, and for what is not a number.
    """
    errors[lost] = np.nan_to_num(errors[lost], nan=largest, posinf=largest, neginf=-largest)
