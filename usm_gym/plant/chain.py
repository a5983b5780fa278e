"""Forward dynamics of the chain in O(links): docs/model.md section 5 derives what stands here.

Both halves of the chain are eliminated from their free ends towards the root link in the middle,
the root is solved, and the accelerations are substituted back towards the ends. Every quantity is
a float64 or a `Lanes` (see `lanes`); `like` is a zero of that type.
"""

from __future__ import annotations

from typing import NamedTuple

from usm_gym.plant.compile import compiled, piece
from usm_gym.plant.elementary import sincos
from usm_gym.plant.lanes import block_at, load, store
from usm_gym.plant.layout import *


class Body(NamedTuple):
    """What all links of all robots share.

    Attributes:
        l: Half the length of a link, m.
        m: Mass of a link, kg.
        J: Moment of inertia of a link about its centre, kg m^2.
        h: Step over which drag and joint controllers are taken implicitly, s; 0 for not at all.
        kirchhoff: 1.0 for the consistent added mass, 0.0 for that of Kelasidi et al. (2014).
    """

    l: float
    m: float
    J: float
    h: float
    kirchhoff: float


@piece
def fluid_force(block, like, v_t, v_n, omega, water_t, kirchhoff):
    """Force along and across a link and moment on it from the water, without -mu_n (n . a).

    Arguments are the link's velocity relative to the water, its rate, and the water's own velocity
    along the link. The added mass of Kelasidi et al. (2014) leaves out the Munk moment
    (docs/model.md section 3).
    """
    mu = load(block, MU, like)
    consistent = mu * kirchhoff
    published = mu - consistent
    f_t = consistent * (v_n * omega) - load(block, C_T, like) * (v_t + v_t * abs(v_t))
    f_n = (consistent * v_t - published * water_t) * omega - load(block, C_N, like) * (
        v_n + v_n * abs(v_n)
    )
    yaw_drag = load(block, LAMBDA_2, like) + load(block, LAMBDA_3, like) * abs(omega)
    moment = -yaw_drag * omega - consistent * (v_t * v_n)
    return f_t, f_n, moment


@piece
def inertia(block, like, v_t, v_n, omega, body):
    """Inertia of a link along, across and in yaw; implicit drag adds h times its slope."""
    h = body.h
    along = body.m + h * (load(block, C_T, like) * (1.0 + 2.0 * abs(v_t)))
    across = body.m + load(block, MU, like) + h * (load(block, C_N, like) * (1.0 + 2.0 * abs(v_n)))
    yaw_slope = load(block, LAMBDA_2, like) + 2.0 * load(block, LAMBDA_3, like) * abs(omega)
    return along, across, body.J + load(block, LAMBDA_1, like) + h * yaw_slope


@piece
def kinematics(block, like, links, l):
    """Sine and cosine of every angle, and every link's velocity relative to the water.

    Returns:
        What has to be added to the velocities U_X, U_Y, which are those relative to the tail end.
    """
    run_x, run_y, sum_x, sum_y = like, like, like, like
    for i in range(links):
        record = HEADER + i * RECORD
        s, c = sincos(load(block, record + THETA, like))
        speed = l * load(block, record + OMEGA, like)
        half_x = -speed * s
        half_y = speed * c
        store(block, record + SIN, s)
        store(block, record + COS, c)
        centre_x = run_x + half_x
        centre_y = run_y + half_y
        store(block, record + U_X, centre_x)
        store(block, record + U_Y, centre_y)
        run_x = centre_x + half_x
        run_y = centre_y + half_y
        sum_x += centre_x
        sum_y += centre_y
    share = 1.0 / links
    return (
        load(block, V_X, like) - load(block, WATER_X, like) - share * sum_x,
        load(block, V_Y, like) - load(block, WATER_Y, like) - share * sum_y,
    )


@piece
def link_terms(block, like, record, base, body):
    """What one link brings: (sin, cos, omega, f_t, f_n, moment, M_t, M_n, I)."""
    s = load(block, record + SIN, like)
    c = load(block, record + COS, like)
    omega = load(block, record + OMEGA, like)
    u_x = base[0] + load(block, record + U_X, like)
    u_y = base[1] + load(block, record + U_Y, like)
    v_t = c * u_x + s * u_y
    v_n = c * u_y - s * u_x
    water_t = c * load(block, WATER_X, like) + s * load(block, WATER_Y, like)
    f_t, f_n, moment = fluid_force(block, like, v_t, v_n, omega, water_t, body.kirchhoff)
    along, across, yaw = inertia(block, like, v_t, v_n, omega, body)
    f_t += load(block, record + PUSH_T, like)
    f_n += load(block, record + PUSH_N, like)
    return s, c, omega, f_t, f_n, moment, along, across, yaw


@piece
def shifted(l, s, c, omega, answer):
    """Move a neighbour's answer by l along the link's tangent.

    A neighbour that is accelerated at one point of a link (angular `alpha` of the link, linear `q`
    of the point) answers with the moment r - a alpha - b . q and the force
    (r_x, r_y) - b alpha - C q. Its `answer` is (a, b_x, b_y, c_xx, c_xy, c_yy, r, r_x, r_y).
    Returned is the answer to the acceleration of the new point, from which
    q = q_new - l alpha n + l omega^2 t follows.
    """
    a, b_x, b_y, c_xx, c_xy, c_yy, r, r_x, r_y = answer
    centripetal = l * (omega * omega)
    r_x = r_x - centripetal * (c_xx * c + c_xy * s)
    r_y = r_y - centripetal * (c_xy * c + c_yy * s)
    r = r - centripetal * (b_x * c + b_y * s) - l * (r_y * c - r_x * s)
    # b - l C n and a - 2 l b.n + l^2 n.C n, with n = (-s, c).
    moved_x = b_x - l * (c_xy * c - c_xx * s)
    moved_y = b_y - l * (c_yy * c - c_xy * s)
    a = a - l * ((b_y + moved_y) * c - (b_x + moved_x) * s)
    return a, moved_x, moved_y, c_xx, c_xy, c_yy, r, r_x, r_y


@piece
def eliminate(block, like, i, side, answer, base, body):
    """Eliminate link i: from the answer of the links beyond it, make the answer that includes it.

    `side` is +1.0 for a link between tail and root, -1.0 for one between root and head.
    """
    reach = side * body.l
    record = HEADER + i * RECORD
    joint = record if side > 0.0 else record - RECORD
    s, c, omega, f_t, f_n, moment, along, across, yaw = link_terms(block, like, record, base, body)
    a, b_x, b_y, c_xx, c_xy, c_yy, r, r_x, r_y = shifted(2.0 * reach, s, c, omega, answer)
    # The link itself, seen from its joint towards the root, reach t away from its centre.
    f_t -= reach * ((omega * omega) * along)
    lever = reach * across
    difference = along - across
    a += yaw + reach * lever
    b_x += lever * s
    b_y -= lever * c
    c_xx += across + difference * (c * c)
    c_xy += difference * (c * s)
    c_yy += across + difference * (s * s)
    r += moment - reach * f_n
    r_x += f_t * c - f_n * s
    r_y += f_t * s + f_n * c
    # The joint's torque is u - k (alpha - alpha_next), k from its implicit treatment.
    k = load(block, JOINT_INERTIA, like)
    u = side * load(block, joint + TORQUE, like)
    inverse = 1.0 / (a + k)
    sub_0 = (r + u) * inverse
    sub_k = k * inverse
    sub_x = b_x * inverse
    sub_y = b_y * inverse
    store(block, record + SUB_0, sub_0)
    store(block, record + SUB_K, sub_k)
    store(block, record + SUB_X, sub_x)
    store(block, record + SUB_Y, sub_y)
    return (
        a * sub_k,
        b_x * sub_k,
        b_y * sub_k,
        c_xx - b_x * sub_x,
        c_xy - b_x * sub_y,
        c_yy - b_y * sub_y,
        k * sub_0 - u,
        r_x - b_x * sub_0,
        r_y - b_y * sub_0,
    )


@piece
def solve_root(block, like, root, tail, head, base, body):
    """Solve the root link: (alpha, q_x, q_y) of its centre."""
    l = body.l
    s, c, omega, f_t, f_n, moment, along, across, yaw = link_terms(
        block, like, HEADER + root * RECORD, base, body
    )
    a, b_x, b_y, c_xx, c_xy, c_yy, r, r_x, r_y = shifted(l, s, c, omega, tail)
    a_h, b_xh, b_yh, c_xxh, c_xyh, c_yyh, r_h, r_xh, r_yh = shifted(-l, s, c, omega, head)
    difference = along - across
    a += a_h + yaw
    b_x += b_xh
    b_y += b_yh
    c_xx += c_xxh + (across + difference * (c * c))
    c_xy += c_xyh + difference * (c * s)
    c_yy += c_yyh + (across + difference * (s * s))
    r += r_h + moment
    r_x += r_xh + (f_t * c - f_n * s)
    r_y += r_yh + (f_t * s + f_n * c)
    inverse = 1.0 / a
    c_xx -= b_x * b_x * inverse
    c_xy -= b_x * b_y * inverse
    c_yy -= b_y * b_y * inverse
    r_x -= b_x * (r * inverse)
    r_y -= b_y * (r * inverse)
    scale = 1.0 / (c_xx * c_yy - c_xy * c_xy)
    q_x = (c_yy * r_x - c_xy * r_y) * scale
    q_y = (c_xx * r_y - c_xy * r_x) * scale
    return (r - b_x * q_x - b_y * q_y) * inverse, q_x, q_y


@piece
def half_link(block, like, i, alpha, l):
    """Acceleration of link i's head end relative to its centre: l (alpha n - omega^2 t)."""
    record = HEADER + i * RECORD
    s = load(block, record + SIN, like)
    c = load(block, record + COS, like)
    omega = load(block, record + OMEGA, like)
    square = omega * omega
    return -l * (alpha * s + square * c), l * (alpha * c - square * s)


@piece
def substitute(block, like, i, side, motion, l):
    """Find a link's motion from that of its neighbour towards the root.

    `motion` is (alpha of the neighbour, acceleration q of the joint between the two, sum of the
    accelerations of all link centres so far); returned is the same for the next link.
    """
    record = HEADER + i * RECORD
    alpha, q_x, q_y, sum_x, sum_y = motion
    alpha = (
        load(block, record + SUB_0, like)
        + load(block, record + SUB_K, like) * alpha
        - load(block, record + SUB_X, like) * q_x
        - load(block, record + SUB_Y, like) * q_y
    )
    store(block, record + ALPHA, alpha)
    half_x, half_y = half_link(block, like, i, alpha, side * l)
    centre_x = q_x - half_x
    centre_y = q_y - half_y
    return alpha, centre_x - half_x, centre_y - half_y, sum_x + centre_x, sum_y + centre_y


@piece
def accelerate(block, like, links, body):
    """Fill in ALPHA of every link and the acceleration A_X, A_Y of the centre of mass.

    A neutrally buoyant robot does not notice that all the water accelerates: relative to the water
    nothing changes, so the water's acceleration is added to that of the centre of mass.
    """
    l = body.l
    root = links // 2
    last = links - 1
    base = kinematics(block, like, links, l)
    tail = (like, like, like, like, like, like, like, like, like)
    head = tail
    for i in range(last - root):
        tail = eliminate(block, like, i, 1.0, tail, base, body)
        head = eliminate(block, like, last - i, -1.0, head, base, body)
    if 2 * root == links:
        tail = eliminate(block, like, root - 1, 1.0, tail, base, body)
    alpha, q_x, q_y = solve_root(block, like, root, tail, head, base, body)
    store(block, HEADER + root * RECORD + ALPHA, alpha)
    half_x, half_y = half_link(block, like, root, alpha, l)
    towards_tail = (alpha, q_x - half_x, q_y - half_y, q_x, q_y)
    towards_head = (alpha, q_x + half_x, q_y + half_y, like, like)
    if 2 * root == links:
        towards_tail = substitute(block, like, root - 1, 1.0, towards_tail, l)
    for i in range(last - root - 1, -1, -1):
        towards_tail = substitute(block, like, i, 1.0, towards_tail, l)
        towards_head = substitute(block, like, last - i, -1.0, towards_head, l)
    share = 1.0 / links
    store(block, A_X, share * (towards_tail[3] + towards_head[3]) + load(block, WATER_AX, like))
    store(block, A_Y, share * (towards_tail[4] + towards_head[4]) + load(block, WATER_AY, like))


@compiled
def accelerate_one(blocks, links, body):
    """`accelerate` for the first of the blocks of one robot each."""
    accelerate(block_at(blocks, 0), 0.0, links, body)
