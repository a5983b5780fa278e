"""Forward dynamics of the chain in O(links): docs/model.md section 5 derives what stands here.

First, for every link by itself, its own answer to an acceleration; then both halves of the chain
are eliminated from their free ends towards the root link in the middle, the root is solved, and the
accelerations are substituted back towards the ends.

Every quantity is a float64 or a `Lanes` (see `lanes`). `like` is a zero of the type that a number
of the header has: float64 in a block of one robot, `Lanes` in one of several. `wide` is a zero of
the type in which links are worked on that do not depend on each other: always a `Lanes`, of
`stride` links of one robot, or of one link of several.
"""

from __future__ import annotations

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import sincos
from usm_gym.kernels.lanes import WIDTH, block_at, load, padded, spread, store
from usm_gym.plant.layout import *


@piece
def directions(block, wide, stride, links):
    """Sines and cosines of the angles now, in the place of those where forces are taken."""
    for i in range(0, links, stride):
        s, c = sincos(load(block, row_of(THETA, links) + i, wide))
        store(block, row_of(SIN, links) + i, s)
        store(block, row_of(COS, links) + i, c)


@piece
def kinematics(block, like, wide, stride, plant):
    """Where forces are taken: sines and cosines of the angles, rates, velocities of the links.

    That is `lead` into the step, where the angles follow from the rates at its beginning, and the
    velocities from the accelerations of the step before. Velocities of links are relative to the
    tail end.

    Returns:
        What has to be added to the velocities U_X, U_Y to make them relative to the water.
    """
    links, l, lead = plant.links, plant.l, plant.lead
    theta, omega, alpha = row_of(THETA, links), row_of(OMEGA, links), row_of(ALPHA, links)
    sine, cosine, rates = row_of(SIN, links), row_of(COS, links), row_of(RATE, links)
    u_x, u_y = row_of(U_X, links), row_of(U_Y, links)
    for i in range(0, links, stride):
        now = load(block, omega + i, wide)
        s, c = sincos(load(block, theta + i, wide) + lead * now)
        rate = now + lead * load(block, alpha + i, wide)
        speed = l * rate
        store(block, rates + i, rate)
        store(block, sine + i, s)
        store(block, cosine + i, c)
        store(block, u_x + i, -speed * s)
        store(block, u_y + i, speed * c)
    run_x, run_y, sum_x, sum_y = like, like, like, like
    for i in range(links):
        half_x, half_y = load(block, u_x + i, like), load(block, u_y + i, like)
        centre_x, centre_y = run_x + half_x, run_y + half_y
        store(block, u_x + i, centre_x)
        store(block, u_y + i, centre_y)
        run_x, run_y = run_x + 2.0 * half_x, run_y + 2.0 * half_y
        sum_x, sum_y = sum_x + centre_x, sum_y + centre_y
    share = 1.0 / links
    v_x = load(block, V_X, like) + lead * load(block, A_X, like)
    v_y = load(block, V_Y, like) + lead * load(block, A_Y, like)
    return (
        v_x - load(block, WATER_X, like) - share * sum_x,
        v_y - load(block, WATER_Y, like) - share * sum_y,
    )


@piece
def fluid_force(v_t, v_n, omega, water_t, coefficients, kirchhoff, linear):
    """Force along and across a link and moment on it from the water, without -mu_n (n . a).

    Arguments are the link's velocity relative to the water, its rate, and the water's own velocity
    along the link; `linear` is `Plant.linear_drag`. The added mass of Kelasidi et al. (2014) leaves
    out the Munk moment (docs/model.md section 3).
    """
    c_t, c_n, mu, _, lambda_2, lambda_3 = coefficients
    consistent = mu * kirchhoff
    published = mu - consistent
    drag_t = c_t * (linear * v_t + v_t * abs(v_t))
    drag_n = c_n * (linear * v_n + v_n * abs(v_n))
    drag_yaw = (linear * lambda_2 + lambda_3 * abs(omega)) * omega
    f_t = consistent * (v_n * omega) - drag_t
    f_n = (consistent * v_t - published * water_t) * omega - drag_n
    moment = -drag_yaw - consistent * (v_t * v_n)
    return f_t, f_n, moment


@piece
def damping(v_t, v_n, omega, coefficients, linear):
    """How drag grows with the velocity along and across a link and with its rate."""
    c_t, c_n, _, _, lambda_2, lambda_3 = coefficients
    along = c_t * (linear + 2.0 * abs(v_t))
    across = c_n * (linear + 2.0 * abs(v_n))
    return along, across, linear * lambda_2 + 2.0 * lambda_3 * abs(omega)


@piece
def own_answers(block, like, wide, stride, links, base, plant):
    """Every link's own answer to an acceleration of its end towards the root (root: its centre).

    An answer is (a, b_x, b_y, c_xx, c_xy, c_yy, r, r_x, r_y): to the angular acceleration `alpha`
    of the link and the linear acceleration q of the point it gives the moment r - a alpha - b . q
    and the force (r_x, r_y) - b alpha - C q.

    Drag is that at the velocity to which the link's new acceleration leads, in place of that of the
    step before: it joins the link's inertia.
    """
    rows = padded(links)
    own = row_of(OWN, links)
    common = (
        load(block, C_T, like),
        load(block, C_N, like),
        load(block, MU, like),
        load(block, LAMBDA_1, like),
        load(block, LAMBDA_2, like),
        load(block, LAMBDA_3, like),
    )
    water_x, water_y = load(block, WATER_X, like), load(block, WATER_Y, like)
    for i in range(0, links, stride):
        s = load(block, row_of(SIN, links) + i, wide)
        c = load(block, row_of(COS, links) + i, wide)
        omega = load(block, row_of(RATE, links) + i, wide)
        u_x = base[0] + load(block, row_of(U_X, links) + i, wide)
        u_y = base[1] + load(block, row_of(U_Y, links) + i, wide)
        v_t = c * u_x + s * u_y
        v_n = c * u_y - s * u_x
        water_t = c * water_x + s * water_y
        factor = load(block, row_of(FACTOR, links) + i, wide)
        coefficients = (
            factor * common[0],
            factor * common[1],
            factor * common[2],
            factor * common[3],
            factor * common[4],
            factor * common[5],
        )
        f_t, f_n, moment = fluid_force(
            v_t, v_n, omega, water_t, coefficients, plant.kirchhoff, plant.linear_drag
        )
        d_t, d_n, d_yaw = damping(v_t, v_n, omega, coefficients, plant.linear_drag)
        d_t, d_n, d_yaw = plant.lead * d_t, plant.lead * d_n, plant.lead * d_yaw
        a_x = load(block, row_of(LINK_AX, links) + i, wide)
        a_y = load(block, row_of(LINK_AY, links) + i, wide)
        f_t += d_t * (c * a_x + s * a_y)
        f_n += d_n * (c * a_y - s * a_x)
        moment += d_yaw * load(block, row_of(ALPHA, links) + i, wide)
        along = plant.m + d_t
        across = plant.m + coefficients[2] + d_n
        yaw = plant.J + coefficients[3] + d_yaw
        # The point is reach t from the centre, which moves with q - reach (alpha n - omega^2 t).
        reach = plant.l * load(block, row_of(SIDE, links) + i, wide)
        f_t += load(block, row_of(PUSH_T, links) + i, wide) - reach * ((omega * omega) * along)
        f_n += load(block, row_of(PUSH_N, links) + i, wide)
        lever = reach * across
        difference = along - across
        store(block, own + i, yaw + reach * lever)
        store(block, own + rows + i, lever * s)
        store(block, own + 2 * rows + i, -lever * c)
        store(block, own + 3 * rows + i, across + difference * (c * c))
        store(block, own + 4 * rows + i, difference * (c * s))
        store(block, own + 5 * rows + i, across + difference * (s * s))
        store(block, own + 6 * rows + i, moment - reach * f_n)
        store(block, own + 7 * rows + i, f_t * c - f_n * s)
        store(block, own + 8 * rows + i, f_t * s + f_n * c)


@piece
def axes(block, like, i, links):
    """(sin, cos, omega) of link i."""
    return (
        load(block, row_of(SIN, links) + i, like),
        load(block, row_of(COS, links) + i, like),
        load(block, row_of(RATE, links) + i, like),
    )


@piece
def with_own(block, like, i, links, answer):
    """The sum of an answer and link i's own."""
    rows = padded(links)
    own = row_of(OWN, links) + i
    a, b_x, b_y, c_xx, c_xy, c_yy, r, r_x, r_y = answer
    return (
        a + load(block, own, like),
        b_x + load(block, own + rows, like),
        b_y + load(block, own + 2 * rows, like),
        c_xx + load(block, own + 3 * rows, like),
        c_xy + load(block, own + 4 * rows, like),
        c_yy + load(block, own + 5 * rows, like),
        r + load(block, own + 6 * rows, like),
        r_x + load(block, own + 7 * rows, like),
        r_y + load(block, own + 8 * rows, like),
    )


@piece
def eliminate(block, like, i, side, links, l, answer):
    """Eliminate link i: make the answer, at its neighbour's point, of all links from it outwards.

    `side` is 1.0 for a link between tail and root, -1.0 for one between root and head; `answer` is
    that of the links beyond it, at its own point.

    With q = q' - alpha' n + p of its end, where n is the way from there to the neighbour's point
    turned by 90 degrees and p the neighbour's centripetal acceleration, the link's moment is
    (a + k) alpha + b . q' - g alpha' = z, which leaves an update of rank one.
    """
    rows = padded(links)
    sub = row_of(SUB_0, links) + i
    inner = i + (1 if side > 0.0 else -1)
    joint = row_of(TORQUE, links) + (i if side > 0.0 else i - 1)
    s, c, omega = axes(block, like, inner, links)
    reach = side * (l if inner == links // 2 else 2.0 * l)
    along_x, along_y = reach * c, reach * s
    square = omega * omega
    pull_x, pull_y = square * along_x, square * along_y
    # The joint's torque is u - k (alpha - alpha'), k from its implicit treatment.
    k = load(block, JOINT_INERTIA, like)
    u = side * load(block, joint, like)
    a, b_x, b_y, c_xx, c_xy, c_yy, r, r_x, r_y = with_own(block, like, i, links, answer)
    inverse = 1.0 / (a + k)
    # What does not wait for the division, on which the next link has to wait.
    turned_x = c_xy * along_x - c_xx * along_y
    turned_y = c_yy * along_x - c_xy * along_y
    g = k + (b_y * along_x - b_x * along_y)
    z = (r + u) - (b_x * pull_x + b_y * pull_y)
    r_x = r_x - (c_xx * pull_x + c_xy * pull_y)
    r_y = r_y - (c_xy * pull_x + c_yy * pull_y)
    sub_0 = z * inverse
    sub_g = g * inverse
    sub_x = b_x * inverse
    sub_y = b_y * inverse
    store(block, sub, sub_0)
    store(block, sub + rows, sub_g)
    store(block, sub + 2 * rows, sub_x)
    store(block, sub + 3 * rows, sub_y)
    return (
        (k + (turned_y * along_x - turned_x * along_y)) - g * sub_g,
        b_x * sub_g - turned_x,
        b_y * sub_g - turned_y,
        c_xx - b_x * sub_x,
        c_xy - b_x * sub_y,
        c_yy - b_y * sub_y,
        (g * sub_0 - u) - (r_y * along_x - r_x * along_y),
        r_x - b_x * sub_0,
        r_y - b_y * sub_0,
    )


@piece
def solve_root(block, like, root, links, tail, head):
    """Solve the root link: (alpha, q_x, q_y) of its centre."""
    a, b_x, b_y, c_xx, c_xy, c_yy, r, r_x, r_y = with_own(block, like, root, links, tail)
    a += head[0]
    b_x += head[1]
    b_y += head[2]
    c_xx += head[3]
    c_xy += head[4]
    c_yy += head[5]
    r += head[6]
    r_x += head[7]
    r_y += head[8]
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
def half_link(block, like, i, links, alpha, l):
    """Acceleration of link i's head end relative to its centre: l (alpha n - omega^2 t)."""
    s, c, omega = axes(block, like, i, links)
    along_x, along_y = l * c, l * s
    square = omega * omega
    return -square * along_x - alpha * along_y, alpha * along_x - square * along_y


@piece
def substitute(block, like, i, side, links, l, motion):
    """Find a link's motion from that of its neighbour towards the root.

    `motion` is (alpha of the neighbour, acceleration of its point, of the joint between the two,
    sum of the accelerations of all link centres so far); returned is the same for the next link.
    """
    rows = padded(links)
    sub = row_of(SUB_0, links) + i
    alpha, q_x, q_y, joint_x, joint_y, sum_x, sum_y = motion
    alpha = (load(block, sub, like) + load(block, sub + rows, like) * alpha) - (
        load(block, sub + 2 * rows, like) * q_x + load(block, sub + 3 * rows, like) * q_y
    )
    store(block, row_of(ALPHA, links) + i, alpha)
    half_x, half_y = half_link(block, like, i, links, alpha, side * l)
    centre_x, centre_y = joint_x - half_x, joint_y - half_y
    store(block, row_of(LINK_AX, links) + i, centre_x)
    store(block, row_of(LINK_AY, links) + i, centre_y)
    return (
        alpha,
        joint_x,
        joint_y,
        centre_x - half_x,
        centre_y - half_y,
        sum_x + centre_x,
        sum_y + centre_y,
    )


@piece
def accelerate(block, like, wide, stride, links, base, plant):
    """Fill in ALPHA of every link and the acceleration A_X, A_Y of the centre of mass.

    `base` is what `kinematics` has returned.

    A neutrally buoyant robot does not notice that all the water accelerates: relative to the water
    nothing changes, so the water's acceleration is added to that of the centre of mass.
    """
    l = plant.l
    root = links // 2
    last = links - 1
    own_answers(block, like, wide, stride, links, base, plant)
    tail = (like, like, like, like, like, like, like, like, like)
    head = tail
    for i in range(last - root):
        tail = eliminate(block, like, i, 1.0, links, l, tail)
        head = eliminate(block, like, last - i, -1.0, links, l, head)
    if 2 * root == links:
        tail = eliminate(block, like, root - 1, 1.0, links, l, tail)
    alpha, q_x, q_y = solve_root(block, like, root, links, tail, head)
    store(block, row_of(ALPHA, links) + root, alpha)
    store(block, row_of(LINK_AX, links) + root, q_x)
    store(block, row_of(LINK_AY, links) + root, q_y)
    half_x, half_y = half_link(block, like, root, links, alpha, l)
    towards_tail = (alpha, q_x, q_y, q_x - half_x, q_y - half_y, q_x, q_y)
    towards_head = (alpha, q_x, q_y, q_x + half_x, q_y + half_y, like, like)
    if 2 * root == links:
        towards_tail = substitute(block, like, root - 1, 1.0, links, l, towards_tail)
    for i in range(last - root - 1, -1, -1):
        towards_tail = substitute(block, like, i, 1.0, links, l, towards_tail)
        towards_head = substitute(block, like, last - i, -1.0, links, l, towards_head)
    share = 1.0 / links
    store(block, A_X, share * (towards_tail[5] + towards_head[5]) + load(block, WATER_AX, like))
    store(block, A_Y, share * (towards_tail[6] + towards_head[6]) + load(block, WATER_AY, like))


@compiled
def accelerate_all(blocks, links, plant):
    """`accelerate` for blocks of one robot each."""
    wide = spread(0.0)
    for k in range(blocks.shape[0]):
        block = block_at(blocks, k, 0.0)
        base = kinematics(block, 0.0, wide, WIDTH, plant)
        accelerate(block, 0.0, wide, WIDTH, links, base, plant)
