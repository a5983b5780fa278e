"""What the robot is asked to do: the path of the centre of mass, joint references, the heading."""

from __future__ import annotations

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import arctan, exp_of_negative, sincos


@piece
def path(t, speed, sway, frequency, ramp):
    """The reference (p_x, p_y, v_x, v_y, a_x, a_y) at time t: p = (v s, A sin(w s)), s = s(t).

    Path time s starts from rest: s = t^2 / (2 ramp) up to t = ramp, then t - ramp / 2.
    """
    s, s_dot, s_ddot = t - 0.5 * ramp, 1.0, 0.0
    if t < ramp:
        s, s_dot, s_ddot = 0.5 * t * t / ramp, t / ramp, 1.0 / ramp
    sine, cosine = sincos(frequency * s)
    slope = sway * frequency
    return (
        speed * s,
        sway * sine,
        speed * s_dot,
        slope * cosine * s_dot,
        speed * s_ddot,
        slope * (cosine * s_ddot - frequency * sine * (s_dot * s_dot)),
    )


@compiled
def path_positions(times, speed, sway, frequency, ramp, positions):
    """Fill in the reference of the position, m, (k, 2), at times (k,)."""
    for k in range(times.size):
        p_x, p_y, _, _, _, _ = path(times[k], speed, sway, frequency, ramp)
        positions[k, 0] = p_x
        positions[k, 1] = p_y


@compiled
def filter_coefficients(frequency, step):
    """The critically damped filter x'' = w^2 (target - x) - 2 w x' over one physics step, exactly.

    Args:
        frequency: w, rad/s; 0 for no filter, the reference then being the target itself.
        step: Physics step, s.

    Returns:
        (x from x, x from x', x' from x, x' from x', w^2, 2 w), x measured from the target; all
        zero without a filter.
    """
    if frequency == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    wh = frequency * step
    decay = exp_of_negative(-wh)
    return (
        decay * (1.0 + wh),
        decay * step,
        -decay * frequency * wh,
        decay * (1.0 - wh),
        frequency * frequency,
        2.0 * frequency,
    )


@compiled
def lag_share(time_constant, step):
    """Share of the way to its command that a thruster covers in a physics step, 1 - e^(-h/tau)."""
    if time_constant == 0.0:
        return 1.0
    return 1.0 - exp_of_negative(-step / time_constant)


@piece
def line_of_sight(distance, look_ahead):
    """Heading reference -atan(distance / look_ahead), rad (section 5.1.1); 0 without a distance."""
    return -arctan(distance / look_ahead) if look_ahead > 0.0 else 0.0
