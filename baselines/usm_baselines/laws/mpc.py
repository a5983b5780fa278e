"""Linear model-predictive control on the free response of the nominal plant.

What happens if the commands stay as they are is foreseen with the whole nominal plant, joint motion
included (`prediction`); what changes of the force add to it is taken from the linear model of the
straight body (`kalman`). The changes over the horizon minimise the sum of e^2 + weight^2 (change of
the force)^2, an unconstrained least-squares problem, whose first change is applied. The thrusters
saturate it; the next period starts from what they did.

Sources: E. F. Camacho, C. Bordons, Model Predictive Control, 2nd edition, 2007 (free and forced
response); R. M. C. De Keyser, A. R. Van Cauwenberghe, Extended prediction self-adaptive control,
IFAC Symposium on Identification and System Parameter Estimation 1985 (free response of another
model).
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from usm_baselines.estimation import kalman
from usm_baselines.estimation.foresight import NAMES
from usm_baselines.estimation.kalman import COMMAND, ERROR, RATE, THRUST
from usm_baselines.estimation.prediction import Predictor, believed, held_force
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled
from usm_gym.task.nominal import Nominal


class MPCGains(NamedTuple):
    """Gains of the predictive controller."""

    acceleration_noise: float = Gain(
        1e-2,
        "m/s^2 / sqrt(Hz)",
        "spectral density of the noise on the acceleration",
        tuned=(1e-6, 1.0),
        positive=True,
    )
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
    horizon: float = Gain(0.2, "s", "how far it looks ahead", tuned=(0.04, 0.5), positive=True)
    heading_gain: float = HEADING_GAIN


def forced_response(transition: Array, periods: int) -> Array:
    """Error after period i from a unit change of u at instant j, (periods, periods)."""
    rows = [ERROR, RATE, THRUST]
    A, B = transition[np.ix_(rows, rows)], transition[rows, COMMAND]
    x, step = np.zeros(3), np.zeros(periods)
    for i in range(periods):
        x = A @ x + B
        step[i] = x[0]
    response = np.zeros((periods, periods))
    for j in range(periods):
        response[j:, j] = step[: periods - j]
    return response


def receding_gain(transition: Array, periods: int, weight: float) -> Array:
    """What the first change of u is, over minus the free response of the error, (periods,).

    Args:
        transition: Transition of the axis, see `kalman`, (4, 6).
        periods: Periods in the horizon.
        weight: Error that is as bad as a change of u by 1 m/s^2, m s^2/m.
    """
    S = forced_response(transition, periods)
    return np.asarray(np.linalg.solve(S.T @ S + weight**2 * np.eye(periods), S.T)[0])


@compiled
def receding(signals, model, inertia, gain, beliefs, ahead, force):
    """Add the first change to the force of the held commands; fills in the force, (batch, axes)."""
    for b, axis in np.ndindex(force.shape):
        total = held_force(signals, model, beliefs[b], b, axis)
        for i in range(ahead.shape[0]):
            total -= inertia[axis] * gain[axis, i] * ahead[i, b, axis, 0]
        force[b, axis] = total


class MPC(ScriptedPolicy):
    """Predictive control with measured joint motion and known joint references.

    It keeps the state of a `Predictor`.
    """

    Gains = MPCGains
    state = NAMES
    shown = ("rate", "unmodelled")
    knows_lag = True

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Compute the gains of filter and regulator; gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        densities = self.gains.acceleration_noise, self.gains.disturbance_noise
        linear = kalman.linear_model(nominal, *densities)
        self._periods = max(1, round(self.gains.horizon / nominal.control_period))
        self._inertia = linear.inertia
        self.predictor: Predictor = Predictor(nominal, *densities)
        weights = self.gains.variation_weight * linear.inertia
        self._gain = np.stack(
            [
                receding_gain(T, self._periods, weight)
                for T, weight in zip(linear.transition, weights, strict=True)
            ]
        )

    @cached_property
    def law_shape(self) -> tuple[int, ...]:
        """The state of the predictor."""
        return (self.predictor.size,)

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Foresee, correct."""
        known = believed(signals, state)
        ahead = self.predictor.foresee(signals, known, self._periods)
        beliefs = self.predictor.beliefs(state)
        receding(signals, self._model, self._inertia, self._gain, beliefs, ahead, force)
