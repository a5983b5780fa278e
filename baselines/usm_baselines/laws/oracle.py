"""The limit: predictive control with the true state, the exact plant and the future.

As `mpc`, but the free response is run on a copy of the simulation itself: true coefficients and
water, true position and velocity, all changes of the joint references that are to come. No
controller can know this; what it leaves is what thrusters and control period allow.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_baselines.estimation import kalman
from usm_baselines.laws.mpc import receding, receding_gain
from usm_baselines.policy import ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.simulation import Simulation, Snapshot
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal


class OracleGains(NamedTuple):
    """Gains of the oracle."""

    variation_weight: float = Gain(
        3e-6,
        "m/N",
        "error that is as bad as a change of the force by 1 N in a period",
        positive=True,
    )
    horizon: float = Gain(0.2, "s", "how far it looks ahead", positive=True)
    heading_gain: float = Gain(100.0, "N m/rad", "heading gain k_psi")


class Oracle(ScriptedPolicy):
    """Predictive control that is given the true state: no competitor."""

    Gains = OracleGains
    privileged = True
    planar = True

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Compute the gain of the regulator; gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        self._inertia, drag = kalman.straight_body(nominal.robot)
        h, lag = nominal.control_period, nominal.thruster_time_constant
        self._periods = max(1, round(self.gains.horizon / h))
        self._gain = np.stack(
            [
                receding_gain(
                    kalman.sampled(damping, lag, h), self._periods, self.gains.variation_weight * m
                )
                for m, damping in zip(self._inertia, drag / self._inertia, strict=True)
            ]
        )
        self._copy: Simulation | None = None

    def predict(
        self,
        observation: ArrayLike,
        state: Array | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
        *,
        snapshot: Snapshot | None = None,
    ) -> tuple[NDArray[np.float32], Array]:
        """Act as `ScriptedPolicy.predict`, knowing the true state.

        Args:
            observation: Observations, (batch, numbers).
            state: What the last call returned; None at the start.
            episode_start: Where an episode starts.
            deterministic: Without effect.
            snapshot: The true state of the simulation that is observed.

        Raises:
            ValueError: If there is no snapshot.
        """
        require(isinstance(snapshot, Snapshot), "snapshot", snapshot, "the true state")
        self._copy = self._copy_of(snapshot)
        return super().predict(observation, state, episode_start, deterministic)

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Run ahead with the commands held, and correct what comes of it."""
        copy: Any = self._copy
        held = (copy.read("command") / copy.limit[:, np.newaxis]).astype(np.float32)
        ahead = np.empty((self._periods, *force.shape, 1))
        for period in ahead:
            copy.step(held)
            period[:, :, 0] = copy.error
        receding(signals, self._model, self._inertia, self._gain, ahead, force)

    def _copy_of(self, snapshot: Any) -> Simulation:
        copy, scenarios = self._copy, snapshot.scenarios
        timing = scenarios[0].conditions.timing
        if (
            copy is None
            or copy.size != len(scenarios)
            or copy.scenarios[0].conditions.timing != timing
        ):
            copy = Simulation(scenarios)
        copy.restore(snapshot)
        return copy
