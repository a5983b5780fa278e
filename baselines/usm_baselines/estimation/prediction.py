"""What the nominal robot will do: its plant, run ahead from what is measured and estimated.

Position and velocity of the centre of mass and what the nominal model leaves out, an acceleration
d, come from a Kalman filter with the gains of `kalman`, whose prediction step is the nominal plant
of `foresight`. Water at rest; its current ends up in d.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation import kalman
from usm_baselines.estimation.foresight import (
    CURRENT,
    estimates_of,
    foresight_of,
    gains_from,
)
from usm_baselines.estimation.foresight import NAMES as NAMES
from usm_baselines.estimation.late_filter import memory_size, navigate
from usm_baselines.estimation.navigator import is_needed, navigation, transition_of
from usm_baselines.signals import Array, Model, Signals, commanded, model_of, physical
from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.lanes import WIDTH
from usm_gym.task.nominal import Nominal


class Kept(NamedTuple):
    """Where a predictor's state and its blocks keep what the filter looks at.

    Attributes:
        model: How observations are read.
        forces: Row of the blocks with the force of the first thruster.
        last: Where in the state the last observation begins.
    """

    model: Model
    forces: int
    last: int


@piece
def predicted(seen, model, started, ahead, axis, estimate):
    """Fill in (e, v, d) of an axis as they were predicted for now; at the start, as measured.

    Args:
        seen: Observation.
        model: How it is read.
        started: 0.0 at the first call of an episode.
        ahead: What was predicted, (axes, 2).
        axis: The axis.
        estimate: Its (e, v, d).
    """
    if started == 0.0:
        y = physical(seen, model, model.position_error + axis)
        rate = -physical(seen, model, model.reference_velocity + axis)
        estimate[0], estimate[1], estimate[2] = y, rate, 0.0
    else:
        estimate[0], estimate[1] = ahead[axis, 0], ahead[axis, 1]


@piece
def note(seen, started, kept, block, lane, own):
    """Keep the thrusters' forces and the observation of a robot for the next period."""
    first = estimates_of(kept.model.axes)
    for j in range(kept.model.thrusters):
        own[first + j] = block[(kept.forces + j) * WIDTH + lane] if started > 0.0 else 0.0
    for k in range(seen.size):
        own[kept.last + k] = seen[k]


@compiled
def update(signals, kept, correction, ahead, blocks, state):
    """Bring the state of a batch to the present, by the stationary filter of gain `correction`.

    Args:
        signals: What was measured and applied.
        kept: Where things are.
        correction: Gains of the filter, (axes, 3).
        ahead: What was predicted for now, (robots, axes, 2).
        blocks: Blocks of the robots that it was read from.
        state: State of the predictor, (robots, size).
    """
    model = kept.model
    for b in range(signals.observation.shape[0]):
        seen, own, started = signals.observation[b], state[b], signals.started[b]
        for axis in range(model.axes):
            estimate = own[3 * axis : 3 * axis + 3]
            predicted(seen, model, started, ahead[b], axis, estimate)
            if started > 0.0 and signals.fresh[b]:
                off = physical(seen, model, model.position_error + axis) - estimate[0]
                for i in range(3):
                    estimate[i] += correction[axis, i] * off
        note(seen, started, kept, blocks[b // WIDTH], b % WIDTH, own)


@compiled
def update_late(signals, kept, nav, transition, ahead, blocks, state):
    """The same by the filter `nav` of `navigator`, whose memory comes last in the state."""
    model = kept.model
    estimate = np.empty(estimates_of(model.axes))
    for b in range(signals.observation.shape[0]):
        seen, own, started = signals.observation[b], state[b], signals.started[b]
        estimate[:] = own[: estimate.size]
        for axis in range(model.axes):
            mine = estimate[3 * axis : 3 * axis + 3]
            predicted(seen, model, started, ahead[b], axis, mine)
        navigate(seen, nav, started, transition, estimate, own[kept.last + seen.size :])
        own[: estimate.size] = estimate
        note(seen, started, kept, blocks[b // WIDTH], b % WIDTH, own)


@piece
def held_force(signals, model, belief, b, axis):
    """Force, N, that the last commands of a robot make in an axis, its links being as they are."""
    force = 0.0
    for j in range(model.thrusters):
        share = signals.allocation[b, axis, j] * belief[gains_from(model.axes) + j]
        force += share * commanded(signals.observation[b], model, j)
    return force


@compiled
def tell(signals, mass, state):
    """Fill in the estimates among the signals from the state of a predictor, (batch, size)."""
    size, axes = signals.y.shape
    for b in range(size):
        for axis in range(axes):
            first, thrust = len(NAMES) * axis, 0.0
            signals.y[b, axis] = state[b, first]
            signals.rate[b, axis] = state[b, first + 1]
            signals.disturbance[b, axis] = state[b, first + 2]
            for j in range(signals.allocation.shape[2]):
                thrust += signals.allocation[b, axis, j] * state[b, estimates_of(axes) + j]
            signals.thrust[b, axis] = thrust / mass


def believed(signals: Signals, state: Array) -> Array:
    """The state of a predictor with the estimates that are among the signals."""
    changed, each = state.copy(), len(NAMES)
    end = estimates_of(signals.y.shape[1])
    changed[:, 0:end:each] = signals.y
    changed[:, 1:end:each] = signals.rate
    changed[:, 2:end:each] = signals.disturbance
    return changed


class Predictor:
    """Estimates where the robots of a batch are, and foresees where they will be.

    Its state is an array of numbers for each robot: (e, v, d) of each axis, the forces of the
    thrusters in N, the last observation, and where positions come late or rarely, the memory of a
    navigator.

    Attributes:
        size: How many numbers that is.
        estimates: How many of them are (e, v, d).
        coefficients: Where the hydrodynamic coefficients are in a belief.
        current: Where the current is.
        gains: Where the gains of the thrusters are.
        factors: Where the factors of the links are.
    """

    def __init__(
        self, nominal: Nominal, acceleration_noise: float, disturbance_noise: float
    ) -> None:
        """Keep the nominal robot, and set up the filter.

        Args:
            nominal: Nominal knowledge.
            acceleration_noise: Spectral density of what drives v, m/s^2 / sqrt(Hz).
            disturbance_noise: Spectral density of what drives d, m/s^3 / sqrt(Hz).

        Raises:
            ValueError: If nothing foresees the robot, or a density is not above 0.
        """
        self._foresight = foresight_of(nominal.robot, nominal)
        densities = acceleration_noise, disturbance_noise
        self._linear = kalman.linear_model(nominal, *densities)
        self._filter = navigation(nominal, *densities) if is_needed(nominal) else None
        axes, thrusters = self._foresight.axes, self._foresight.thrusters
        first = gains_from(axes)
        self.coefficients, self.current = slice(0, CURRENT), slice(CURRENT, first)
        self.gains = slice(first, first + thrusters)
        self.factors = slice(self.gains.stop, self.gains.stop + self._foresight.links)
        self._neutral = np.ones(self.factors.stop)
        self._neutral[self.current] = 0.0
        self.estimates = estimates_of(axes)
        model, last = model_of(nominal), self.estimates + thrusters
        self._kept = Kept(model, self._foresight.forces, last)
        self._known = last + model.scale.size
        self.size = self._known + (memory_size(self._filter) if self._filter else 0)

    def beliefs(self, state: Array) -> Array:
        """What the robots of a batch are believed to be, (batch, numbers): here the nominal one."""
        beliefs = np.empty((len(state), self._neutral.size))
        beliefs[:] = self._neutral
        return beliefs

    def estimate(self, signals: Signals, state: Array) -> None:
        """Bring the state, (batch, size), to the present, in place."""
        blocks, ahead = self._moved(signals, state, self.beliefs(state)[:, np.newaxis])
        if self._filter is None:
            update(signals, self._kept, self._linear.correction, ahead[:, 0], blocks, state)
        else:
            transition = transition_of(self._linear, self.estimates)
            update_late(signals, self._kept, self._filter, transition, ahead[:, 0], blocks, state)

    def miss(self, signals: Signals, state: Array, rate: Array) -> Array:
        """What the plant, as it was believed to be, has left out over the past period.

        Args:
            signals: What was measured and applied.
            state: State of a period ago, the true errors and rates among its estimates and a
                disturbance of 0, (batch, size).
            rate: True rates of the error now, m/s, (batch, axes).

        Returns:
            The mean acceleration that was left out, m/s^2, (batch, axes).
        """
        _, ahead = self._moved(signals, state, self.beliefs(state)[:, np.newaxis])
        missed: Array = (rate - ahead[:, 0, :, 1]) / self._kept.model.h
        return missed

    def foresee(self, signals: Signals, state: Array, periods: int) -> Array:
        """Where estimated robots go if their last commands are held.

        Returns:
            Error and its rate after each period, m and m/s, (periods, batch, axes, 2).
        """
        seen, beliefs = signals.observation, self.beliefs(state)[:, np.newaxis]
        blocks = self._foresight.placed(seen, state, seen, beliefs)
        ahead = np.empty((periods, len(seen), 1, self._foresight.axes, 2))
        self._foresight.run(seen, blocks, ahead)
        return ahead[:, :, 0]

    def _moved(self, signals: Signals, state: Array, beliefs: Array) -> tuple[Array, Array]:
        """Copies of the robots of a period ago, moved to now, and (error, rate) of them.

        Args:
            signals: What was measured and applied.
            state: State of a period ago, (robots, size).
            beliefs: What the copies are believed to be, (robots, copies, numbers).

        Returns:
            Their blocks, and (error, rate) in m and m/s, (robots, copies, axes, 2).
        """
        before: NDArray[np.float32] = state[:, self._kept.last : self._known].astype(np.float32)
        blocks = self._foresight.placed(before, state, signals.observation, beliefs)
        ahead = np.empty((1, *beliefs.shape[:2], self._foresight.axes, 2))
        self._foresight.run(before, blocks, ahead)
        return blocks, ahead[0]
