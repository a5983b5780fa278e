"""LQG: a Kalman filter, and a linear-quadratic regulator that knows the thrusters' lag.

The regulator minimises the sum of e^2 + weight^2 (change of the force)^2 over the control instants,
for the model of `kalman` with d and w held. It is written in deviations from the steady state,
where thrust and command are -(d + w): state (e, v, f + d + w, last u + d + w), input the change of
u. The price is on the change, not on the force, because chattering is what costs; and the last
command is the one that was applied, so that saturation winds nothing up.

Source: B. D. O. Anderson, J. B. Moore, Optimal Control: Linear Quadratic Methods, 1990, chapters 2
and 8; section 4.3 there for the price on the input's change.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from baselines import kalman
from baselines.kalman import COMMAND, DISTURBANCE, ERROR, RATE, STATES, THRUST
from baselines.policy import HEADING_RANGE, Array, ScriptedPolicy, Signals
from baselines.space import Range, Space
from usm_gym.nominal import Nominal
from usm_gym.plant.compile import compiled, piece
from usm_gym.validation import require

LQG_SPACE: Space = {
    "acceleration_noise": Range(1e-4, 1e-1, "m/s^2 / sqrt(Hz)"),
    "disturbance_noise": Range(1e-2, 10.0, "m/s^3 / sqrt(Hz)"),
    "variation_weight": Range(1e-6, 1e-2, "m/N"),
    "heading_gain": HEADING_RANGE,
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
    disturbance_noise: float = 0.3
    variation_weight: float = 1e-4
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


class LQG(ScriptedPolicy):
    """Linear-quadratic Gaussian control with a disturbance estimate and the thrusters' lag.

    The law's state is (e, v, d, f) of `kalman` for each axis.
    """

    law_size = STATES

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Compute filter and regulator; gains other than the defaults by name, see `LQGGains`."""
        super().__init__(nominal, LQGGains(**gains))
        for name in ("acceleration_noise", "disturbance_noise", "variation_weight"):
            require(getattr(self.gains, name) > 0, name, getattr(self.gains, name), "a number > 0")
        self._linear = kalman.linear_model(
            nominal, self.gains.acceleration_noise, self.gains.disturbance_noise
        )
        weights = self.gains.variation_weight * self._linear.inertia
        self._gain = np.stack(
            [
                regulator_gain(T, weight)
                for T, weight in zip(self._linear.transition, weights, strict=True)
            ]
        )

    def force(self, signals: Signals, law_state: Array) -> Array:
        """Estimate, then regulate."""
        force = np.empty_like(signals.y)
        lqg(signals, self._model.mass, self._linear, self._gain, law_state, force)
        return force
