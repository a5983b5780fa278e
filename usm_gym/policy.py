"""What acts, and what evaluation asks of it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from usm_gym.support.validation import real_array, require
from usm_gym.task.nominal import Nominal


class Policy(Protocol):
    """Anything that acts: Stable-Baselines3's `predict`, for one observation or a batch."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action, and the state to pass to the next call."""
        ...


class KnowingPolicy(Policy, Protocol):
    """A policy that also says what it knows.

    Attributes:
        nominal: The nominal knowledge that it was made from; it is refused where the control period
            is another one.
        privileged: Whether `predict` is also given `snapshot=`, the true state. Such a policy is no
            competitor.
    """

    nominal: Nominal
    privileged: bool


def nominal_of(policy: Any) -> Nominal | None:
    """What a policy was made from; None if it does not say."""
    nominal: Nominal | None = getattr(policy, "nominal", None)
    return nominal


def is_privileged(policy: Any) -> bool:
    """Whether a policy has to be given the true state."""
    return bool(getattr(policy, "privileged", False))


def as_action(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """What a policy returns as float32, as the plant takes it; NaN and infinity stay as they are.

    Raises:
        ValueError: If it is no array of real numbers of that shape.
    """
    array = real_array("action", action)
    require(array.shape == shape, "the action's shape", array.shape, f"{shape}")
    if array.dtype == np.float32:
        return array
    with np.errstate(over="ignore"):  # infinity saturates like any number beyond the limit
        return np.asarray(array, np.float32)
