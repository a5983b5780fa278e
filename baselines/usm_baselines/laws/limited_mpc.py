"""Predictive control with the thrusters' limits inside the problem.

It foresees what `mpc` does, and has the same objective: the sum of e^2 + weight^2 (change of the
force)^2 over the horizon. But what it plans are the commands of the thrusters, each within its
limits (`planning`), the links staying as they are. The force of the first commands is applied, by
the allocation that stays within the limits as well. The position comes first: where thrusters are
at their limits, the moment against the heading error gives way.

The dead-band would make the problem one of whole numbers. It is left to the allocation, and the
next period starts from the force that the commands make behind it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from usm_baselines.allocation import QUADRATIC_PROGRAM
from usm_baselines.estimation import kalman
from usm_baselines.estimation.prediction import believed
from usm_baselines.laws.mpc import MPC
from usm_baselines.planning import Foreseen, improve, problem_of
from usm_baselines.signals import Array, Signals, commanded, physical, wanted_moments
from usm_gym.kernels.compile import compiled
from usm_gym.task.nominal import Nominal

# Changes of the force, N, that are as bad as a moment that is wrong by 1 N m, and as 1 N of a
# thruster. They share the force out among the thrusters and cost no position within the limits.
MOMENT_WEIGHT, EFFORT_WEIGHT = 0.05, 1e-3


@compiled
def hold(signals, model, heading_gain, ahead, plan, foreseen, limit):
    """Fill in plans that hold the last commands, what comes of them, and the limits.

    Args:
        signals: What the law works with.
        model: Nominal knowledge for reading observations.
        heading_gain: Moment over heading error, N m/rad.
        ahead: (error, rate) after each period if they are held, (periods, batch, axes, 2).
        plan: Where to write the commands, N, (batch, periods, thrusters).
        foreseen: Where to write what comes of them.
        limit: Where to write the limits of the thrusters, N, (batch,).
    """
    moments = np.empty(foreseen.wanted.shape[2])
    for b in range(plan.shape[0]):
        seen, T = signals.observation[b], signals.allocation[b]
        limit[b] = physical(seen, model, model.thruster_limit)
        wanted_moments(seen, model, heading_gain, moments)
        for i in range(plan.shape[1]):
            foreseen.wanted[b, i] = moments
            foreseen.allocation[b, i] = T
            for j in range(model.thrusters):
                plan[b, i, j] = commanded(seen, model, j)
            for axis in range(model.axes):
                foreseen.error[b, i, axis] = ahead[i, b, axis, 0]
                force = 0.0
                for j in range(model.thrusters):
                    force += T[axis, j] * plan[b, i, j]
                foreseen.held[b, i, axis] = force


@compiled
def first_force(allocation, plan, force):
    """Fill in the force that the first commands of the plans make, N, (batch, axes)."""
    for b, axis in np.ndindex(force.shape):
        force[b, axis] = 0.0
        for j in range(plan.shape[2]):
            force[b, axis] += allocation[b, axis, j] * plan[b, 0, j]


class LimitedMPC(MPC):
    """Predictive control within the limits of the thrusters; gains and state are those of `mpc`."""

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Set up the problem; gains other than the defaults by name."""
        super().__init__(nominal, allocation=QUADRATIC_PROGRAM, **gains)
        inertia, drag = self._world.straight_body
        lag, weight = nominal.thruster_time_constant, self.gains.variation_weight
        self._problem = problem_of(
            np.stack([kalman.sampled(each, lag, self._model.h) for each in drag / inertia]),
            inertia,
            weight,
            MOMENT_WEIGHT * weight,
            EFFORT_WEIGHT * weight,
            changes=True,
        )

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Foresee, plan within the limits."""
        ahead = self.predictor.foresee(signals, believed(signals, state), self._periods)
        size, thrusters, axes = len(force), self._model.thrusters, self._model.axes
        plan, limit = np.empty((size, self._periods, thrusters)), np.empty(size)
        foreseen = Foreseen(
            error=np.empty((size, self._periods, axes)),
            held=np.empty((size, self._periods, axes)),
            wanted=np.empty((size, self._periods, signals.allocation.shape[1] - axes)),
            allocation=np.empty((size, self._periods, *signals.allocation.shape[1:])),
        )
        hold(signals, self._model, self.gains.heading_gain, ahead, plan, foreseen, limit)
        improve(plan, limit, foreseen, self._problem)
        first_force(signals.allocation, plan, force)
