"""Where the links are, one robot at a time: for what measures, allocates and draws."""

from __future__ import annotations

from usm_gym.kernels.compile import piece
from usm_gym.kernels.elementary import sincos
from usm_gym.plant.spatial.layout import *
from usm_gym.plant.spatial.rotation import axes_of, cross, product


@piece
def place_link(plant, j, inner, outer, side, phi, q, centre, frame):
    """Place the link beyond joint j from the one before it.

    Args:
        plant: What all robots share.
        j: The joint.
        inner: The link before it.
        outer: The link beyond it.
        side: 1.0 towards the head, -1.0 towards the tail.
        phi: Angle of the joint, rad.
        q: Attitude of the inner link.
        centre: Middles of the links, m, (links, 3); that of the outer is written.
        frame: Their axes in global axes, (links, 9): x, y, z; those of the outer are written.

    Returns:
        Attitude of the outer link.
    """
    s, c = sincos(0.5 * (side * phi))
    axis = plant.axes[j]
    q = product(q, (c, s * axis[0], s * axis[1], s * axis[2]))
    x, y, z = axes_of(q)
    near, far = side * plant.constants[HALF, inner], side * plant.constants[HALF, outer]
    for k in range(3):
        frame[outer, k], frame[outer, 3 + k], frame[outer, 6 + k] = x[k], y[k], z[k]
        centre[outer, k] = centre[inner, k] + near * frame[inner, k] + far * x[k]
    return q


@piece
def place_links(plant, root, q, phi, centre, frame):
    """Place all links: where the root's middle is, its attitude, and the joint angles, (joints,).

    Other arguments as of `place_link`; all middles and axes are written.
    """
    x, y, z = axes_of(q)
    middle = plant.root
    for k in range(3):
        centre[middle, k] = root[k]
        frame[middle, k], frame[middle, 3 + k], frame[middle, 6 + k] = x[k], y[k], z[k]
    tail, head = q, q
    for j in range(middle, plant.links - 1):
        head = place_link(plant, j, j, j + 1, 1.0, phi[j], head, centre, frame)
    for j in range(middle - 1, -1, -1):
        tail = place_link(plant, j, j + 1, j, -1.0, phi[j], tail, centre, frame)


@piece
def centre_of_mass(plant, centre, frame):
    """The centre of mass, m, from what `place_links` has written."""
    total, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i in range(plant.links):
        mass, first = plant.constants[MASS, i], plant.constants[FIRST_MOMENT, i]
        total += mass
        x += mass * centre[i, 0] + first * frame[i, 6]
        y += mass * centre[i, 1] + first * frame[i, 7]
        z += mass * centre[i, 2] + first * frame[i, 8]
    return x / total, y / total, z / total


@piece
def add_momentum(plant, i, omega, v, frame, momentum):
    """Add the momentum of the solid link i, kg m/s, to (3,)."""
    mass, first = plant.constants[MASS, i], plant.constants[FIRST_MOMENT, i]
    turning = cross(omega, (frame[i, 6], frame[i, 7], frame[i, 8]))
    for k in range(3):
        momentum[k] += mass * v[k] + first * turning[k]


@piece
def velocity_beyond(plant, j, inner, outer, side, rate, omega, v, frame):
    """Angular velocity and velocity of the middle of the link beyond joint j, in global axes."""
    near, far = side * plant.constants[HALF, inner], side * plant.constants[HALF, outer]
    turning = cross(omega, (frame[inner, 0], frame[inner, 1], frame[inner, 2]))
    v = v[0] + near * turning[0], v[1] + near * turning[1], v[2] + near * turning[2]
    a, rate = plant.axes[j], side * rate
    omega = (
        omega[0]
        + rate * (a[0] * frame[inner, 0] + a[1] * frame[inner, 3] + a[2] * frame[inner, 6]),
        omega[1]
        + rate * (a[0] * frame[inner, 1] + a[1] * frame[inner, 4] + a[2] * frame[inner, 7]),
        omega[2]
        + rate * (a[0] * frame[inner, 2] + a[1] * frame[inner, 5] + a[2] * frame[inner, 8]),
    )
    turning = cross(omega, (frame[outer, 0], frame[outer, 1], frame[outer, 2]))
    return omega, (v[0] + far * turning[0], v[1] + far * turning[1], v[2] + far * turning[2])


@piece
def mass_velocity(plant, omega, v, rates, frame, momentum):
    """Fill in the velocity of the centre of mass, m/s, (3,).

    Args:
        plant: What all robots share.
        omega: Angular velocity of the root in global axes, rad/s.
        v: Velocity of its middle, m/s.
        rates: Rates of the joints, rad/s, (joints,).
        frame: What `place_links` has written.
        momentum: Where to write.
    """
    momentum[:] = 0.0
    middle, total = plant.root, 0.0
    add_momentum(plant, middle, omega, v, frame, momentum)
    turning, moving = omega, v
    for j in range(middle, plant.links - 1):
        turning, moving = velocity_beyond(plant, j, j, j + 1, 1.0, rates[j], turning, moving, frame)
        add_momentum(plant, j + 1, turning, moving, frame, momentum)
    turning, moving = omega, v
    for j in range(middle - 1, -1, -1):
        turning, moving = velocity_beyond(
            plant, j, j + 1, j, -1.0, rates[j], turning, moving, frame
        )
        add_momentum(plant, j, turning, moving, frame, momentum)
    for i in range(plant.links):
        total += plant.constants[MASS, i]
    for k in range(3):
        momentum[k] /= total
