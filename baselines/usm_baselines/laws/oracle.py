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
from usm_baselines.planning import Foreseen, improve, problem_of
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

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Compute the gain of the regulator; gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        self._inertia, drag = kalman.straight_body(nominal.robot)
        h, lag = nominal.control_period, nominal.thruster_time_constant
        self._periods = max(1, round(self.gains.horizon / h))
        import os
        transition = np.stack([kalman.sampled(d, lag, h) for d in drag / self._inertia])
        weights = (self.gains.variation_weight, float(os.environ.get("AL", 1e-5)), float(os.environ.get("BE", 1e-6)))
        self._problem = problem_of(transition, self._inertia, weights)
        self.ROLL = int(os.environ.get("ROLL", 1))
        self._periods = max(1, round(float(os.environ.get("HOR", .5)) / h))
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

    ROLL, SWEEPS = 1, 2
    @property
    def law_shape(self):
        return (self._periods, self._model.thrusters)

    def _act(self, observation, state):
        copy: Any = self._copy
        size, periods, m = len(observation), self._periods, self._model.thrusters
        seen = observation
        started = state[:, 0] > 0
        plan = state[:, self._own:].reshape(size, periods, m).copy()
        plan[:, :-1] = plan[:, 1:]
        start = _SNAP = copy.snapshot() if self.ROLL > 1 else None
        for roll in range(self.ROLL):
            if roll: copy.restore(start)
            foreseen = Foreseen(np.empty((size, periods, 2)), np.empty((size, periods, 2)), np.empty((size, periods)), np.empty((size, periods, 3, m)))
            T = np.empty((size, 3, m))
            for i in range(periods):
                self._world.allocate(copy.observation, T)
                foreseen.allocation[:, i] = T
                foreseen.moment[:, i] = -self.gains.heading_gain * copy.attitude_error[:, 0]
                foreseen.thrust[:, i] = (T[:, :2] * copy.read("force")[:, None]).sum(axis=2)
                copy.step((plan[:, i] / copy.limit[:, None]).astype(np.float32))
                foreseen.error[:, i] = copy.error
            improve(plan, copy.limit, foreseen, self._problem)
        state[:, 0] = 1.0
        state[:, self._own:] = plan.reshape(size, -1)
        return (plan[:, 0] / copy.limit[:, None]).astype(np.float32)

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
