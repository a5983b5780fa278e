"""The Kalman filter of `kalman` run beside a policy, on what is measured and applied."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baselines import kalman
from baselines.policy import Array, Signals, model_of, signals_of
from usm_gym.nominal import Nominal
from usm_gym.plant.compile import compiled

# Spectral densities of the noise on the acceleration (m/s^2 / sqrt(Hz)) and of that which drives
# the disturbance (m/s^3 / sqrt(Hz)): those that `lqg` starts from.
ACCELERATION_NOISE, DISTURBANCE_NOISE = 1e-2, 0.3


@compiled
def estimate_all(signals, mass, model, state, innovation):
    """Filter both axes of a batch; fills in the innovations, m, (batch, 2)."""
    for b in range(innovation.shape[0]):
        for axis in range(2):
            own = state[b, axis]
            _, _, innovation[b, axis] = kalman.estimate(signals, mass, model, b, axis, own)


class Estimator:
    """Error, its rate, disturbance and thrust of a batch of robots, by a stationary Kalman filter.

    Like a policy it keeps nothing itself: the state travels with the caller.
    """

    def __init__(self, nominal: Nominal) -> None:
        """Compute the filter from nominal knowledge."""
        self._model = model_of(nominal)
        self._linear = kalman.linear_model(nominal, ACCELERATION_NOISE, DISTURBANCE_NOISE)
        self._thrusters = len(nominal.robot.thrusters)

    def update(
        self, observation: NDArray[np.float32], state: Array | None, start: NDArray[np.bool_]
    ) -> tuple[Signals, Array, Array, Array]:
        """Take in a batch of observations.

        Args:
            observation: Plain observations, (batch, numbers).
            state: What the last call returned; None at the start.
            start: Where an episode starts, (batch,).

        Returns:
            What was measured and applied; (e, v, d, f) of each axis in m, m/s, m/s^2 and m/s^2,
            (batch, 2, 4); innovations, m, (batch, 2); and the state for the next call.
        """
        size, thrusters = len(observation), self._thrusters
        filtered = 1 + 2 * thrusters
        new = np.zeros((size, filtered + 2 * kalman.STATES))
        if state is not None:
            new[~start] = state[~start]
        signals = signals_of(observation, new, self._model)
        innovation = np.empty((size, 2))
        estimates = new[:, filtered:].reshape(size, 2, kalman.STATES).copy()
        estimate_all(signals, self._model.mass, self._linear, estimates, innovation)
        new[:, 0] = 1.0
        new[:, 1:filtered] = signals.allocation[:, :2].reshape(size, -1)
        new[:, filtered:] = estimates.reshape(size, -1)
        return signals, estimates, innovation, new
