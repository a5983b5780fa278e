"""Where the robot is, from fixes that come late, rarely, or not at all.

In each axis a Kalman filter on (e, v, d) of `kalman`, with the covariance as it is at every instant:
between fixes it grows. A measurement is taken in at the time at which it was made. For that, what
was predicted since the oldest measurement that can still arrive is kept; a correction then goes on
from there through the linear model, and so do the measurements that came after it. On the linear
model that is the estimate that the same measurement without delay would have given.

What predicts is up to the law: the linear model (`Navigator.estimate`), or the nominal plant
(`prediction`).

Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and
Navigation, 2001, chapter 5 (filter and its consistency).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation import kalman
from usm_baselines.estimation.kalman import DISTURBANCE, ERROR, RATE, THRUST, Linear
from usm_baselines.signals import Signals
from usm_gym.kernels.compile import compiled, piece
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

Array = NDArray[np.float64]

# Spectral densities of what drives v (m/s^2 / sqrt(Hz)) and d (m/s^3 / sqrt(Hz)), for laws that do
# not have them among their gains.
ACCELERATION_NOISE, DISTURBANCE_NOISE = 2e-2, 0.02
# What the filter estimates in an axis, and for how long the disturbance of the start has had to
# grow, s.
STATES = 3
UNKNOWN_FOR = 10.0
# Memory of a robot: control periods since the start; innovation, m, and its variance, m^2, of the
# fix that has arrived, by axis, the variance 0 if none has; (e, v, d, f) by axis; then slots.
COUNT, INNOVATION = 0, 1
# A slot holds, of one instant and axis: what was predicted and its covariance, what became of it by
# the measurements of that instant and its covariance, the measured error and rate with a mark each
# whether there is one, the velocity of the reference.
PRIOR, PRIOR_P, POST, POST_P, Y, HAS_Y, V, HAS_V, REFERENCE = 0, 3, 12, 15, 24, 25, 26, 27, 28
SLOT = 29


class Navigation(NamedTuple):
    """The filter in the form that kernels take.

    Attributes:
        axes: Axes of the position.
        slots: Instants that are remembered.
        transition: (e, v, d) from (e, v, d) over a period, (axes, 3, 3).
        noise: Covariance that a period adds, (axes, 3, 3).
        position_variance: Variance of a fix, m^2.
        velocity_variance: Variance of a measured velocity, m^2/s^2.
        start_variance: Variance of (e, v, d) at the start, (3,).
        h: Control period, s.
        position_delay: Control periods after which a fix arrives.
        velocity_delay: The same of a velocity; -1 if nothing measures it.
        scale: Physical value over observed value, by number of the observation.
        position_error: Index of the first number of an entry of the observation.
        position_age: The same.
        velocity: The same.
        velocity_age: The same.
        reference_velocity: The same.
    """

    axes: int
    slots: int
    transition: Array
    noise: Array
    position_variance: float
    velocity_variance: float
    start_variance: Array
    h: float
    position_delay: int
    velocity_delay: int
    scale: Array
    position_error: int
    position_age: int
    velocity: int
    velocity_age: int
    reference_velocity: int


def is_needed(nominal: Nominal) -> bool:
    """Whether positions come late or rarely, or something measures the velocity.

    Where a position comes at once in every period, the stationary filter of `kalman` will do.
    """
    late = nominal.position_delay > 0 or nominal.position_period > 1
    return late or nominal.velocity_period is not None


@piece
def slot(nav, instant, axis):
    """Where the slot of an instant begins in the memory."""
    first = 1 + 2 * nav.axes + kalman.STATES * nav.axes
    return first + ((instant % nav.slots) * nav.axes + axis) * SLOT


@piece
def take_in(memory, at, index, error, variance):
    """Correct what a slot's POST holds by a measurement of number `index`, off by `error`."""
    S = memory[at + POST_P + STATES * index + index] + variance
    gain_0 = memory[at + POST_P + index] / S
    gain_1 = memory[at + POST_P + STATES + index] / S
    gain_2 = memory[at + POST_P + 2 * STATES + index] / S
    gains = gain_0, gain_1, gain_2
    row_0 = memory[at + POST_P + STATES * index]
    row_1 = memory[at + POST_P + STATES * index + 1]
    row_2 = memory[at + POST_P + STATES * index + 2]
    rows = row_0, row_1, row_2
    for i in range(STATES):
        memory[at + POST + i] += gains[i] * error
        for j in range(STATES):
            memory[at + POST_P + STATES * i + j] -= gains[i] * rows[j]


@piece
def settle(nav, memory, at):
    """Fill in POST of a slot from PRIOR and what was measured then."""
    for i in range(STATES + STATES * STATES):
        memory[at + POST + i] = memory[at + PRIOR + i]
    if memory[at + HAS_Y] > 0.0:
        error = memory[at + Y] - memory[at + POST + ERROR]
        take_in(memory, at, ERROR, error, nav.position_variance)
    if memory[at + HAS_V] > 0.0:
        error = memory[at + V] - memory[at + POST + RATE]
        take_in(memory, at, RATE, error, nav.velocity_variance)


@piece
def carry_covariance(nav, memory, axis, at, following):
    """Fill in PRIOR_P of the slot that follows another: A P A^T + Q."""
    A, Q = nav.transition[axis], nav.noise[axis]
    for i in range(STATES):
        for j in range(STATES):
            total = Q[i, j]
            for k in range(STATES):
                for m in range(STATES):
                    total += A[i, k] * memory[at + POST_P + STATES * k + m] * A[j, m]
            memory[following + PRIOR_P + STATES * i + j] = total


@piece
def run_on(nav, memory, axis, first, last):
    """Settle the slots of instants `first` to `last`, each on what became of the one before."""
    A = nav.transition[axis]
    for instant in range(first, last):
        at, following = slot(nav, instant, axis), slot(nav, instant + 1, axis)
        before_0, before_1 = memory[at + POST], memory[at + POST + 1]
        before_2 = memory[at + POST + 2]
        settle(nav, memory, at)
        change_0 = memory[at + POST] - before_0
        change_1 = memory[at + POST + 1] - before_1
        change_2 = memory[at + POST + 2] - before_2
        for i in range(STATES):
            change = A[i, 0] * change_0 + A[i, 1] * change_1 + A[i, 2] * change_2
            memory[following + PRIOR + i] += change
        carry_covariance(nav, memory, axis, at, following)
    settle(nav, memory, slot(nav, last, axis))


@piece
def begin(nav, memory, axis, estimate):
    """Open the memory with the estimate of the start, which has taken in its measurement."""
    at = slot(nav, 0, axis)
    for i in range(SLOT):
        memory[at + i] = 0.0
    for i in range(STATES):
        memory[at + PRIOR + i] = estimate[i]
        memory[at + PRIOR_P + STATES * i + i] = nav.start_variance[i]
    settle(nav, memory, at)


@piece
def age_of(seen, nav, entry):
    """Age of a measurement, control periods."""
    return round(seen[entry] * nav.scale[entry] / nav.h)


@compiled
def navigate(seen, nav, started, estimate, memory):
    """Take in what has arrived at this instant.

    Args:
        seen: Observation of a robot.
        nav: The filter.
        started: 0.0 at the first call of an episode.
        estimate: (e, v, d) as predicted for now, (axes, 3); becomes the estimate.
        memory: What is kept of the robot.
    """
    now = 0 if started == 0.0 else int(memory[COUNT]) + 1
    memory[COUNT] = now
    # The measurement of the start has been taken in, and is no news when it is seen again.
    fix = now > nav.position_delay and age_of(seen, nav, nav.position_age) == nav.position_delay
    speed = nav.velocity_delay >= 0 and now > nav.velocity_delay
    speed = speed and age_of(seen, nav, nav.velocity_age) == nav.velocity_delay
    first = now
    if fix:
        first = min(first, now - nav.position_delay)
    if speed:
        first = min(first, now - nav.velocity_delay)
    for axis in range(nav.axes):
        memory[INNOVATION + 2 * axis], memory[INNOVATION + 2 * axis + 1] = 0.0, 0.0
        at = slot(nav, now, axis)
        if now == 0:
            begin(nav, memory, axis, estimate[axis])
        else:
            for i in range(STATES):
                memory[at + PRIOR + i] = estimate[axis, i]
            carry_covariance(nav, memory, axis, slot(nav, now - 1, axis), at)
            memory[at + HAS_Y], memory[at + HAS_V] = 0.0, 0.0
        k = nav.reference_velocity + axis
        memory[at + REFERENCE] = seen[k] * nav.scale[k]
        if fix:
            then, k = slot(nav, now - nav.position_delay, axis), nav.position_error + axis
            memory[then + Y], memory[then + HAS_Y] = seen[k] * nav.scale[k], 1.0
            memory[INNOVATION + 2 * axis] = memory[then + Y] - memory[then + PRIOR]
            variance = memory[then + PRIOR_P] + nav.position_variance
            memory[INNOVATION + 2 * axis + 1] = variance
        if speed:
            then, k = slot(nav, now - nav.velocity_delay, axis), nav.velocity + axis
            memory[then + V] = seen[k] * nav.scale[k] - memory[then + REFERENCE]
            memory[then + HAS_V] = 1.0
        run_on(nav, memory, axis, first, now)
        for i in range(STATES):
            estimate[axis, i] = memory[at + POST + i]


@compiled
def estimate_all(signals, mass, linear, nav, memory):
    """One period of the filter on the linear model, for a batch; fills in the signals.

    Args:
        signals: Signals, whose error, rate and disturbance become the estimates.
        mass: Total mass m_t, kg.
        linear: The linear model.
        nav: The filter.
        memory: What is kept, (batch, size).
    """
    estimate, own = np.empty((nav.axes, STATES)), np.empty(kalman.STATES)
    for b in range(signals.y.shape[0]):
        first = 1 + 2 * nav.axes
        for axis in range(nav.axes):
            at = first + kalman.STATES * axis
            last, known = kalman.inputs(signals, mass, linear, b, axis)
            own[:] = memory[b, at : at + kalman.STATES]
            if signals.started[b] == 0.0:
                kalman.start(signals.y[b, axis], signals.velocity[b, axis], own)
            else:
                kalman.predict(linear.transition[axis], last, known, own)
            memory[b, at + THRUST] = own[THRUST]
            estimate[axis] = own[:STATES]
        navigate(signals.observation[b], nav, signals.started[b], estimate, memory[b])
        for axis in range(nav.axes):
            at = first + kalman.STATES * axis
            memory[b, at : at + STATES] = estimate[axis]
            signals.y[b, axis] = estimate[axis, ERROR]
            signals.rate[b, axis] = estimate[axis, RATE]
            signals.disturbance[b, axis] = estimate[axis, DISTURBANCE]
            signals.thrust[b, axis] = memory[b, at + THRUST]


class Navigator:
    """Estimates error, rate and disturbance of a batch of robots.

    Like a policy it keeps nothing itself: its memory, an array of numbers for each robot, travels
    with the caller.

    Attributes:
        size: How many numbers that is.
        constants: The filter, for kernels that predict by themselves and call `navigate`.
    """

    def __init__(
        self, nominal: Nominal, acceleration_noise: float, disturbance_noise: float
    ) -> None:
        """Set up the filter.

        Args:
            nominal: Nominal knowledge.
            acceleration_noise: Spectral density of what drives v, m/s^2 / sqrt(Hz).
            disturbance_noise: Spectral density of what drives d, m/s^3 / sqrt(Hz).

        Raises:
            ValueError: If a density is not above 0, or the robot is not the planar one.
        """
        self._linear = kalman.linear_model(nominal, acceleration_noise, disturbance_noise)
        self.constants = navigation(nominal, self._linear, acceleration_noise, disturbance_noise)
        axes = self.constants.axes
        self.size = 1 + (2 + kalman.STATES + self.constants.slots * SLOT) * axes

    def estimate(self, signals: Signals, mass: float, memory: Array) -> None:
        """Predict by the linear model and take in what has arrived, in place.

        Args:
            signals: What was measured and applied; error, rate, disturbance and thrust are filled
                in.
            mass: Total mass, kg.
            memory: Memory of the batch, (batch, size); zero at the start.
        """
        estimate_all(signals, mass, self._linear, self.constants, memory)

    def innovation(self, memory: Array) -> tuple[Array, Array]:
        """Innovation of the fixes that have arrived, m, and its variance, m^2, (batch, axes).

        The variance is 0 where none has.
        """
        axes = self.constants.axes
        pairs = memory[:, INNOVATION : INNOVATION + 2 * axes].reshape(-1, axes, 2)
        return pairs[:, :, 0], pairs[:, :, 1]

    def covariance(self, memory: Array) -> Array:
        """Covariance of the estimates of (e, v, d), (batch, axes, 3, 3)."""
        nav, count = self.constants, memory[:, COUNT].astype(np.int64)
        first = 1 + (2 + kalman.STATES) * nav.axes
        slots = memory[:, first:].reshape(len(memory), nav.slots, nav.axes, SLOT)
        now = slots[np.arange(len(memory)), count % nav.slots]
        return now[:, :, POST_P : POST_P + STATES**2].reshape(-1, nav.axes, STATES, STATES)


def navigation(
    nominal: Nominal, linear: Linear, acceleration_noise: float, disturbance_noise: float
) -> Navigation:
    """The filter for kernels; arguments as of `Navigator`."""
    world = world_of(nominal.robot)
    first = {name: place.start for name, place in world.layout.slices.items()}
    measures = nominal.velocity_period is not None
    velocity_delay = nominal.velocity_delay if measures else -1
    fix = max(nominal.position_noise, kalman.SMALLEST_NOISE) ** 2
    h = nominal.control_period
    return Navigation(
        axes=len(world.axes),
        slots=1 + max(nominal.position_delay, velocity_delay, 1),
        transition=np.ascontiguousarray(linear.transition[:, :STATES, :STATES]),
        noise=np.stack(
            [
                kalman.process_noise(damping, h, acceleration_noise, disturbance_noise)
                for damping in linear.damping
            ]
        ),
        position_variance=fix,
        velocity_variance=max(nominal.velocity_noise, kalman.SMALLEST_NOISE) ** 2,
        start_variance=np.array([fix, 0.0, disturbance_noise**2 * UNKNOWN_FOR]),
        h=h,
        position_delay=nominal.position_delay,
        velocity_delay=velocity_delay,
        scale=world.layout.scale,
        position_error=first["position_error"],
        position_age=first["position_age"],
        velocity=first["velocity"],
        velocity_age=first["velocity_age"],
        reference_velocity=first["reference_velocity"],
    )
