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

from usm_baselines.estimation import kalman
from usm_baselines.estimation.kalman import COMMAND, DISTURBANCE, ERROR, RATE, THRUST
from usm_baselines.estimation.navigator import Navigator, is_needed
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece
from usm_gym.task.nominal import Nominal


class LQGGains(NamedTuple):
    """Gains of the LQG controller."""

    acceleration_noise: float = Gain(
        1e-2,
        "m/s^2 / sqrt(Hz)",
        "spectral density of the noise on the acceleration",
        tuned=(1e-6, 1.0),
        positive=True,
    )
    disturbance_noise: float = Gain(
        0.5,
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


def regulator_gain(transition: Array, weight: float) -> Array:
    """The regulator's gain on (e, v, f + d + w, last u + d + w), (4,).

    Args:
        transition: Transition of the axis, (4, 6).
        weight: Error that is as bad as a change of u by 1 m/s^2, m s^2/m.
    """
    from scipy.linalg import solve_discrete_are  # here, because it takes long to import

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
    """Filter and regulator for a batch; fills in the force, N, (batch, axes)."""
    for b, axis in np.ndindex(force.shape):
        own = state[b, axis]
        if signals.navigated:
            last, known = kalman.inputs(signals, mass, model, b, axis)
            own[ERROR], own[RATE] = signals.y[b, axis], signals.rate[b, axis]
            own[DISTURBANCE], own[THRUST] = signals.disturbance[b, axis], signals.thrust[b, axis]
        else:
            last, known, _ = kalman.estimate(signals, mass, model, b, axis, own)
        steady = -(own[DISTURBANCE] + known)
        force[b, axis] = model.inertia[axis] * regulate(gain[axis], steady, last, own)


class LQG(ScriptedPolicy):
    """Linear-quadratic Gaussian control with a disturbance estimate and the thrusters' lag."""

    Gains: type[Any] = LQGGains
    # (e, v, d, f) of `kalman`; d is what the nominal model leaves out.
    state: tuple[str, ...] = ("error", "rate", "unmodelled", "thrust")
    shown = ("rate", "unmodelled")
    knows_lag = True
    navigator = Navigator
    # Whether the linear model predicts.
    linear = True

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Compute filter and regulator; gains other than the defaults by name."""
        super().__init__(nominal, navigated=self.linear and is_needed(nominal), **gains)
        self._linear = kalman.linear_model(nominal, *self.densities)
        weights = self.gains.variation_weight * self._linear.inertia
        self._gain = np.stack(list(map(regulator_gain, self._linear.transition, weights)))

    @property
    def densities(self) -> tuple[float, float]:
        """Those among its gains."""
        return self.gains.acceleration_noise, self.gains.disturbance_noise

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Estimate, then regulate."""
        lqg(signals, self._model.mass, self._linear, self._gain, state, force)
