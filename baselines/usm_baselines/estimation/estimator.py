"""The Kalman filter of `kalman` run beside a policy, on what is measured and applied."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation import kalman
from usm_baselines.signals import Array, Signals, model_of, room_for_signals, sense
from usm_gym.kernels.compile import compiled
from usm_gym.task.nominal import Nominal

# Spectral densities of the noise on the acceleration (m/s^2 / sqrt(Hz)) and of that which drives
# the disturbance (m/s^3 / sqrt(Hz)): those that `lqg` starts from.
ACCELERATION_NOISE, DISTURBANCE_NOISE = 1e-2, 0.3


@compiled
def estimate_all(state, model, linear, signals, estimates, innovation):
    """Sense, filter both axes, keep what the next call needs; see `Estimator.update`."""
    sense(state, model, signals)
    thrusters = model.thruster_links.size
    first = 1 + 2 * thrusters
    for b in range(innovation.shape[0]):
        state[b, 0] = 1.0
        for axis in range(2):
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
        size = len(observation)
        if state is None:
            new = np.zeros((size, 1 + 2 * self._thrusters + 2 * kalman.STATES))
        else:
            new = state.copy()
            new[start] = 0.0
        signals = room_for_signals(observation, self._thrusters)
        estimates, innovation = np.empty((size, 2, kalman.STATES)), np.empty((size, 2))
        estimate_all(new, self._model, self._linear, signals, estimates, innovation)
        return signals, estimates, innovation, new
