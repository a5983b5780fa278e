"""Forward dynamics of the spatial chain in O(links); docs/model_spatial.md derives it.

As in `plant.chain`: first every link's own answer, then both halves of the chain are eliminated
from their free ends towards the root link in the middle, the root is solved, and the accelerations
are substituted back towards the ends.

An answer is (J, H, M, n, f): to an angular acceleration alpha and a linear one a of a point it is
the moment n - J alpha - H a and the force f - H^T alpha - M a. J and M are symmetric, by
xx, xy, xz, yy, yz, zz; H is given row by row. This is the articulated body of R. Featherstone,
Rigid Body Dynamics Algorithms, 2008, chapter 7, with two 3-vectors in place of one of six.
"""

from __future__ import annotations

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.lanes import WIDTH, block_at, load, spread, store
from usm_gym.plant.spatial.joint_axes import (
    answer_from_joint,
    answer_to_joint,
    pair_from_joint,
    pair_to_joint,
)
from usm_gym.plant.spatial.layout import *
from usm_gym.plant.spatial.links import (
    kinematics,
    load_base,
    load_vector,
    own_answers,
    scalar,
    store_base,
    store_vector,
)
from usm_gym.plant.spatial.rotation import about_z, at_distance, cross, out_of, plus


@piece
def with_own(block, like, i, plant, answer):
    """The sum of an answer and link i's own."""
    rows, own = stride_of(plant.links), row_of(OWN, plant.links) + i
    J, H, M, n, f = answer
    s = scalar(plant, FIRST_MOMENT, i)
    q = load(block, own + 3 * rows, like)
    m_y = load(block, own + 5 * rows, like)
    return (
        (
            J[0] + load(block, own, like),
            J[1],
            J[2] + s * scalar(plant, REACH, i),
            J[3] + load(block, own + rows, like),
            J[4],
            J[5] + load(block, own + 2 * rows, like),
        ),
        (H[0], H[1] - s, H[2], H[3] + s, H[4], H[5] - q, H[6], H[7] + q, H[8]),
        (M[0] + load(block, own + 4 * rows, like), M[1], M[2], M[3] + m_y, M[4], M[5] + m_y),
        plus(n, load_vector(block, OWN + 6, i, plant.links, like)),
        plus(f, load_vector(block, OWN + 9, i, plant.links, like)),
    )


@piece
def moved(d, answer):
    """An answer, given at a point, at the point that lies d further back along x."""
    J, H, M, n, f = answer
    y = H[3] - d * M[2], H[4] - d * M[4], H[5] - d * M[5]
    z = H[6] + d * M[1], H[7] + d * M[3], H[8] + d * M[4]
    return (
        (
            J[0],
            J[1] - d * H[2],
            J[2] + d * H[1],
            J[3] - d * (H[5] + y[2]),
            J[4] + d * (H[4] - z[2]),
            J[5] + d * (H[7] + z[1]),
        ),
        (H[0], H[1], H[2], y[0], y[1], y[2], z[0], z[1], z[2]),
        M,
        (n[0], n[1] - d * f[2], n[2] + d * f[1]),
        f,
    )


@piece
def turned_symmetric(s, c, s_2, c_2, A):
    """A symmetric matrix turned about z; s_2 and c_2 are of the doubled angle."""
    middle, off = 0.5 * (A[0] + A[3]), 0.5 * (A[0] - A[3])
    new = c_2 * off - s_2 * A[1]
    return (
        middle + new,
        s_2 * off + c_2 * A[1],
        c * A[2] - s * A[4],
        middle - new,
        s * A[2] + c * A[4],
        A[5],
    )


@piece
def turned_matrix(s, c, s_2, c_2, A):
    """The same of a matrix that is not symmetric."""
    middle, off = 0.5 * (A[0] + A[4]), 0.5 * (A[0] - A[4])
    even, odd = 0.5 * (A[1] + A[3]), 0.5 * (A[1] - A[3])
    new, shear = c_2 * off - s_2 * even, s_2 * off + c_2 * even
    return (
        middle + new,
        shear + odd,
        c * A[2] - s * A[5],
        shear - odd,
        middle - new,
        s * A[2] + c * A[5],
        c * A[6] - s * A[7],
        s * A[6] + c * A[7],
        A[8],
    )


@piece
def without_joint(block, like, j, plant, answer):
    """An answer, in the axes of joint j, when the joint gives way; stores its back substitution.

    The torque on the outer link is u - k phi'', with k from its implicit treatment, so that
    (J_zz + k) phi'' = n_z + u - (what the rest of its motion takes): an update of rank one.
    """
    links = plant.links
    rows, sub = stride_of(links), row_of(SUB, links) + j
    k = load(block, JOINT_INERTIA, like)
    u = scalar(plant, SIDE, j) * load(block, row_of(TORQUE, links) + j, like)
    J, H, M, n, f = answer
    inverse = 1.0 / (J[5] + k)
    torque = n[2] + u
    z, x, y, kept = torque * inverse, J[2] * inverse, J[4] * inverse, k * inverse
    h_x, h_y, h_z = H[6] * inverse, H[7] * inverse, H[8] * inverse
    store(block, sub, z)
    store(block, sub + rows, x)
    store(block, sub + 2 * rows, y)
    store(block, sub + 3 * rows, J[5] * inverse)
    store(block, sub + 4 * rows, h_x)
    store(block, sub + 5 * rows, h_y)
    store(block, sub + 6 * rows, h_z)
    return (
        (
            J[0] - J[2] * x,
            J[1] - J[2] * y,
            J[2] * kept,
            J[3] - J[4] * y,
            J[4] * kept,
            J[5] * kept,
        ),
        (
            H[0] - J[2] * h_x,
            H[1] - J[2] * h_y,
            H[2] - J[2] * h_z,
            H[3] - J[4] * h_x,
            H[4] - J[4] * h_y,
            H[5] - J[4] * h_z,
            H[6] * kept,
            H[7] * kept,
            H[8] * kept,
        ),
        (
            M[0] - H[6] * h_x,
            M[1] - H[6] * h_y,
            M[2] - H[6] * h_z,
            M[3] - H[7] * h_y,
            M[4] - H[7] * h_z,
            M[5] - H[8] * h_z,
        ),
        (n[0] - J[2] * z, n[1] - J[4] * z, torque * kept - u),
        (f[0] - H[6] * z, f[1] - H[7] * z, f[2] - H[8] * z),
    )


@piece
def eliminate(block, like, i, j, distance, plant, answer):
    """Eliminate link i: the answer of all links from it outwards, for its neighbour.

    Args:
        block: The block.
        like: Zero of the type of its numbers.
        i: The link.
        j: The joint towards its neighbour.
        distance: Where the joint is along the neighbour, from the neighbour's point, m.
        plant: What all robots share.
        answer: Answer of the links beyond, at the link's point, in its axes.

    Returns:
        The answer at the neighbour's point, in its axes.
    """
    answer = with_own(block, like, i, plant, answer)
    answer = answer_to_joint(plant, j, answer)
    J, H, M, n, f = without_joint(block, like, j, plant, answer)
    s = load(block, row_of(SIN, plant.links) + j, like)
    c = load(block, row_of(COS, plant.links) + j, like)
    s_2, c_2 = 2.0 * s * c, 1.0 - 2.0 * s * s
    J, M = turned_symmetric(s, c, s_2, c_2, J), turned_symmetric(s, c, s_2, c_2, M)
    H, n, f = turned_matrix(s, c, s_2, c_2, H), about_z(s, c, n), about_z(s, c, f)
    return moved(distance, answer_from_joint(plant, j, (J, H, M, n, f)))


@piece
def inverted(A):
    """The inverse of a symmetric matrix, by cofactors."""
    a = A[3] * A[5] - A[4] * A[4]
    b = A[2] * A[4] - A[1] * A[5]
    c = A[1] * A[4] - A[2] * A[3]
    scale = 1.0 / (A[0] * a + A[1] * b + A[2] * c)
    return (
        scale * a,
        scale * b,
        scale * c,
        scale * (A[0] * A[5] - A[2] * A[2]),
        scale * (A[1] * A[2] - A[0] * A[4]),
        scale * (A[0] * A[3] - A[1] * A[1]),
    )


@piece
def symmetric_times(A, u):
    """A symmetric matrix times a vector."""
    return (
        A[0] * u[0] + A[1] * u[1] + A[2] * u[2],
        A[1] * u[0] + A[3] * u[1] + A[4] * u[2],
        A[2] * u[0] + A[4] * u[1] + A[5] * u[2],
    )


@piece
def dot(u, v):
    """U . v."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@piece
def solve_root(answer):
    """The accelerations, angular and linear, to which an answer is no moment and no force."""
    J, H, M, n, f = answer
    x, y, z = (H[0], H[1], H[2]), (H[3], H[4], H[5]), (H[6], H[7], H[8])
    W = inverted(M)
    by_x, by_y, by_z = symmetric_times(W, x), symmetric_times(W, y), symmetric_times(W, z)
    schur = (
        J[0] - dot(x, by_x),
        J[1] - dot(x, by_y),
        J[2] - dot(x, by_z),
        J[3] - dot(y, by_y),
        J[4] - dot(y, by_z),
        J[5] - dot(z, by_z),
    )
    rest = n[0] - dot(by_x, f), n[1] - dot(by_y, f), n[2] - dot(by_z, f)
    alpha = symmetric_times(inverted(schur), rest)
    free = (
        f[0] - (H[0] * alpha[0] + H[3] * alpha[1] + H[6] * alpha[2]),
        f[1] - (H[1] * alpha[0] + H[4] * alpha[1] + H[7] * alpha[2]),
        f[2] - (H[2] * alpha[0] + H[5] * alpha[1] + H[8] * alpha[2]),
    )
    return alpha, symmetric_times(W, free)


@piece
def keep_accelerations(block, like, i, plant, alpha, a):
    """Keep what link i accelerates by: that found, and what was there anyway."""
    links = plant.links
    alpha = plus(alpha, load_vector(block, BIAS_ALPHA, i, links, like))
    a = plus(a, load_vector(block, BIAS, i, links, like))
    store_vector(block, ALPHA, i, links, alpha)
    store_vector(block, LINK_A, i, links, a)


@piece
def substitute(block, like, i, j, distance, plant, motion):
    """Find the accelerations of link i, beyond joint j, from those of the link before it.

    Args:
        block: The block.
        like: Zero of the type of its numbers.
        i: The link.
        j: The joint towards the root.
        distance: Where the joint is along the link before it, from its middle, m.
        plant: What all robots share.
        motion: Angular acceleration of the link before it, and acceleration of its middle, beyond
            what is there anyway.

    Returns:
        The same of link i.
    """
    links = plant.links
    rows, sub = stride_of(links), row_of(SUB, links) + j
    s = -load(block, row_of(SIN, links) + j, like)
    c = load(block, row_of(COS, links) + j, like)
    alpha, a = motion
    alpha, a = pair_to_joint(plant, j, alpha, at_distance(distance, alpha, a))
    alpha, a = about_z(s, c, alpha), about_z(s, c, a)
    by_alpha = (
        load(block, sub + rows, like),
        load(block, sub + 2 * rows, like),
        load(block, sub + 3 * rows, like),
    )
    by_a = (
        load(block, sub + 4 * rows, like),
        load(block, sub + 5 * rows, like),
        load(block, sub + 6 * rows, like),
    )
    beyond = load(block, sub, like) - (dot(by_alpha, alpha) + dot(by_a, a))
    store(block, row_of(PHI_DDOT, links) + j, scalar(plant, SIDE, j) * beyond)
    alpha, a = pair_from_joint(plant, j, (alpha[0], alpha[1], alpha[2] + beyond), a)
    a = at_distance(-scalar(plant, REACH, i), alpha, a)
    keep_accelerations(block, like, i, plant, alpha, a)
    return alpha, a


@piece
def inward(block, like, plant):
    """Eliminate both halves; returns the answer of the whole at the root's middle."""
    root, zero = plant.root, (like, like, like)
    zeros = (like, like, like, like, like, like)
    none = (zeros, (like, like, like, like, like, like, like, like, like), zeros, zero, zero)
    whole = with_own(block, like, root, plant, none)
    for side in range(2):
        answer, way = none, 1 - 2 * side
        i = side * (plant.links - 1)
        while i != root:
            inner = i + way
            distance = -2.0 * scalar(plant, REACH, inner)
            if inner == root:
                distance = -way * scalar(plant, HALF, root)
            answer = eliminate(block, like, i, i - side, distance, plant, answer)
            i = inner
        whole = together(whole, answer)
    return whole


@piece
def together(one, other):
    """The sum of two answers."""
    J, H, M, n, f = one
    j, h, m, p, q = other
    return (
        (J[0] + j[0], J[1] + j[1], J[2] + j[2], J[3] + j[3], J[4] + j[4], J[5] + j[5]),
        (
            H[0] + h[0],
            H[1] + h[1],
            H[2] + h[2],
            H[3] + h[3],
            H[4] + h[4],
            H[5] + h[5],
            H[6] + h[6],
            H[7] + h[7],
            H[8] + h[8],
        ),
        (M[0] + m[0], M[1] + m[1], M[2] + m[2], M[3] + m[3], M[4] + m[4], M[5] + m[5]),
        plus(n, p),
        plus(f, q),
    )


@piece
def accelerate(block, like, wide, stride, axes, plant):
    """Fill in the accelerations of root, links and joints.

    `axes` are those of the root, which `kinematics` has returned.
    """
    links, root = plant.links, plant.root
    own_answers(block, like, wide, stride, plant)
    alpha, a = solve_root(inward(block, like, plant))
    keep_accelerations(block, like, root, plant, alpha, a)
    store_base(block, DW, alpha)
    through = load_vector(block, VELOCITY, root, links, like)
    turning = cross(load_vector(block, OMEGA, root, links, like), through)
    relative = out_of(axes, plus(a, turning))
    store_base(block, A, plus(relative, load_base(block, WATER_A, like)))
    for side in range(2):
        motion, way = (alpha, a), 2 * side - 1
        distance, i = way * scalar(plant, HALF, root), root + way
        while 0 <= i < links:
            motion = substitute(block, like, i, i - side, distance, plant, motion)
            distance, i = -scalar(plant, REACH, i), i + way


@compiled
def accelerate_all(blocks, plant):
    """`accelerate` for blocks of one robot each, from the state that they hold."""
    wide = spread(0.0)
    for k in range(blocks.shape[0]):
        block = block_at(blocks, k, 0.0)
        axes = kinematics(block, 0.0, wide, WIDTH, plant)
        accelerate(block, 0.0, wide, WIDTH, axes, plant)
