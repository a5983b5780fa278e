"""What acts: the one thing that evaluation asks of a policy."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from usm_gym.support.validation import real_array, require


class Policy(Protocol):
    """Anything that acts: Stable-Baselines3's `predict`, for one observation or a batch.

    A policy may have `nominal`, the knowledge that it was made from; it is then refused where the
    control period is another one. With `privileged = True` it is given the true state, `snapshot=`,
    at each call.
    """

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action, and the state to pass to the next call."""
        ...


def as_action(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """What a policy returns as float32, as the plant takes it; NaN and infinity stay as they are.

    Raises:
        ValueError: If it is no array of real numbers of that shape.
    """
    array = real_array("action", action)
    require(array.shape == shape, "the action's shape", array.shape, f"{shape}")
    with np.errstate(over="ignore"):  # infinity saturates like any number beyond the limit
        return np.asarray(array, np.float32)
