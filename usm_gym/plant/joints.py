"""The joints: their references, which a filter smooths, and the controllers that follow them."""

from __future__ import annotations

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.kernels.lanes import load, store, where
from usm_gym.plant.layout import *

# Share of a step that has to follow a change for it to fall into the step: a change between two
# steps belongs to the second, whichever way its time over the step rounds.
EARLIEST = 1e-6


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


@piece
def asked_torque(block, like):
    """What the joint references ask for now: k_p phi_ref + k_d phi_ref', of a joint of share 1."""
    stiffness = load(block, STIFFNESS, like) * load(block, DEFLECTION, like)
    return stiffness + load(block, DAMPING, like) * load(block, DEFLECTION_RATE, like)


@piece
def advance_references(block, like, shifts, h, lead):
    """Move the joint references on by one physics step, towards the deflection asked for.

    In the step in which a change falls, the deflection asked for is its mean over the step.

    Returns:
        What they ask for `lead` into the step, of a joint of share 1. Without a filter they jump,
        and it is the mean over the step.
    """
    before = asked_torque(block, like)
    end = load(block, CLOCK, like) + 1.0
    target, at_end = like, like
    for k in range(shifts):
        size = load(block, SHIFT_SIZE + k, like)
        share = end - load(block, SHIFT_STEP + k, like)
        begun = share > EARLIEST
        target += where(begun, where(share < 1.0, share, 1.0) * size, like)
        at_end += where(begun, size, like)
    x = load(block, DEFLECTION, like) - target
    rate = load(block, DEFLECTION_RATE, like)
    moved = load(block, FILTER_DD, like) * x + load(block, FILTER_DR, like) * rate
    turned = load(block, FILTER_RD, like) * x + load(block, FILTER_RR, like) * rate
    smooth = load(block, FILTER_DD, like) > 0.0
    store(block, DEFLECTION, where(smooth, target + moved, at_end))
    store(block, DEFLECTION_RATE, turned)
    away = moved + (target - at_end)
    pull = load(block, FILTER_STIFFNESS, like) * away + load(block, FILTER_DAMPING, like) * turned
    store(block, DEFLECTION_ACCELERATION, -pull)
    between = before + (lead / h) * (asked_torque(block, like) - before)
    return where(smooth, between, load(block, STIFFNESS, like) * target)


@piece
def joint_torques(block, like, wide, stride, links, lead, asked):
    """Torque of every joint controller, less the part that is in the joint-space inertia.

    It is that of the middle of a step of 2 lead, from those at three ends of steps: the torque to
    come less half the change over the step before, u_1 - (u_0 - u_-1) / 2. So the fast motion that
    the stiff controllers damp dies out within a few steps, which it would not with the mean of u_0
    and u_1. What the references ask for is `asked` itself.
    """
    k_p, k_d = load(block, STIFFNESS, like), load(block, DAMPING, like)
    on_rate = k_d + lead * k_p
    on_acceleration = lead * (k_d - lead * k_p)
    theta, omega, alpha = row_of(THETA, links), row_of(OMEGA, links), row_of(ALPHA, links)
    for i in range(0, links - 1, stride):
        phi = load(block, theta + i, wide) - load(block, theta + i + 1, wide)
        phi_dot = load(block, omega + i, wide) - load(block, omega + i + 1, wide)
        phi_ddot = load(block, alpha + i, wide) - load(block, alpha + i + 1, wide)
        wanted = asked * load(block, row_of(SHARE, links) + i, wide)
        held = k_p * phi + on_rate * phi_dot - on_acceleration * phi_ddot
        store(block, row_of(TORQUE, links) + i, wanted - held)
