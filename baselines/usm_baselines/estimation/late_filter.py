"""A Kalman filter whose measurements come late, rarely, or not at all.

It estimates (e, v, d) of `kalman` in each axis, and what else a law lets it estimate, with the
covariance as it is at every instant: between fixes it grows. A measurement is taken in at the time
at which it was made. For that, what was predicted since the oldest measurement that can still
arrive is kept; a correction then goes on from there through the linearised model, and so do the
measurements that came after it. On a linear model that is the estimate that the same measurement
without delay would have given.

Source: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and
Navigation, 2001, chapter 5 (filter and its consistency).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation.kalman import ERROR, RATE
from usm_gym.kernels.compile import compiled, piece, shared

Array = NDArray[np.float64]

# Numbers that are estimated in an axis, (e, v, d).
STATES = 3
# Memory of a robot: control periods since the start; for each axis the innovation, m, of the fix
# that has arrived, and its variance, m^2, 0 if none has; then slots.
COUNT, INNOVATION = 0, 1
# A slot holds, of one instant, a header for each axis: the measured error and rate, with a mark
# each whether there is one, and the velocity of the reference. Then of the whole: what was
# predicted, its covariance, what became of it by the measurements of that instant, its covariance,
# and how it follows from the instant before.
Y, HAS_Y, V, HAS_V, REFERENCE = range(5)
MEASURED = 5


class Navigation(NamedTuple):
    """The filter in the form that kernels take.

    The first 3 axes numbers that it estimates are (e, v, d) of each axis; others, which stay as
    they are but for noise, may follow.

    Attributes:
        axes: Axes of the position.
        size: Numbers that are estimated.
        slots: Instants that are remembered.
        noise: Covariance that a period adds, (size, size).
        start: Covariance of the start, (size, size).
        position_variance: Variance of a fix, m^2.
        velocity_variance: Variance of a measured velocity, m^2/s^2.
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
    size: int
    slots: int
    noise: Array
    start: Array
    position_variance: float
    velocity_variance: float
    h: float
    position_delay: int
    velocity_delay: int
    scale: Array
    position_error: int
    position_age: int
    velocity: int
    velocity_age: int
    reference_velocity: int


class Slot(NamedTuple):
    """Where the parts of a slot begin in the memory."""

    measured: int
    prior: int
    prior_covariance: int
    post: int
    post_covariance: int
    transition: int


@shared
def slot_size(axes: int, size: int) -> int:
    """How many numbers a slot has."""
    return MEASURED * axes + 2 * (size + size * size) + STATES * axes * size


@shared
def slot(nav: Navigation, instant: int) -> Slot:
    """Where the slot of an instant is in the memory."""
    at = 1 + 2 * nav.axes + (instant % nav.slots) * slot_size(nav.axes, nav.size)
    prior = at + MEASURED * nav.axes
    square = nav.size * nav.size
    post = prior + nav.size + square
    return Slot(at, prior, prior + nav.size, post, post + nav.size, post + nav.size + square)


@piece
def take_in(nav, memory, at, index, measurement, variance):
    """Correct what a slot's posterior holds by a measurement of number `index`."""
    size, P = nav.size, at.post_covariance
    error = measurement - memory[at.post + index]
    row = P + size * index
    S = memory[row + index] + variance
    for i in range(size):
        if i != index:
            gain = memory[P + size * i + index] / S
            memory[at.post + i] += gain * error
            for j in range(size):
                memory[P + size * i + j] -= gain * memory[row + j]
    # The row itself comes last, because the others need it as it was.
    gain = memory[row + index] / S
    memory[at.post + index] += gain * error
    for j in range(size):
        memory[row + j] *= 1.0 - gain


@piece
def settle(nav, memory, at):
    """Fill in the posterior of a slot from what was predicted and what was measured then."""
    for i in range(nav.size + nav.size * nav.size):
        memory[at.post + i] = memory[at.prior + i]
    for axis in range(nav.axes):
        own, e = at.measured + MEASURED * axis, STATES * axis + ERROR
        if memory[own + HAS_Y] > 0.0:
            take_in(nav, memory, at, e, memory[own + Y], nav.position_variance)
        if memory[own + HAS_V] > 0.0:
            v = STATES * axis + RATE
            take_in(nav, memory, at, v, memory[own + V], nav.velocity_variance)


@piece
def carry_covariance(nav, memory, at, following, work):
    """Fill in the predicted covariance of the slot that follows another: F P F^T + Q.

    Only the first rows of F, those of (e, v, d), are other than those of the identity.
    """
    size, moving = nav.size, STATES * nav.axes
    P, F, new = at.post_covariance, following.transition, following.prior_covariance
    for i in range(moving):
        for j in range(size):
            total = 0.0
            for k in range(size):
                total += memory[F + size * i + k] * memory[P + size * k + j]
            work[i, j] = total
    for i in range(moving, size):
        for j in range(moving, size):
            memory[new + size * i + j] = memory[P + size * i + j] + nav.noise[i, j]
    for i in range(moving):
        for j in range(moving, size):
            memory[new + size * i + j] = work[i, j] + nav.noise[i, j]
            memory[new + size * j + i] = work[i, j] + nav.noise[i, j]
        for j in range(moving):
            total = nav.noise[i, j]
            for k in range(size):
                total += work[i, k] * memory[F + size * j + k]
            memory[new + size * i + j] = total


@piece
def run_on(nav, memory, first, last, change, work):
    """Settle the slots of instants `first` to `last`, each on what became of the one before."""
    size, moving = nav.size, STATES * nav.axes
    for instant in range(first, last):
        at, following = slot(nav, instant), slot(nav, instant + 1)
        for i in range(size):
            change[i] = -memory[at.post + i]
        settle(nav, memory, at)
        for i in range(size):
            change[i] += memory[at.post + i]
        for i in range(size):
            moved = change[i]
            if i < moving:
                moved = 0.0
                for k in range(size):
                    moved += memory[following.transition + size * i + k] * change[k]
            memory[following.prior + i] += moved
        carry_covariance(nav, memory, at, following, work)
    settle(nav, memory, slot(nav, last))


@piece
def age_of(seen, nav, entry):
    """Age of a measurement, control periods."""
    return round(seen[entry] * nav.scale[entry] / nav.h)


@piece
def open_slot(seen, nav, memory, now, estimate, transition, work):
    """Begin the slot of this instant with what was predicted for it."""
    at, size = slot(nav, now), nav.size
    for axis in range(nav.axes):
        own, k = at.measured + MEASURED * axis, nav.reference_velocity + axis
        memory[own + HAS_Y], memory[own + HAS_V] = 0.0, 0.0
        memory[own + REFERENCE] = seen[k] * nav.scale[k]
    for i in range(size):
        memory[at.prior + i] = estimate[i]
        for j in range(size):
            if i < STATES * nav.axes:
                memory[at.transition + size * i + j] = transition[i, j]
            if now == 0:
                memory[at.prior_covariance + size * i + j] = nav.start[i, j]
    if now > 0:
        carry_covariance(nav, memory, slot(nav, now - 1), at, work)


@compiled
def navigate(seen, nav, started, transition, estimate, memory):
    """Take in what has arrived at this instant.

    Args:
        seen: Observation of a robot.
        nav: The filter.
        started: 0.0 at the first call of an episode.
        transition: (e, v, d) of all axes from all that is estimated, over the period that has
            passed, (3 axes, size).
        estimate: What is estimated, as predicted for now, (size,); becomes the estimate.
        memory: What is kept of the robot.
    """
    now = 0 if started == 0.0 else int(memory[COUNT]) + 1
    memory[COUNT] = now
    work, change = np.empty((STATES * nav.axes, nav.size)), np.empty(nav.size)
    open_slot(seen, nav, memory, now, estimate, transition, work)
    # The measurement of the start has been taken in, and is no news when it is seen again.
    fix = now > nav.position_delay and age_of(seen, nav, nav.position_age) == nav.position_delay
    speed = nav.velocity_delay >= 0 and now > nav.velocity_delay
    speed = speed and age_of(seen, nav, nav.velocity_age) == nav.velocity_delay
    first = now
    for axis in range(nav.axes):
        innovation = INNOVATION + 2 * axis
        memory[innovation], memory[innovation + 1] = 0.0, 0.0
        if fix:
            first = min(first, now - nav.position_delay)
            then, k = slot(nav, now - nav.position_delay), nav.position_error + axis
            own, e = then.measured + MEASURED * axis, STATES * axis + ERROR
            memory[own + Y], memory[own + HAS_Y] = seen[k] * nav.scale[k], 1.0
            memory[innovation] = memory[own + Y] - memory[then.prior + e]
            variance = memory[then.prior_covariance + nav.size * e + e]
            memory[innovation + 1] = variance + nav.position_variance
        if speed:
            first = min(first, now - nav.velocity_delay)
            then, k = slot(nav, now - nav.velocity_delay), nav.velocity + axis
            own = then.measured + MEASURED * axis
            memory[own + V] = seen[k] * nav.scale[k] - memory[own + REFERENCE]
            memory[own + HAS_V] = 1.0
    run_on(nav, memory, first, now, change, work)
    at = slot(nav, now)
    for i in range(nav.size):
        estimate[i] = memory[at.post + i]


def covariance(nav: Navigation, memory: Array) -> Array:
    """Covariance of what is estimated of a batch, (batch, size, size)."""
    rows = []
    for own in memory:
        first = slot(nav, int(own[COUNT])).post_covariance
        rows.append(own[first : first + nav.size**2].reshape(nav.size, nav.size))
    return np.stack(rows)


def memory_size(nav: Navigation) -> int:
    """How many numbers `navigate` keeps of a robot."""
    return 1 + 2 * nav.axes + nav.slots * slot_size(nav.axes, nav.size)
