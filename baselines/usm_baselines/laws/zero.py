"""The policy that does nothing: what the water and the joints do to a robot left alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of


class Zero:
    """No thrust at all."""

    privileged = False

    def __init__(self, nominal: Nominal) -> None:
        """Take the number of thrusters."""
        self._thrusters = world_of(nominal.robot).actions

    def predict(
        self,
        observation: ArrayLike,
        state: Any = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Any]:
        """Return zeros, (thrusters,) or (batch, thrusters), and the state as it was."""
        batch = np.shape(observation)[:-1]
        return np.zeros((*batch, self._thrusters), np.float32), state
