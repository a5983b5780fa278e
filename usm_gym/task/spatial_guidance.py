"""What the spatial robot is asked to do: a path in space, and an attitude on it."""

from __future__ import annotations

from math import sqrt

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import arctan, sincos
from usm_gym.plant.spatial.rotation import product
from usm_gym.task.guidance import line_of_sight, path_time, to_and_fro

# Rows of a block beside those of the body: the path, and what the line of sight aims at.
SPEED, SWAY, SWAY_FREQUENCY, HEAVE, HEAVE_FREQUENCY, RAMP, LOOK_AHEAD, CROSS_TRACK = range(8)
GUIDANCE_ROWS = 8


@piece
def path_in_space(t, speed, sway, sway_frequency, heave, heave_frequency, ramp):
    """Position, velocity and acceleration of the reference at time t, three triples.

    It is p = (v s, A sin(w_A s), B sin(w_B s)), s = s(t) as in the plane.
    """
    s, s_dot, s_ddot = path_time(t, ramp)
    y, y_dot, y_ddot = to_and_fro(s, s_dot, s_ddot, sway, sway_frequency)
    z, z_dot, z_ddot = to_and_fro(s, s_dot, s_ddot, heave, heave_frequency)
    return (
        (speed * s, y, z),
        (speed * s_dot, y_dot, z_dot),
        (speed * s_ddot, y_ddot, z_ddot),
    )


@compiled
def space_positions(times, speed, sway, sway_frequency, heave, heave_frequency, ramp, positions):
    """Fill in the reference of the position, m, (k, 3), at times (k,)."""
    for k in range(times.size):
        p, _, _ = path_in_space(times[k], speed, sway, sway_frequency, heave, heave_frequency, ramp)
        for axis in range(3):
            positions[k, axis] = p[axis]


@piece
def sight_in_space(y, z, look_ahead):
    """Pitch and yaw that aim at the path `look_ahead` ahead, rad; 0 without such a distance.

    The yaw is the line of sight in the plane; positive pitch lowers the head.
    """
    return -line_of_sight(z, look_ahead), line_of_sight(y, look_ahead)


@piece
def sight_rates(y, z, y_dot, z_dot, look_ahead):
    """Rates of `sight_in_space`, rad/s, for distances that change by y_dot and z_dot, m/s."""
    if look_ahead == 0.0:
        return 0.0, 0.0
    square = look_ahead * look_ahead
    return z_dot * look_ahead / (square + z * z), -y_dot * look_ahead / (square + y * y)


@piece
def attitude_error(q, pitch, yaw):
    """How far an attitude is from a yaw and then a pitch, without roll: a rotation vector, rad.

    It is 2 atan2(|e|, w) e / |e| of the quaternion (w, e) of what turns the reference into the
    attitude, the one of the two with w >= 0, so that nothing unwinds; in the axes of the body.
    """
    s_z, c_z = sincos(0.5 * yaw)
    s_y, c_y = sincos(0.5 * pitch)
    back = product((c_y, 0.0, -s_y, 0.0), (c_z, 0.0, 0.0, -s_z))
    w, x, y, z = product(back, q)
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    size = sqrt(x * x + y * y + z * z)
    # At half a turn w is 0; without any turn the limit is 2.
    scale = 2.0 * arctan(size / max(w, 1e-30)) / size if size > 1e-12 else 2.0
    return scale * x, scale * y, scale * z
