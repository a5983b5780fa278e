"""The reward, the same in both modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import compiled

# At this error an axis costs half of what it can cost at all, m.
HALF_COST_ERROR = 0.02
ERROR_COST = 10.0
EFFORT_COST = 0.1
WORST = -(ERROR_COST + EFFORT_COST)


def reward(
    error: NDArray[np.float64], effort: NDArray[np.float64], limit: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Reward of a step: -10 mean over axes of |e| / (|e| + 0.02 m) - 0.1 effort / limit.

    It is nearly linear where good controllers live (-0.24 for 1 mm in one axis) and saturates where
    a robot is all but lost, so that such episodes do not drown the others.

    Args:
        error: True position errors, m, (size, axes).
        effort: Mean absolute thruster commands after saturation, N, (size,).
        limit: Thruster limits, N, (size,).

    Returns:
        Rewards, (size,), between `WORST` and 0.
    """
    rewards = np.empty(len(error))
    _reward(error, effort, limit, rewards)
    return rewards


def reward_of_loss(remaining: NDArray[np.int64]) -> NDArray[np.float64]:
    """Reward of the step that loses the robot: the worst for it and for all remaining steps."""
    return np.asarray(WORST * (1.0 + np.maximum(remaining, 0)), np.float64)


@compiled
def _reward(error, effort, limit, rewards):
    share = 1.0 / error.shape[1]
    for k in range(rewards.size):
        cost = 0.0
        for axis in range(error.shape[1]):
            distance = abs(error[k, axis])
            cost += share * (distance / (distance + HALF_COST_ERROR))
        rewards[k] = -ERROR_COST * cost - EFFORT_COST * (effort[k] / limit[k])
