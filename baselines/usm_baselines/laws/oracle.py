"""The limit: predictive control with the true state, the exact plant and the future.

It keeps a plan of thruster commands. Every control period it carries the plan out on a copy of the
simulation itself: true coefficients and water, true position and velocity, all changes of the joint
references that are to come. Then it corrects the plan, within the limits of the thrusters
(`planning`), and applies the first command. No controller can know this; what it leaves is what
thrusters and control period allow.

The position comes first. The moment that turns the heading error back gives way to it where
thrusters are at their limits.

Source: M. Diehl, H. G. Bock, J. P. Schloeder, A real-time iteration scheme for nonlinear
optimization in optimal feedback control, SIAM Journal on Control and Optimization 43, 2005 (one
correction in a period, begun from the last plan).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation import kalman
from usm_baselines.planning import Foreseen, improve, problem_of
from usm_baselines.policy import HEADING_GAIN, Percept
from usm_baselines.privileged import PrivilegedPolicy
from usm_baselines.signals import ATTITUDE_LEAD, ROLL_DAMPING, ROLL_LIMIT, Array, rows_of
from usm_baselines.space import Gain
from usm_gym.simulation import Simulation, Snapshot
from usm_gym.task.nominal import Nominal

# Errors of the position, m, that are as bad as a moment that is wrong by 1 N m, and as 1 N of a
# thruster. They share the force out among the thrusters and cost no position: without limits,
# these can make any force and moment.
MOMENT_WEIGHT, EFFORT_WEIGHT = 1e-5, 1e-6


class OracleGains(NamedTuple):
    """Gains of the oracle."""

    variation_weight: float = Gain(
        3e-6,
        "m/N",
        "error that is as bad as a force that is 1 N from what the thrusters make",
        positive=True,
    )
    horizon: float = Gain(0.3, "s", "how far it plans", positive=True)
    heading_gain: float = HEADING_GAIN
    heading_lead: float = Gain(0.0, "s", "how far ahead the heading error is taken, in the plane")


class Oracle(PrivilegedPolicy):
    """Predictive control that is given the true state: no competitor.

    Its state has the plan, N. Its actions are within the limits.
    """

    Gains = OracleGains
    knows_lag = True

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Set up the problem; gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        inertia, drag = self._world.straight_body
        h, lag = nominal.control_period, nominal.thruster_time_constant
        self._periods = max(1, round(self.gains.horizon / h))
        self._problem = problem_of(
            np.stack([kalman.sampled(damping, lag, h) for damping in drag / inertia]),
            inertia,
            self.gains.variation_weight,
            MOMENT_WEIGHT,
            EFFORT_WEIGHT,
        )
        self._copy: Simulation | None = None

    @cached_property
    def law_shape(self) -> tuple[int, ...]:
        """The plan: commands of the thrusters in each period."""
        return self._periods, self._model.thrusters

    def take_in(self, snapshot: Snapshot) -> None:
        """Run ahead from the true state."""
        self._copy = self._copy_of(snapshot)

    def decide(
        self, known: Percept, correction: Array | None = None
    ) -> tuple[NDArray[np.float32], Array]:
        """Carry the plan on by a period, see what comes of it, correct it."""
        copy: Any = self._copy
        state = known.state.copy()
        own = state[:, self._own :]
        plan = own.reshape(len(own), *self.law_shape)
        plan = np.concatenate([plan[:, 1:], plan[:, -1:]], axis=1)
        foreseen = self._foresee(copy, plan)
        improve(plan, copy.limit, foreseen, self._problem)
        own[:] = plan.reshape(own.shape)
        return _action(plan[:, 0], copy.limit), state

    def _foresee(self, copy: Simulation, plan: Array) -> Foreseen:
        """Run ahead with a plan, (batch, periods, thrusters)."""
        size, periods, thrusters = plan.shape
        error, thrust = np.empty((2, size, periods, self._model.axes))
        allocation = np.empty((size, periods, rows_of(self._model), thrusters))
        body = len(self._world.attitude) + len(self._world.watched)
        angles = np.empty((size, periods + 1, body))
        # Joints that a policy moves go on as they were last commanded.
        steered = copy.world.actions > thrusters
        rates = copy.read("joint_commands") if steered else np.empty((size, 0))
        rates = (rates / copy.shared.joint_rate_limit).astype(np.float32)
        for i in range(periods):
            self._world.allocate(copy.observation, allocation[:, i])
            angles[:, i] = copy.attitude_error[:, -body:]
            forces = allocation[:, i, : self._model.axes] * copy.read("force")[:, np.newaxis]
            thrust[:, i] = forces.sum(axis=2)
            copy.step(np.hstack([_action(plan[:, i], copy.limit), rates]))
            error[:, i] = copy.mass_error
        angles[:, periods] = copy.attitude_error[:, -body:]
        return Foreseen(error, thrust, self._wanted(angles), allocation)

    def _wanted(self, angles: Array) -> Array:
        """Wanted moments from the attitude errors, (batch, periods + 1, angles); see `signals`."""
        model, now = self._model, angles[:, :-1].copy()
        rate = np.diff(angles, axis=1) / model.h
        now += (ATTITUDE_LEAD if model.attitude_rate >= 0 else self.gains.heading_lead) * rate
        wanted = -self.gains.heading_gain * now
        if model.watched:
            damping = -ROLL_DAMPING * rate[:, :, model.angles]
            wanted[:, :, model.angles] = np.clip(damping, -ROLL_LIMIT, ROLL_LIMIT)
        return np.asarray(wanted)

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


def _action(command: Array, limit: Array) -> NDArray[np.float32]:
    """Commands over the limits, within them."""
    share = command / limit[:, np.newaxis]
    return np.clip(share, -1.0, 1.0).astype(np.float32)
