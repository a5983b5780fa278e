"""The joints: their references, which a filter smooths, and the controllers that follow them."""

from __future__ import annotations

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.kernels.lanes import load, store, where
from usm_gym.plant.layout import *


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
def advance_references(block, like, shifts, h):
    """Move the joint references on by one physics step, towards the deflection now asked for."""
    t = load(block, CLOCK, like) * h
    target = like
    for k in range(shifts):
        reached = t >= load(block, SHIFT_TIME + k, like)
        target += where(reached, load(block, SHIFT_SIZE + k, like), like)
    x = load(block, DEFLECTION, like) - target
    rate = load(block, DEFLECTION_RATE, like)
    moved = load(block, FILTER_DD, like) * x + load(block, FILTER_DR, like) * rate
    turned = load(block, FILTER_RD, like) * x + load(block, FILTER_RR, like) * rate
    store(block, DEFLECTION, target + moved)
    store(block, DEFLECTION_RATE, turned)
    pull = load(block, FILTER_STIFFNESS, like) * moved + load(block, FILTER_DAMPING, like) * turned
    store(block, DEFLECTION_ACCELERATION, -pull)


@piece
def joint_torques(block, like, wide, stride, links, implicit):
    """Torque of every joint controller, less the part that is in the joint-space inertia.

    u = k_p (phi_ref - phi - h phi') + k_d (phi_ref' - phi') - (h k_d + h^2 k_p) phi''.
    """
    k_p, k_d = load(block, STIFFNESS, like), load(block, DAMPING, like)
    target = k_p * load(block, DEFLECTION, like) + k_d * load(block, DEFLECTION_RATE, like)
    damping = k_d + implicit * k_p
    theta, omega = row_of(THETA, links), row_of(OMEGA, links)
    for i in range(0, links - 1, stride):
        phi = load(block, theta + i, wide) - load(block, theta + i + 1, wide)
        phi_dot = load(block, omega + i, wide) - load(block, omega + i + 1, wide)
        wanted = target * load(block, row_of(SHARE, links) + i, wide)
        store(block, row_of(TORQUE, links) + i, wanted - k_p * phi - damping * phi_dot)
