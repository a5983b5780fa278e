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
from usm_baselines.laws.policy import ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_gym.simulation import Simulation, Snapshot
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal


class OracleGains(NamedTuple):
    """Gains of the oracle.

    Attributes:
        variation_weight: Error that is as bad as a change of the force by 1 N in a period, m/N.
        horizon: How far it looks ahead, s.
        heading_gain: k_psi, N m/rad.
    """

    variation_weight: float = 3e-6
    horizon: float = 0.2
    heading_gain: float = 100.0


class Oracle(ScriptedPolicy):
    """Predictive control that is given the true state: no competitor."""

    privileged = True
    positive = ("variation_weight", "horizon")

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Compute the gains; gains other than the defaults by name, see `OracleGains`."""
        super().__init__(nominal, OracleGains(**gains))
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

    def force(self, signals: Signals, law_state: Array) -> Array:
        """Run ahead with the commands held, and correct what comes of it."""
        copy: Any = self._copy
        held = (copy.read("command") / copy.limit[:, np.newaxis]).astype(np.float32)
        ahead = np.empty((self._periods, copy.size, 2, 1))
        for period in ahead:
            copy.step(held)
            period[:, :, 0] = copy.error
        force = np.empty_like(signals.y)
        receding(signals, self._model, self._inertia, self._gain, ahead, force)
        return force

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
