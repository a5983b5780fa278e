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

from typing import NamedTuple

import numpy as np

from usm_baselines.estimation import kalman
from usm_baselines.estimation.kalman import COMMAND, ERROR, RATE, THRUST
from usm_baselines.estimation.prediction import Predictor, held_force
from usm_baselines.laws.policy import HEADING_RANGE, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Range, Space
from usm_gym.kernels.compile import compiled
from usm_gym.task.nominal import Nominal

MPC_SPACE: Space = {
    "acceleration_noise": Range(1e-4, 1e-1, "m/s^2 / sqrt(Hz)"),
    "disturbance_noise": Range(1e-3, 1.0, "m/s^3 / sqrt(Hz)"),
    "variation_weight": Range(1e-6, 1e-3, "m/N"),
    "heading_gain": HEADING_RANGE,
}


class MPCGains(NamedTuple):
    """Gains of the predictive controller.

    Attributes:
        acceleration_noise: As in `lqg.LQGGains`.
        disturbance_noise: As in `lqg.LQGGains`.
        variation_weight: As in `lqg.LQGGains`.
        horizon: How far it looks ahead, s.
        heading_gain: k_psi, N m/rad.
    """

    acceleration_noise: float = 1e-2
    disturbance_noise: float = 0.05
    variation_weight: float = 5e-5
    horizon: float = 0.2
    heading_gain: float = 100.0


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
def receding(signals, model, inertia, gain, ahead, force):
    """Add the first change to the force of the held commands; fills in the force, (batch, 2)."""
    for b in range(force.shape[0]):
        for axis in range(2):
            total = held_force(signals, model, b, axis)
            for i in range(ahead.shape[0]):
                total -= inertia[axis] * gain[axis, i] * ahead[i, b, axis, 0]
            force[b, axis] = total


class MPC(ScriptedPolicy):
    """Predictive control with measured joint motion and known joint references.

    The law's state is that of `prediction.Predictor`.
    """

    positive = ("variation_weight", "horizon")

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Compute the gains; gains other than the defaults by name, see `MPCGains`."""
        super().__init__(nominal, MPCGains(**gains))
        linear = kalman.linear_model(
            nominal, self.gains.acceleration_noise, self.gains.disturbance_noise
        )
        self._periods = max(1, round(self.gains.horizon / nominal.control_period))
        self._inertia = linear.inertia
        self._predictor = Predictor(nominal, linear.correction)
        weights = self.gains.variation_weight * linear.inertia
        self._gain = np.stack(
            [
                receding_gain(T, self._periods, weight)
                for T, weight in zip(linear.transition, weights, strict=True)
            ]
        )

    @property
    def law_shape(self) -> tuple[int, ...]:
        """The state of the predictor."""
        return (self._predictor.size,)

    def force(self, signals: Signals, law_state: Array) -> Array:
        """Estimate, foresee, correct."""
        self._predictor.estimate(signals, law_state)
        ahead = self._predictor.foresee(signals, law_state, self._periods)
        force = np.empty_like(signals.y)
        receding(signals, self._model, self._inertia, self._gain, ahead, force)
        return force
