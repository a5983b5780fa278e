"""Links by themselves: where they are and how they move, and what they answer to accelerations.

docs/model_spatial.md derives what stands here; `like`, `wide` and `stride` are as in `plant.chain`.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import piece
from usm_gym.kernels.elementary import sincos
from usm_gym.kernels.lanes import block_at, load, spread, store
from usm_gym.plant.spatial.joint_axes import vectors_from_joint, vectors_to_joint
from usm_gym.plant.spatial.layout import *
from usm_gym.plant.spatial.rotation import (
    about_z,
    at_distance,
    axes_of,
    cross,
    into,
    plus,
    turned,
)

# Gauss-Legendre quadrature by five points: places in half lengths, and half the weights.
_NEAR, _FAR = 0.53846931010568309104, 0.90617984593866399280
POINTS = (-_FAR, -_NEAR, 0.0, _NEAR, _FAR)
_MIDDLE, _INNER, _OUTER = 64.0 / 225.0, 0.23931433524968323402, 0.11846344252809454376
WEIGHTS = (_OUTER, _INNER, _MIDDLE, _INNER, _OUTER)
# A square of a speed, (m/s)^2, that keeps the root away from 0.
SMALLEST_SQUARE = 1e-24


class SpatialPlant(NamedTuple):
    """What all robots of a fleet share.

    Attributes:
        links: Number of links.
        root: The middle link, from 0.
        constants: Constants by `layout` and link, (constants, padded links).
        kinds: Which way the axes of the joints point, by `layout`, int64, (joints,).
        axes: Axes of the joints in link axes, (joints, 3).
        frames: Of every joint three axes of which the third is its own, (joints, 9).
        thrusters: Number of thrusters.
        thruster_places: What thrusters push with, see `step.push`: thruster and first row of a
            number of a link, int64, (entries, 2).
        thruster_shares: That number over the force, (entries,).
        gravity: Acceleration of gravity, m/s^2.
        lead: How far into a step forces are taken, s: half of it, or 0 for Euler's forward method.
        h: Physics step, s.
        substeps: Physics steps in a control period.
        shifts: Largest number of changes of the joint references in any episode.
        sinusoids: Largest number of sinusoids in the water's velocity in any episode.
        steering: How a policy steers the joints, if it does: this and what follows as in
            `plant.steering.Steering`.
    """

    links: int
    root: int
    constants: NDArray[np.float64]
    kinds: NDArray[np.int64]
    axes: NDArray[np.float64]
    frames: NDArray[np.float64]
    thrusters: int
    thruster_places: NDArray[np.int64]
    thruster_shares: NDArray[np.float64]
    gravity: float
    lead: float
    h: float
    substeps: int
    shifts: int
    sinusoids: int
    steering: int
    joint_time_constant: float
    joint_decay: float
    joint_rate_limit: float
    joint_angle_limit: float


@piece
def constant(plant, quantity, i, wide, stride):
    """A constant of link i, or of it and those that follow; the same for all robots."""
    row = block_at(plant.constants, quantity, 0.0)
    return load(row, i, wide) if stride > 1 else spread(load(row, i, 0.0))


@piece
def scalar(plant, quantity, i):
    """A constant of link i as a number."""
    return plant.constants[quantity, i]


@piece
def load_vector(block, quantity, i, links, like):
    """Three numbers of link i."""
    rows, row = stride_of(links), row_of(quantity, links) + i
    return (
        load(block, row, like),
        load(block, row + rows, like),
        load(block, row + 2 * rows, like),
    )


@piece
def store_vector(block, quantity, i, links, u):
    """Three numbers of link i."""
    rows, row = stride_of(links), row_of(quantity, links) + i
    store(block, row, u[0])
    store(block, row + rows, u[1])
    store(block, row + 2 * rows, u[2])


@piece
def load_base(block, row, like):
    """Three numbers of the header."""
    return load(block, row, like), load(block, row + 1, like), load(block, row + 2, like)


@piece
def store_base(block, row, u):
    """Three numbers of the header."""
    for k in range(3):
        store(block, row + k, u[k])


@piece
def load_attitude(block, like):
    """Attitude of the root link."""
    return (
        load(block, Q, like),
        load(block, Q + 1, like),
        load(block, Q + 2, like),
        load(block, Q + 3, like),
    )


@piece
def joint_motion(block, wide, stride, plant):
    """Outward angles and rates of the joints where forces are taken, `lead` into the step."""
    links, lead = plant.links, plant.lead
    for j in range(0, links - 1, stride):
        side = constant(plant, SIDE, j, wide, stride)
        rate = load(block, row_of(PHI_DOT, links) + j, wide)
        s, c = sincos(load(block, row_of(PHI, links) + j, wide) + lead * rate)
        rate += lead * load(block, row_of(PHI_DDOT, links) + j, wide)
        store(block, row_of(SIN, links) + j, side * s)
        store(block, row_of(COS, links) + j, c)
        store(block, row_of(RATE, links) + j, side * rate)


@piece
def root_motion(block, like, plant):
    """How the root link moves, `lead` into the step.

    Returns:
        Its axes, and (angular velocity, velocity of its middle relative to the water, effective
        gravity) in these. In water that accelerates all is as if gravity were less.
    """
    lead = plant.lead
    axes = axes_of(turned(load_attitude(block, like), load_base(block, W, like), lead))
    w, dw = load_base(block, W, like), load_base(block, DW, like)
    v, a = load_base(block, V, like), load_base(block, A, like)
    water, acceleration = load_base(block, WATER, like), load_base(block, WATER_A, like)
    omega = w[0] + lead * dw[0], w[1] + lead * dw[1], w[2] + lead * dw[2]
    through = (
        v[0] + lead * a[0] - water[0],
        v[1] + lead * a[1] - water[1],
        v[2] + lead * a[2] - water[2],
    )
    down = -acceleration[0], -acceleration[1], -acceleration[2] - plant.gravity
    return axes, (omega, into(axes, through), into(axes, down))


@piece
def store_motion(block, i, links, motion):
    """Keep how link i moves."""
    store_vector(block, OMEGA, i, links, motion[0])
    store_vector(block, VELOCITY, i, links, motion[1])
    store_vector(block, GRAVITY, i, links, motion[2])
    store_vector(block, BIAS_ALPHA, i, links, motion[3])
    store_vector(block, BIAS, i, links, motion[4])


@piece
def outward(block, like, j, outer, distance, plant, motion):
    """How the link beyond joint j moves, from how the link before it does.

    Args:
        block: The block.
        like: Zero of the type of its numbers.
        j: The joint.
        outer: The link beyond it.
        distance: Where the joint is along the link before it, from its middle, m.
        plant: What all robots share.
        motion: Angular velocity, velocity of the middle relative to the water, effective gravity,
            and the angular and linear acceleration that go with no acceleration of root and joints.

    Returns:
        The same of the outer link.
    """
    links = plant.links
    omega, v, g, alpha, a = motion
    v, a = at_distance(distance, omega, v), at_distance(distance, alpha, a)
    omega, v, g, alpha, a = vectors_to_joint(plant, j, (omega, v, g, alpha, a))
    s = -load(block, row_of(SIN, links) + j, like)
    c = load(block, row_of(COS, links) + j, like)
    rate = load(block, row_of(RATE, links) + j, like)
    omega, v = about_z(s, c, omega), about_z(s, c, v)
    alpha, a = about_z(s, c, alpha), about_z(s, c, a)
    alpha = alpha[0] + rate * omega[1], alpha[1] - rate * omega[0], alpha[2]
    a = a[0] + rate * v[1], a[1] - rate * v[0], a[2]
    omega, g = (omega[0], omega[1], omega[2] + rate), about_z(s, c, g)
    omega, v, g, alpha, a = vectors_from_joint(plant, j, (omega, v, g, alpha, a))
    back = -scalar(plant, REACH, outer)
    moved = (omega, at_distance(back, omega, v), g, alpha, at_distance(back, alpha, a))
    store_motion(block, outer, links, moved)
    return moved


@piece
def kinematics(block, like, wide, stride, plant):
    """How every link moves where forces are taken; returns the axes of the root."""
    links, root = plant.links, plant.root
    joint_motion(block, wide, stride, plant)
    axes, (omega, v, g) = root_motion(block, like, plant)
    still = (like, like, like)
    start = (omega, v, g, still, still)
    store_motion(block, root, links, start)
    for side in range(2):
        motion, way = start, 2 * side - 1
        distance, i = way * scalar(plant, HALF, root), root + way
        while 0 <= i < links:
            motion = outward(block, like, i - side, i, distance, plant, motion)
            distance, i = -scalar(plant, REACH, i), i + way
    return axes


@piece
def cross_flow(v, w, omega_y, omega_z, half, linear, quadratic):
    """Drag over cross-flow velocity, by five strips: its sum, first and second moment."""
    k_0, k_1, k_2 = 0.0 * v, 0.0 * v, 0.0 * v
    for point in range(5):
        x = POINTS[point] * half
        across, up = v + x * omega_z, w - x * omega_y
        speed = sqrt(across * across + up * up + SMALLEST_SQUARE)
        k = WEIGHTS[point] * (linear + quadratic * speed)
        by_x = k * x
        k_0, k_1, k_2 = k_0 + k, k_1 + by_x, k_2 + by_x * x
    return k_0, k_1, k_2


@piece
def own_answers(block, like, wide, stride, plant):
    """Every link's own answer to an acceleration of its point towards the root (root: its middle).

    To the angular acceleration `alpha` and the linear acceleration `a` of that point, relative to
    the water, by components in link axes and beyond those that are there anyway (BIAS), it is the
    moment n - J alpha - H a and the force f - H^T alpha - M a. OWN has J_xx, J_yy, J_zz, H_zy,
    M_xx, M_yy, n, f. J_xz and H_yx = -H_xy follow from constants, H_yz = -H_zy, M_zz = M_yy, and
    the rest is 0.
    """
    rows, own = stride_of(plant.links), row_of(OWN, plant.links)
    for i in range(0, plant.links, stride):
        answer = own_answer(block, like, wide, stride, plant, i)
        for k in range(12):
            store(block, own + k * rows + i, answer[k])


@piece
def drag(block, like, wide, stride, plant, i, omega, v):
    """Drag of a link over its velocity: along it, in roll, and `cross_flow`."""
    factor = load(block, row_of(FACTOR, plant.links) + i, wide)
    linear = factor * load(block, LINEAR, like)
    surge = factor * load(block, SURGE, like) * constant(plant, SURGE_AREA, i, wide, stride)
    roll = factor * load(block, ROLL, like) * constant(plant, ROLL_VOLUME, i, wide, stride)
    along = linear * constant(plant, LINEAR_X, i, wide, stride) + surge * abs(v[0])
    turning = linear * constant(plant, LINEAR_ROLL, i, wide, stride) + roll * abs(omega[0])
    strip, half = constant(plant, STRIP, i, wide, stride), constant(plant, HALF, i, wide, stride)
    across = factor * load(block, CROSS_FLOW, like) * strip
    k_0, k_1, k_2 = cross_flow(v[1], v[2], omega[1], omega[2], half, linear * strip, across)
    return along, turning, k_0, k_1, k_2


@piece
def later(v, lead, a, b):
    """Return v + lead (a - b)."""
    return v[0] + lead * (a[0] - b[0]), v[1] + lead * (a[1] - b[1]), v[2] + lead * (a[2] - b[2])


@piece
def inertia(block, like, wide, stride, plant, i):
    """Of link i with its water: mass along and across, first moment, inertia about x, y, z."""
    factor = load(block, row_of(FACTOR, plant.links) + i, wide)
    across = factor * load(block, ADDED_ACROSS, like)
    mass = constant(plant, MASS, i, wide, stride)
    water = constant(plant, ADDED_MASS, i, wide, stride)
    added = across * constant(plant, ADDED_INERTIA, i, wide, stride)
    return (
        mass + factor * load(block, ADDED_ALONG, like) * water,
        mass + across * water,
        constant(plant, FIRST_MOMENT, i, wide, stride),
        constant(plant, INERTIA_X, i, wide, stride),
        constant(plant, INERTIA_Y, i, wide, stride) + added,
        constant(plant, INERTIA_Z, i, wide, stride) + added,
    )


@piece
def momenta(body, omega, v):
    """Momentum and angular momentum about the middle, `body` being what `inertia` returns."""
    m_x, m_y, s, J_x, J_y, J_z = body
    return (
        (m_x * v[0] + s * omega[1], m_y * v[1] - s * omega[0], m_y * v[2]),
        (J_x * omega[0] - s * v[1], J_y * omega[1] + s * v[0], J_z * omega[2]),
    )


@piece
def own_answer(block, like, wide, stride, plant, i):
    """The answer of link i; see `own_answers`.

    Drag is that at the velocity to which the link's new acceleration leads, in place of that of the
    step before, its factor being taken before: it joins the inertia.
    """
    links, lead = plant.links, plant.lead
    omega = load_vector(block, OMEGA, i, links, wide)
    v = load_vector(block, VELOCITY, i, links, wide)
    g = load_vector(block, GRAVITY, i, links, wide)
    d_alpha = load_vector(block, BIAS_ALPHA, i, links, wide)
    d_a = load_vector(block, BIAS, i, links, wide)
    along, turning, k_0, k_1, k_2 = drag(block, like, wide, stride, plant, i, omega, v)
    body = inertia(block, like, wide, stride, plant, i)
    m_x, m_y, s, J_x, J_y, J_z = body
    # By what the momenta change on their own.
    p, h = momenta(body, omega, v)
    p_dot, h_dot = momenta(body, d_alpha, d_a)
    p_dot = plus(p_dot, cross(omega, p))
    h_dot = plus(h_dot, plus(cross(omega, h), cross(v, p)))
    # The velocity against which drag acts, less what the acceleration in question adds to it.
    o = later(omega, lead, d_alpha, load_vector(block, ALPHA, i, links, wide))
    u = later(v, lead, d_a, load_vector(block, LINK_A, i, links, wide))
    push = load_vector(block, PUSH, i, links, wide)
    twist = load_vector(block, PUSH + 3, i, links, wide)
    heavy = constant(plant, EXCESS, i, wide, stride)
    f_x = (push[0] + heavy * g[0]) - p_dot[0] - along * u[0]
    f_y = (push[1] + heavy * g[1]) - p_dot[1] - (k_0 * u[1] + k_1 * o[2])
    f_z = (push[2] + heavy * g[2]) - p_dot[2] - (k_0 * u[2] - k_1 * o[1])
    n_x = (twist[0] - s * g[1]) - h_dot[0] - turning * o[0]
    n_y = (twist[1] + s * g[0]) - h_dot[1] + (k_1 * u[2] - k_2 * o[1])
    n_z = twist[2] - h_dot[2] - (k_1 * u[1] + k_2 * o[2])
    # To the point towards the root.
    e = constant(plant, REACH, i, wide, stride)
    m_x, m_y, k_1, k_2 = m_x + lead * along, m_y + lead * k_0, lead * k_1, lead * k_2
    q = k_1 - e * m_y
    moved = e * (k_1 + q)
    J_x, J_y, J_z = J_x + lead * turning, (J_y + k_2) - moved, (J_z + k_2) - moved
    return J_x, J_y, J_z, q, m_x, m_y, n_x, n_y + e * f_z, n_z - e * f_y, f_x, f_y, f_z
