"""The reward, the same in both modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import compiled

# At this error an axis costs half of what it can cost at all, m, and an angle, rad. While both are
# small, a degree costs what 0.05 mm in one axis cost, as in `metrics.objective`.
HALF_COST_ERROR = 0.02
HALF_COST_ANGLE = 20.0 * np.pi / 180.0
ERROR_COST = 10.0
ANGLE_COST = 0.25
EFFORT_COST = 0.1


def reward(
    error: NDArray[np.float64],
    attitude_error: NDArray[np.float64],
    effort: NDArray[np.float64],
    limit: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Reward of a step.

    It is -10 mean over axes of |e| / (|e| + 0.02 m) - 0.25 sum over angles of |a| / (|a| + 20 deg)
    - 0.1 effort / limit: nearly linear where good controllers live (-0.25 for 1 mm in one of two
    axes), and saturated where a robot is all but lost, so that such episodes do not drown the
    others.

    Args:
        error: True position errors, m, (size, axes).
        attitude_error: Attitude errors as known on board, rad, (size, angles).
        effort: Mean absolute thruster commands after saturation, N, (size,).
        limit: Thruster limits, N, (size,).

    Returns:
        Rewards, (size,), between `worst_reward` and 0.
    """
    rewards = np.empty(len(error))
    _reward(error, attitude_error, effort, limit, rewards)
    return rewards


def worst_reward(angles: int) -> float:
    """What no reward of a step falls below, given the number of angles."""
    return -(ERROR_COST + ANGLE_COST * angles + EFFORT_COST)


def reward_of_loss(remaining: NDArray[np.int64], angles: int) -> NDArray[np.float64]:
    """Reward of the step that loses the robot: the worst for it and for all remaining steps."""
    return np.asarray(worst_reward(angles) * (1.0 + np.maximum(remaining, 0)), np.float64)


@compiled
def _reward(error, attitude_error, effort, limit, rewards):
    share = 1.0 / error.shape[1]
    for k in range(rewards.size):
        cost, turned = 0.0, 0.0
        for axis in range(error.shape[1]):
            distance = abs(error[k, axis])
            cost += share * (distance / (distance + HALF_COST_ERROR))
        for angle in range(attitude_error.shape[1]):
            size = abs(attitude_error[k, angle])
            turned += size / (size + HALF_COST_ANGLE)
        rewards[k] = -ERROR_COST * cost - ANGLE_COST * turned - EFFORT_COST * (effort[k] / limit[k])
