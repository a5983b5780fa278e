"""What the robot is asked to do: the path of its centre of mass, and the heading on it."""

from __future__ import annotations

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import arctan, sincos

# Rows of a block beside those of the body: the path, and guidance, which is what the heading is and
# what the line of sight aims at.
SPEED, SWAY, FREQUENCY, RAMP, LOOK_AHEAD, CROSS_TRACK, HEAD_HEADING = range(7)
GUIDANCE_ROWS = 7


@piece
def path_time(t, ramp):
    """Path time s at time t, with its first and second derivative.

    It starts from rest: s = t^2 / (2 ramp) up to t = ramp, then t - ramp / 2.
    """
    if t < ramp:
        return 0.5 * t * t / ramp, t / ramp, 1.0 / ramp
    return t - 0.5 * ramp, 1.0, 0.0


@piece
def to_and_fro(s, s_dot, s_ddot, amplitude, frequency):
    """Amplitude * sin(frequency * s) at path time s, with its first and second derivative."""
    sine, cosine = sincos(frequency * s)
    slope = amplitude * frequency
    return (
        amplitude * sine,
        slope * cosine * s_dot,
        slope * (cosine * s_ddot - frequency * sine * (s_dot * s_dot)),
    )


@piece
def path(t, speed, sway, frequency, ramp):
    """The reference (p_x, p_y, v_x, v_y, a_x, a_y) at time t: p = (v s, A sin(w s)), s = s(t)."""
    s, s_dot, s_ddot = path_time(t, ramp)
    y, y_dot, y_ddot = to_and_fro(s, s_dot, s_ddot, sway, frequency)
    return speed * s, y, speed * s_dot, y_dot, speed * s_ddot, y_ddot


@compiled
def path_positions(times, speed, sway, frequency, ramp, positions):
    """Fill in the reference of the position, m, (k, 2), at times (k,)."""
    for k in range(times.size):
        p_x, p_y, _, _, _, _ = path(times[k], speed, sway, frequency, ramp)
        positions[k, 0] = p_x
        positions[k, 1] = p_y


@piece
def line_of_sight(distance, look_ahead):
    """Heading reference -atan(distance / look_ahead), rad (section 5.1.1); 0 without a distance."""
    return -arctan(distance / look_ahead) if look_ahead > 0.0 else 0.0
