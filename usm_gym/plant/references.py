"""What joints are asked for: a deflection that a filter smooths, in any block of robots."""

from __future__ import annotations

from typing import NamedTuple

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.kernels.lanes import load, store, where

# Share of a step that has to follow a change for it to fall into the step: a change between two
# steps belongs to the second, whichever way its time over the step rounds.
EARLIEST = 1e-6
# Changes of a deflection in an episode at most; one that never comes is due at this step.
MAX_SHIFTS, NEVER = 16, 1e30


class ReferenceRows(NamedTuple):
    """Where a block keeps a deflection and what moves it.

    Attributes:
        clock: Physics steps since the start.
        stiffness: Gains of the joint controllers: stiffness, then damping.
        deflection: The deflection, its rate, its acceleration.
        filter: What `filter_coefficients` returns.
        shift_step: When the deflection changes, physics steps since the start.
        shift_size: By how much.
    """

    clock: int
    stiffness: int
    deflection: int
    filter: int
    shift_step: int
    shift_size: int


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
def asked_torque(block, like, rows):
    """What the references ask for now: k_p phi_ref + k_d phi_ref', of a joint of share 1."""
    stiffness = load(block, rows.stiffness, like) * load(block, rows.deflection, like)
    damping, rate = rows.stiffness + 1, rows.deflection + 1
    return stiffness + load(block, damping, like) * load(block, rate, like)


@piece
def advance_references(block, like, rows, shifts, h, lead):
    """Move a deflection on by one physics step, towards that asked for.

    In the step in which a change falls, the deflection asked for is its mean over the step.

    Returns:
        What it asks for `lead` into the step, of a joint of share 1. Without a filter it jumps, and
        this is the mean over the step.
    """
    before = asked_torque(block, like, rows)
    end = load(block, rows.clock, like) + 1.0
    target, at_end = like, like
    for k in range(shifts):
        size = load(block, rows.shift_size + k, like)
        share = end - load(block, rows.shift_step + k, like)
        begun = share > EARLIEST
        target += where(begun, where(share < 1.0, share, 1.0) * size, like)
        at_end += where(begun, size, like)
    # The filter's x from x, x from x', x' from x, x' from x'; then what gives the acceleration.
    first = rows.filter
    x = load(block, rows.deflection, like) - target
    rate = load(block, rows.deflection + 1, like)
    moved = load(block, first, like) * x + load(block, first + 1, like) * rate
    turned = load(block, first + 2, like) * x + load(block, first + 3, like) * rate
    smooth = load(block, first, like) > 0.0
    store(block, rows.deflection, where(smooth, target + moved, at_end))
    store(block, rows.deflection + 1, turned)
    away = moved + (target - at_end)
    pull = load(block, first + 4, like) * away + load(block, first + 5, like) * turned
    store(block, rows.deflection + 2, -pull)
    between = before + (lead / h) * (asked_torque(block, like, rows) - before)
    return where(smooth, between, load(block, rows.stiffness, like) * target)
