"""What the head is asked to do: to go to a figure, which is three sinusoids, and to trace it."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import sincos
from usm_gym.support.validation import Number, validated
from usm_gym.task.base_scenario import Time

Place = Annotated[Number, Field(ge=-100, le=100)]
Places = tuple[Place, Place, Place]

# What follows a path: in the plane the position of the head and its direction, in space its
# position.
CHANNELS = 3
# Rows of a path in a block: five numbers of each channel, then the time in which the head goes from
# where it starts to the figure, s.
START, CENTRE, AMPLITUDE, FREQUENCY, PHASE = range(5)
CHANNEL_ROWS = 5
RAMP = CHANNELS * CHANNEL_ROWS
PATH_ROWS = RAMP + 1


@piece
def approach(t, ramp):
    """How much of the way from the start to the figure has been made, with two derivatives.

    It is of minimum jerk: s = u^3 (10 - 15 u + 6 u^2), u = t / ramp.
    """
    if t >= ramp:
        return 1.0, 0.0, 0.0
    u = t / ramp
    left = 1.0 - u
    return (
        u * u * u * (10.0 - 15.0 * u + 6.0 * u * u),
        30.0 * u * u * left * left / ramp,
        60.0 * u * left * (1.0 - 2.0 * u) / (ramp * ramp),
    )


@piece
def traced(t, start, centre, amplitude, frequency, phase, ramp):
    """One channel of the reference at time t, with its first and second derivative.

    It is start + s (figure - start), the figure being centre + amplitude sin(frequency t + phase).
    """
    s, s_dot, s_ddot = approach(t, ramp)
    sine, cosine = sincos(frequency * t + phase)
    away = centre + amplitude * sine - start
    away_dot = amplitude * frequency * cosine
    away_ddot = -amplitude * frequency * frequency * sine
    return (
        start + s * away,
        s_dot * away + s * away_dot,
        s_ddot * away + 2.0 * s_dot * away_dot + s * away_ddot,
    )


@compiled
def trace(times, channels, ramp, references):
    """Fill in the reference, (k, 3), at times (k,), from the numbers of its channels."""
    for c in range(CHANNELS):
        start, centre, amplitude, frequency, phase = channels[c]
        for k in range(times.size):
            p, _, _ = traced(times[k], start, centre, amplitude, frequency, phase, ramp)
            references[k, c] = p


@validated
class HeadPath:
    """The figure that the head traces: centre + amplitudes sin(frequencies t + phases).

    Its three numbers are x and y, m, from where the centre of mass starts, and the direction of the
    head, rad, in the plane; x, y and z in space. Equal frequencies make circles and lines, others
    Lissajous figures, such as scans along a wall; amplitudes of 0 are a point to be held.

    Attributes:
        centre: Centre of the figure, -100 to 100.
        amplitudes: Its amplitudes, -100 to 100.
        frequencies: Their angular frequencies, -100 to 100 rad/s.
        phases: Their phases at the start, -100 to 100 rad.
        ramp: Time in which the head goes from where it starts to the figure, 0 to 3600 s.
    """

    centre: Places
    amplitudes: Places = (0.0, 0.0, 0.0)
    frequencies: Places = (0.0, 0.0, 0.0)
    phases: Places = (0.0, 0.0, 0.0)
    ramp: Time = 6.0

    def channels(self, start: NDArray[np.float64]) -> NDArray[np.float64]:
        """What kernels take of it, given where the head starts, (3, `CHANNEL_ROWS`)."""
        numbers = (start, self.centre, self.amplitudes, self.frequencies, self.phases)
        return np.array(numbers, np.float64).T.copy()

    def at(self, times: NDArray[Any], start: NDArray[np.float64]) -> NDArray[np.float64]:
        """The reference at some times, s, (k,), given where the head starts, (k, 3)."""
        references = np.empty((len(times), CHANNELS))
        trace(times, self.channels(start), self.ramp, references)
        return references
