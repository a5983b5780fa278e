"""The Kalman filter of `kalman` run beside a policy, on what is measured and applied."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation import kalman
from usm_baselines.signals import Array, Signals, model_of, sense, shared_size, signals_of
from usm_gym.kernels.compile import compiled
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

# Spectral densities of the noise on the acceleration (m/s^2 / sqrt(Hz)) and of that which drives
# the disturbance (m/s^3 / sqrt(Hz)): those that `lqg` starts from.
ACCELERATION_NOISE, DISTURBANCE_NOISE = 1e-2, 0.3


@compiled
def estimate_all(state, model, linear, signals, estimates, innovation):
    """Sense, filter both axes, keep what the next call needs; see `Estimator.update`."""
    sense(state, model, signals)
    thrusters = model.thrusters
    first = shared_size(model)
    for b in range(innovation.shape[0]):
        state[b, 0] = 1.0
        for axis in range(model.axes):
            at = first + kalman.STATES * axis
            own = state[b, at : at + kalman.STATES]
            _, _, innovation[b, axis] = kalman.estimate(signals, model.mass, linear, b, axis, own)
            estimates[b, axis] = own
            for j in range(thrusters):
                state[b, 1 + axis * thrusters + j] = signals.allocation[b, axis, j]


class Estimator:
    """Error, its rate, disturbance and thrust of a batch of robots, by a stationary Kalman filter.

    Like a policy it keeps nothing itself: the state travels with the caller.
    """

    def __init__(self, nominal: Nominal) -> None:
        """Compute the filter from nominal knowledge."""
        self._world, self._model = world_of(nominal.robot), model_of(nominal)
        self._linear = kalman.linear_model(nominal, ACCELERATION_NOISE, DISTURBANCE_NOISE)

    def update(
        self, observation: NDArray[np.float32], state: Array | None, start: NDArray[np.bool_]
    ) -> tuple[Signals, Array, Array, Array]:
        """Take in a batch of observations.

        Args:
            observation: Plain observations, (batch, numbers).
            state: What the last call returned; None at the start.
            start: Where an episode starts, (batch,).

        Returns:
            What was measured and applied; (e, v, d, f) per axis in m, m/s, m/s^2 and m/s^2,
            (batch, 2, 4); innovations, m, (batch, 2); and the state for the next call.
        """
        size = len(observation)
        if state is None:
            own = self._model.axes * kalman.STATES
            new = np.zeros((size, shared_size(self._model) + own))
        else:
            new = state.copy()
            new[start] = 0.0
        signals, axes = signals_of(observation, self._model, self._world), self._model.axes
        estimates, innovation = np.empty((size, axes, kalman.STATES)), np.empty((size, axes))
        estimate_all(new, self._model, self._linear, signals, estimates, innovation)
        return signals, estimates, innovation, new
