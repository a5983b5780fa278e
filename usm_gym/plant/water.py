"""How the water moves: a mean velocity and sinusoids, in any block of robots."""

from __future__ import annotations

from typing import NamedTuple

from usm_gym.kernels.compile import piece, shared
from usm_gym.kernels.elementary import sincos
from usm_gym.kernels.lanes import load, store

# A slow current, and waves.
MAX_SINUSOIDS = 5


@shared
def sinusoid_rows(axes: int) -> int:
    """Rows of a sinusoid: amplitude and phase by axis, and the frequency."""
    return 2 * axes + 1


class WaterRows(NamedTuple):
    """Where a block keeps its water, whose velocity has `axes` components.

    Attributes:
        axes: Axes of the water's velocity.
        clock: Physics steps since the start.
        velocity: Velocity of the water.
        acceleration: Its acceleration.
        mean: The constant part of the velocity.
        sinusoid: Its sinusoids, amplitude * sin(frequency * t + phase), one after the other:
            amplitudes by axis, phases by axis, frequency.
    """

    axes: int
    clock: int
    velocity: int
    acceleration: int
    mean: int
    sinusoid: int


@piece
def move_water(block, like, rows, sinusoids, h, lead):
    """Velocity and acceleration of the water where forces are taken, `lead` into the step."""
    time = load(block, rows.clock, like) * h + lead
    for axis in range(rows.axes):
        velocity, acceleration = load(block, rows.mean + axis, like), like
        for k in range(sinusoids):
            row = rows.sinusoid + k * sinusoid_rows(rows.axes)
            frequency = load(block, row + 2 * rows.axes, like)
            amplitude = load(block, row + axis, like)
            s, c = sincos(frequency * time + load(block, row + rows.axes + axis, like))
            velocity += amplitude * s
            acceleration += amplitude * (frequency * c)
        store(block, rows.velocity + axis, velocity)
        store(block, rows.acceleration + axis, acceleration)
