"""Rotations: quaternions (w, x, y, z), which take body axes to global ones, and turns about z.

Vectors are triples. A quaternion is of unit length up to rounding.
"""

from __future__ import annotations

from usm_gym.kernels.compile import piece


@piece
def product(p, q):
    """The quaternion of the rotation q, then p."""
    return (
        p[0] * q[0] - (p[1] * q[1] + p[2] * q[2] + p[3] * q[3]),
        p[0] * q[1] + p[1] * q[0] + (p[2] * q[3] - p[3] * q[2]),
        p[0] * q[2] + p[2] * q[0] + (p[3] * q[1] - p[1] * q[3]),
        p[0] * q[3] + p[3] * q[0] + (p[1] * q[2] - p[2] * q[1]),
    )


@piece
def turned(q, omega, time):
    """The attitude after turning for some time at a rate omega, rad/s, in body axes.

    Both half-angle functions are series, whose first terms left out are below rounding for turns of
    less than 0.1 rad; one step of Newton's method keeps the length at 1.
    """
    half = 0.5 * time
    x, y, z = half * omega[0], half * omega[1], half * omega[2]
    square = x * x + y * y + z * z
    c = 1.0 - square * (
        1.0 / 2.0 - square * (1.0 / 24.0 - square * (1.0 / 720.0 - square / 40320.0))
    )
    s = 1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0 - square * (1.0 / 5040.0)))
    p = product(q, (c, s * x, s * y, s * z))
    length = p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]
    scale = 1.5 - 0.5 * length
    return scale * p[0], scale * p[1], scale * p[2], scale * p[3]


@piece
def axes_of(q):
    """The body's x, y and z axis in global axes, three triples."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


@piece
def into(axes, u):
    """Components of a vector along three axes."""
    a, b, c = axes
    return (
        a[0] * u[0] + a[1] * u[1] + a[2] * u[2],
        b[0] * u[0] + b[1] * u[1] + b[2] * u[2],
        c[0] * u[0] + c[1] * u[1] + c[2] * u[2],
    )


@piece
def out_of(axes, u):
    """The vector whose components along three axes are given."""
    a, b, c = axes
    return (
        a[0] * u[0] + b[0] * u[1] + c[0] * u[2],
        a[1] * u[0] + b[1] * u[1] + c[1] * u[2],
        a[2] * u[0] + b[2] * u[1] + c[2] * u[2],
    )


@piece
def cross(u, v):
    """U x v."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@piece
def plus(u, v):
    """U + v."""
    return u[0] + v[0], u[1] + v[1], u[2] + v[2]


@piece
def about_z(s, c, u):
    """A vector turned about z by the angle of sine s and cosine c."""
    return c * u[0] - s * u[1], s * u[0] + c * u[1], u[2]


@piece
def at_distance(d, omega, v):
    """Velocity of the point d further along x than one of velocity v; so for accelerations."""
    return v[0], v[1] + d * omega[2], v[2] - d * omega[1]
