"""LQG to which the nominal plant foretells what the joint motion will do.

The disturbance is foreseen (`prediction`) before the regulator of `lqg` acts: it is the constant
one that would take the linear model, its last command held, to where the nominal plant will be.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from usm_baselines.estimation import kalman
from usm_baselines.estimation.foresight import NAMES, estimates_of
from usm_baselines.estimation.kalman import DISTURBANCE, ERROR, RATE, STATES, THRUST
from usm_baselines.estimation.prediction import Predictor, believed, held_force
from usm_baselines.laws.lqg import LQG, regulate
from usm_baselines.policy import HEADING_GAIN
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled
from usm_gym.task.nominal import Nominal


class JointLQGGains(NamedTuple):
    """Gains of the LQG controller that knows the joint motion."""

    acceleration_noise: float = Gain(
        1e-2,
        "m/s^2 / sqrt(Hz)",
        "spectral density of the noise on the acceleration",
        tuned=(1e-6, 1.0),
        positive=True,
    )
    # The nominal plant leaves less to the disturbance than the straight body of `lqg`.
    disturbance_noise: float = Gain(
        0.05,
        "m/s^3 / sqrt(Hz)",
        "spectral density of the noise that drives the disturbance",
        tuned=(1e-4, 100.0),
        positive=True,
    )
    variation_weight: float = Gain(
        5e-5,
        "m/N",
        "error that is as bad as a change of the force by 1 N in a period",
        tuned=(1e-7, 1e-2),
        positive=True,
    )
    heading_gain: float = HEADING_GAIN
    lead: float = Gain(
        0.08, "s", "how far ahead the disturbance is foreseen", tuned=(0.02, 0.5), positive=True
    )


@compiled
def joint_lqg(signals, model, linear, gain, state, beliefs, ahead, force):
    """Regulator for a batch, the disturbance being foreseen.

    Args:
        signals: What the law works with.
        model: Nominal knowledge for reading observations.
        linear: The linear model.
        gain: Gains of the regulator, (axes, 4).
        state: State of the predictor, (batch, size).
        beliefs: What the robots are believed to be, (batch, numbers).
        ahead: (error, rate) after each period foreseen, (periods, batch, axes, 2).
        force: Where to write, N, (batch, axes).
    """
    own, held, unit = np.empty(STATES), np.empty(STATES), np.empty(STATES)
    for b, axis in np.ndindex(force.shape):
        inertia, transition = linear.inertia[axis], linear.transition[axis]
        last, thrust = held_force(signals, model, beliefs[b], b, axis) / inertia, 0.0
        for j in range(model.thrusters):
            thrust += signals.allocation[b, axis, j] * state[b, estimates_of(model.axes) + j]
        own[ERROR], own[RATE] = state[b, 3 * axis], state[b, 3 * axis + 1]
        own[DISTURBANCE], own[THRUST] = 0.0, thrust / inertia
        held[:], unit[:] = own, 0.0
        for _ in range(ahead.shape[0]):
            kalman.predict(transition, last, 0.0, held)
            kalman.predict(transition, 0.0, 1.0, unit)
        steady = -(ahead[-1, b, axis, 0] - held[ERROR]) / unit[ERROR]
        force[b, axis] = inertia * regulate(gain[axis], steady, last, own)


class JointLQG(LQG):
    """LQG control that foresees the joint motion; it keeps the state of a `Predictor`."""

    Gains: type[Any] = JointLQGGains
    state = NAMES
    linear = False

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Compute the gains of filter and regulator; gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        self._periods = max(1, round(self.gains.lead / nominal.control_period))
        self.predictor: Predictor = self._make_predictor(nominal)

    def _make_predictor(self, nominal: Nominal) -> Predictor:
        return Predictor(nominal, *self.densities)

    @cached_property
    def law_shape(self) -> tuple[int, ...]:
        """The state of the predictor."""
        return (self.predictor.size,)

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Foresee, regulate."""
        known = believed(signals, state)
        ahead = self.predictor.foresee(signals, known, self._periods)
        beliefs = self.predictor.beliefs(state)
        joint_lqg(signals, self._model, self._linear, self._gain, known, beliefs, ahead, force)
