"""Policies that are given what no controller can know."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_baselines.policy import ScriptedPolicy
from usm_baselines.signals import Array
from usm_gym.simulation import Snapshot
from usm_gym.support.validation import require


class PrivilegedPolicy(ScriptedPolicy):
    """A law that is given the true state, and so is no competitor; subclasses give `take_in`."""

    privileged = True

    def take_in(self, snapshot: Snapshot) -> None:
        """Keep what the law uses of the true state of the simulation that is observed."""
        raise NotImplementedError

    def predict(
        self,
        observation: ArrayLike,
        state: Array | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
        *,
        correction: Array | None = None,
        snapshot: Snapshot | None = None,
    ) -> tuple[NDArray[np.float32], Array]:
        """Act as `ScriptedPolicy.predict`, knowing the true state.

        Args:
            observation: Observations, (batch, numbers).
            state: What the last call returned; None at the start.
            episode_start: Where an episode starts.
            deterministic: Without effect.
            correction: What to add to the law's estimates.
            snapshot: The true state of the simulation that is observed.

        Raises:
            ValueError: If there is no snapshot.
        """
        require(isinstance(snapshot, Snapshot), "snapshot", snapshot, "the true state")
        assert snapshot is not None
        self.take_in(snapshot)
        return super().predict(
            observation, state, episode_start, deterministic, correction=correction
        )
