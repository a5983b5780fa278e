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

from usm_baselines.estimation.late_filter import covariance, memory_size, navigate
from usm_baselines.estimation.navigator import navigation, transition_of
from usm_baselines.estimation.prediction import (
    AXES,
    CURRENT,
    ESTIMATES,
    THRUSTER_GAINS,
    Predictor,
    advance_all,
    note,
    place,
    predicted,
)
from usm_baselines.signals import Array, Signals
from usm_gym.kernels.compile import compiled
from usm_gym.kernels.lanes import WIDTH
from usm_gym.task.nominal import Nominal

# Differences are taken over this, in the units of a belief; beliefs about coefficients and gains
# stay between these.
STEP, LEAST, MOST = 1e-4, 0.2, 5.0


@compiled
def place_variations(observation, nominal, state, beliefs, parameters, blocks):
    """Place every robot as it was a period ago, and once more for each parameter changed a little.

    Args:
        observation: Observations now, (batch, numbers).
        nominal: The nominal robot.
        state: State of the predictor, (batch, size).
        beliefs: What the robots are believed to be, (batch, numbers); the first are parameters.
        parameters: How many parameters there are.
        blocks: Where to write; a robot has as many blocks as its lanes fill.
    """
    last = ESTIMATES + nominal.plant.thruster_links.size
    each = (parameters + WIDTH) // WIDTH
    for b in range(observation.shape[0]):
        own, belief = state[b], beliefs[b]
        for lane in range(parameters + 1):
            if lane > 0:
                belief[lane - 1] += STEP
            block = blocks[each * b + lane // WIDTH]
            place(own[last:], nominal, own, observation[b], belief, block, lane % WIDTH)
            if lane > 0:
                belief[lane - 1] -= STEP


@compiled
def identify(signals, nominal, nav, linear, parameters, blocks, state):
    """Bring the state of a batch to the present; its last numbers are parameters and memory."""
    last = ESTIMATES + nominal.plant.thruster_links.size
    each = (parameters + WIDTH) // WIDTH
    estimate, changed = np.empty(nav.size), np.empty(3)
    transition = linear.copy()
    for b in range(signals.observation.shape[0]):
        seen, own, started = signals.observation[b], state[b], signals.started[b]
        before, known = own[last:], last + seen.size
        estimate[:ESTIMATES] = own[:ESTIMATES]
        estimate[ESTIMATES:] = own[known : known + parameters]
        for axis in range(AXES):
            mine, first = estimate[3 * axis : 3 * axis + 3], blocks[each * b]
            predicted(seen, before, started, nominal, first, 0, axis, mine)
            for lane in range(1, parameters + 1):
                block = blocks[each * b + lane // WIDTH]
                predicted(seen, before, started, nominal, block, lane % WIDTH, axis, changed)
                for i in range(2):
                    slope = (changed[i] - mine[i]) / STEP if started > 0.0 else 0.0
                    transition[3 * axis + i, ESTIMATES + lane - 1] = slope
        navigate(seen, nav, started, transition, estimate, own[known + parameters :])
        own[:ESTIMATES] = estimate[:ESTIMATES]
        own[known : known + parameters] = estimate[ESTIMATES:]
        note(seen, started, nominal, blocks[each * b], 0, own)


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
            ValueError: If the robot is not the planar one, or a density is not above 0.
        """
        super().__init__(nominal, acceleration_noise, disturbance_noise)
        numbers = (CURRENT, THRUSTER_GAINS - CURRENT, self._thrusters)
        more = list(zip(np.repeat(spread, numbers), np.repeat(drift, numbers), strict=True))
        self._parameters = len(more)
        densities = acceleration_noise, disturbance_noise
        self._identifying = navigation(nominal, *densities, more)
        self._known = ESTIMATES + self._thrusters + self._nominal.scale.size
        self._memory = self._known + self._parameters
        self.size = self._memory + memory_size(self._identifying)

    def beliefs(self, state: Array) -> Array:
        """What the robots of a batch are believed to be, (batch, numbers)."""
        beliefs = super().beliefs(state)
        beliefs[:, : self._parameters] += state[:, self._known : self._memory]
        for part in (slice(0, CURRENT), slice(THRUSTER_GAINS, self._parameters)):
            np.clip(beliefs[:, part], LEAST, MOST, out=beliefs[:, part])
        return beliefs

    def uncertainty(self, state: Array) -> Array:
        """Standard deviations of the parameters, as beliefs have them, (batch, parameters)."""
        P = covariance(self._identifying, state[:, self._memory :])
        return np.sqrt(np.diagonal(P, axis1=1, axis2=2)[:, ESTIMATES:])

    def estimate(self, signals: Signals, state: Array) -> None:
        """Bring the state, (batch, size), to the present, in place."""
        nominal, parameters, seen = self._nominal, self._parameters, signals.observation
        each = (parameters + WIDTH) // WIDTH
        blocks = np.zeros((each * len(seen), nominal.row.size * WIDTH))
        place_variations(seen, nominal, state, self.beliefs(state), parameters, blocks)
        advance_all(blocks, nominal.plant)
        nav = self._identifying
        linear = transition_of(self._linear, nav.size)
        identify(signals, nominal, nav, linear, parameters, blocks, state)
