"""LQG: a Kalman filter, and a linear-quadratic regulator that knows the thrusters' lag.

The regulator minimises the sum of e^2 + weight^2 (change of the force)^2 over the control instants,
for the model of `kalman` with d and w held. It is written in deviations from the steady state,
where thrust and command are -(d + w): state (e, v, f + d + w, last u + d + w), input the change of
u. The price is on the change, not on the force, because chattering is what costs; and the last
command is the one that was applied, so that saturation winds nothing up.

Source: B. D. O. Anderson, J. B. Moore, Optimal Control: Linear Quadratic Methods, 1990.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from usm_baselines.estimation import kalman
from usm_baselines.estimation.kalman import COMMAND, DISTURBANCE, ERROR, RATE, STATES, THRUST
from usm_baselines.estimation.prediction import ESTIMATES, Predictor, held_force
from usm_baselines.laws.policy import HEADING_RANGE, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Range, Space
from usm_gym.kernels.compile import compiled, piece
from usm_gym.task.nominal import Nominal

LQG_SPACE: Space = {
    "acceleration_noise": Range(1e-4, 1e-1, "m/s^2 / sqrt(Hz)"),
    "disturbance_noise": Range(1e-2, 10.0, "m/s^3 / sqrt(Hz)"),
    "variation_weight": Range(1e-6, 1e-2, "m/N"),
    "heading_gain": HEADING_RANGE,
}

JOINT_LQG_SPACE: Space = {
    **LQG_SPACE,
    # The nominal plant leaves less to the disturbance.
    "disturbance_noise": Range(1e-3, 1.0, "m/s^3 / sqrt(Hz)"),
    "lead": Range(0.02, 0.3, "s"),
}


class LQGGains(NamedTuple):
    """Gains of the LQG controller.

    Attributes:
        acceleration_noise: Spectral density of the noise on the acceleration, m/s^2 / sqrt(Hz).
        disturbance_noise: Spectral density of the noise that drives the disturbance,
            m/s^3 / sqrt(Hz).
        variation_weight: Error that is as bad as a change of the force by 1 N in a period, m/N.
        heading_gain: k_psi, N m/rad.
    """

    acceleration_noise: float = 1e-2
    disturbance_noise: float = 0.5
    variation_weight: float = 5e-5
    heading_gain: float = 100.0


class JointLQGGains(NamedTuple):
    """Gains of the LQG controller that knows the joint motion.

    Attributes:
        acceleration_noise: As in `LQGGains`.
        disturbance_noise: As in `LQGGains`.
        variation_weight: As in `LQGGains`.
        lead: How far ahead the disturbance is foreseen, s.
        heading_gain: k_psi, N m/rad.
    """

    acceleration_noise: float = 1e-2
    disturbance_noise: float = 0.05
    variation_weight: float = 5e-5
    lead: float = 0.08
    heading_gain: float = 100.0


def regulator_gain(transition: Array, weight: float) -> Array:
    """The regulator's gain on (e, v, f + d + w, last u + d + w), (4,).

    Args:
        transition: Transition of the axis, (4, 6).
        weight: Error that is as bad as a change of u by 1 m/s^2, m s^2/m.
    """
    rows, columns = [ERROR, RATE, THRUST], [ERROR, RATE, THRUST, COMMAND]
    A = np.zeros((4, 4))
    A[:3] = transition[np.ix_(rows, columns)]
    A[3, 3] = 1.0
    B = A[:, 3:]
    P = solve_discrete_are(A, B, np.diag([1.0, 0.0, 0.0, 0.0]), np.array([[weight**2]]))
    return np.asarray((B.T @ P @ A / (weight**2 + B.T @ P @ B))[0])


@piece
def regulate(gain, steady, last, state):
    """The next command over the inertia, m/s^2.

    Args:
        gain: Gain of the regulator.
        steady: Command of the steady state, -(d + w), m/s^2.
        last: Last command over the inertia, m/s^2.
        state: (e, v, d, f).
    """
    change = gain[0] * state[ERROR] + gain[1] * state[RATE]
    change += gain[2] * (state[THRUST] - steady) + gain[3] * (last - steady)
    return last - change


@compiled
def lqg(signals, mass, model, gain, state, force):
    """Filter and regulator for a batch, both axes; fills in the force, (batch, 2)."""
    for b in range(force.shape[0]):
        for axis in range(2):
            own = state[b, axis]
            last, known, _ = kalman.estimate(signals, mass, model, b, axis, own)
            steady = -(own[DISTURBANCE] + known)
            force[b, axis] = model.inertia[axis] * regulate(gain[axis], steady, last, own)


@compiled
def joint_lqg(signals, model, linear, gain, state, ahead, force):
    """Regulator for a batch, both axes, the disturbance being foreseen.

    It is the constant one that would take the linear model, its last command held, to where the
    nominal plant is foreseen.

    Args:
        signals: What the law works with.
        model: Nominal knowledge for reading observations.
        linear: The linear model.
        gain: Gains of the regulator, (2, 4).
        state: State of the predictor, (batch, size).
        ahead: (error, rate) after each period foreseen, (periods, batch, 2 axes, 2).
        force: Where to write, (batch, 2).
    """
    own, held, unit = np.empty(STATES), np.empty(STATES), np.empty(STATES)
    for b in range(force.shape[0]):
        for axis in range(2):
            inertia, transition = linear.inertia[axis], linear.transition[axis]
            last, thrust = held_force(signals, model, b, axis) / inertia, 0.0
            for j in range(model.thrusters):
                thrust += signals.allocation[b, axis, j] * state[b, ESTIMATES + j]
            own[ERROR], own[RATE] = state[b, 3 * axis], state[b, 3 * axis + 1]
            own[DISTURBANCE], own[THRUST] = 0.0, thrust / inertia
            held[:], unit[:] = own, 0.0
            for _ in range(ahead.shape[0]):
                kalman.predict(transition, last, 0.0, held)
                kalman.predict(transition, 0.0, 1.0, unit)
            steady = -(ahead[-1, b, axis, 0] - held[ERROR]) / unit[ERROR]
            force[b, axis] = inertia * regulate(gain[axis], steady, last, own)


class LQG(ScriptedPolicy):
    """Linear-quadratic Gaussian control with a disturbance estimate and the thrusters' lag.

    The law's state is (e, v, d, f) of `kalman` for each axis.
    """

    law_size = STATES
    positive: tuple[str, ...] = ("variation_weight",)
    _Gains: type[Any] = LQGGains

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Compute filter and regulator; gains other than the defaults by name, see `LQGGains`."""
        super().__init__(nominal, self._Gains(**gains))
        own = self.gains
        self._linear = kalman.linear_model(nominal, own.acceleration_noise, own.disturbance_noise)
        weights = own.variation_weight * self._linear.inertia
        self._gain = np.stack(list(map(regulator_gain, self._linear.transition, weights)))

    def force(self, signals: Signals, law_state: Array) -> Array:
        """Estimate, then regulate."""
        force = np.empty_like(signals.y)
        lqg(signals, self._model.mass, self._linear, self._gain, law_state, force)
        return force


class JointLQG(LQG):
    """LQG control to which the nominal plant foretells what the joint motion will do.

    Filter and future are those of `prediction.Predictor`, whose state is the law's.
    """

    positive = ("variation_weight", "lead")
    _Gains = JointLQGGains

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Compute the gains; gains other than the defaults by name, see `JointLQGGains`."""
        super().__init__(nominal, **gains)
        self._periods = max(1, round(self.gains.lead / nominal.control_period))
        self._predictor = Predictor(nominal, self._linear.correction)

    @property
    def law_shape(self) -> tuple[int, ...]:
        """The state of the predictor."""
        return (self._predictor.size,)

    def force(self, signals: Signals, law_state: Array) -> Array:
        """Estimate, foresee, regulate."""
        self._predictor.estimate(signals, law_state)
        ahead = self._predictor.foresee(signals, law_state, self._periods)
        force = np.empty_like(signals.y)
        joint_lqg(signals, self._model, self._linear, self._gain, law_state, ahead, force)
        return force
