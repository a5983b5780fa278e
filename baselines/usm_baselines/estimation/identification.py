"""What the robot is, learnt while it swims: an extended Kalman filter on the nominal plant.

Beside (e, v, d) of each axis the filter of `navigator` estimates what is constant, or nearly so, in
an episode: the hydrodynamic coefficients over their nominal values, the current, and the force of
each thruster over its command. How they change the motion of the centre of mass in a period is
found by differences of the nominal plant, whose copies are further lanes of the blocks that are
advanced anyway. All of them drift a little, which is what forgets.

Source: L. Ljung, Asymptotic behavior of the extended Kalman filter as a parameter estimator for
linear systems, IEEE Transactions on Automatic Control 24, 1979.
"""

from __future__ import annotations

import numpy as np

from usm_baselines.estimation.foresight import estimates_of
from usm_baselines.estimation.late_filter import covariance, memory_size, navigate
from usm_baselines.estimation.navigator import navigation, transition_of
from usm_baselines.estimation.prediction import Predictor, note, predicted
from usm_baselines.signals import Array, Signals
from usm_gym.kernels.compile import compiled
from usm_gym.kernels.lanes import WIDTH
from usm_gym.task.nominal import Nominal

# Differences are taken over this, in the units of a belief; beliefs about coefficients and gains
# stay between these.
STEP, LEAST, MOST = 1e-4, 0.2, 5.0


@compiled
def vary(beliefs, varied):
    """Fill in copies of every belief: itself, then with each parameter changed a little.

    Args:
        beliefs: What the robots are believed to be, (robots, numbers); the first are parameters.
        varied: Where to write, (robots, 1 + parameters, numbers).
    """
    for b in range(varied.shape[0]):
        belief = beliefs[b]
        for copy in range(varied.shape[1]):
            if copy > 0:
                belief[copy - 1] += STEP
            varied[b, copy] = belief
            if copy > 0:
                belief[copy - 1] -= STEP


@compiled
def identify(signals, kept, nav, linear, ahead, blocks, state):
    """Bring the state of a batch to the present; its last numbers are parameters and memory.

    Args:
        signals: What was measured and applied.
        kept: Where things are.
        nav: The filter.
        linear: What `transition_of` returns.
        ahead: What was predicted for now of all copies, (robots, 1 + parameters, axes, 2).
        blocks: Their blocks.
        state: State of the predictor, (robots, size).
    """
    model, copies = kept.model, ahead.shape[1]
    estimates = estimates_of(model.axes)
    estimate, transition = np.empty(nav.size), linear.copy()
    for b in range(signals.observation.shape[0]):
        seen, own, started = signals.observation[b], state[b], signals.started[b]
        known, memory = kept.last + seen.size, kept.last + seen.size + copies - 1
        estimate[:estimates] = own[:estimates]
        estimate[estimates:] = own[known:memory]
        for axis in range(model.axes):
            mine = estimate[3 * axis : 3 * axis + 3]
            predicted(seen, model, started, ahead[b, 0], axis, mine)
            for copy in range(1, copies):
                for i in range(2):
                    slope = 0.0
                    if started > 0.0:
                        slope = (ahead[b, copy, axis, i] - mine[i]) / STEP
                    transition[3 * axis + i, estimates + copy - 1] = slope
        navigate(seen, nav, started, transition, estimate, own[memory:])
        own[:estimates] = estimate[:estimates]
        own[known:memory] = estimate[estimates:]
        first = b * copies
        note(seen, started, kept, blocks[first // WIDTH], first % WIDTH, own)


class Identifier(Predictor):
    """A predictor that learns what the robots of a batch are.

    Its state has, after the last observation, how far the parameters are from their nominal values,
    then the memory of the filter.
    """

    def __init__(
        self,
        nominal: Nominal,
        acceleration_noise: float,
        disturbance_noise: float,
        spread: Array,
        drift: Array,
    ) -> None:
        """Set up the filter.

        Args:
            nominal: Nominal knowledge.
            acceleration_noise: Spectral density of what drives v, m/s^2 / sqrt(Hz).
            disturbance_noise: Spectral density of what drives d, m/s^3 / sqrt(Hz).
            spread: Standard deviations of coefficients, current (m/s) and gains at the start, (3,).
            drift: Spectral densities of what drives them, in their units over sqrt(s), (3,).

        Raises:
            ValueError: If nothing foresees the robot, or a density is not above 0.
        """
        super().__init__(nominal, acceleration_noise, disturbance_noise)
        parts = self.coefficients, self.current, self.gains
        numbers = [part.stop - part.start for part in parts]
        more = list(zip(np.repeat(spread, numbers), np.repeat(drift, numbers), strict=True))
        self._parameters = len(more)
        densities = acceleration_noise, disturbance_noise
        self._identifying = navigation(nominal, *densities, more)
        self._memory = self._known + self._parameters
        self.size = self._memory + memory_size(self._identifying)

    def beliefs(self, state: Array) -> Array:
        """What the robots of a batch are believed to be, (batch, numbers)."""
        beliefs = super().beliefs(state)
        beliefs[:, : self._parameters] += state[:, self._known : self._memory]
        for part in (self.coefficients, self.gains):
            np.clip(beliefs[:, part], LEAST, MOST, out=beliefs[:, part])
        return beliefs

    def uncertainty(self, state: Array) -> Array:
        """Standard deviations of the parameters, as beliefs have them, (batch, parameters)."""
        P = covariance(self._identifying, state[:, self._memory :])
        return np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, self.estimates :])

    def estimate(self, signals: Signals, state: Array) -> None:
        """Bring the state, (batch, size), to the present, in place."""
        beliefs = self.beliefs(state)
        varied = np.empty((len(state), 1 + self._parameters, beliefs.shape[1]))
        vary(beliefs, varied)
        blocks, ahead = self._moved(signals, state, varied)
        nav = self._identifying
        identify(
            signals, self._kept, nav, transition_of(self._linear, nav.size), ahead, blocks, state
        )
