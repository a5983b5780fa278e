"""Thruster commands that come nearest to a wrench, within the limits and outside the dead-band.

Where the pseudo-inverse asks for more than a thruster can do, clipping spoils force and moment as
it happens. Here commands within the limits minimise

    |force - wanted|^2 + moment^2 |moment - wanted|^2 + effort^2 |u|^2,

the force before the moment, and both before the effort: the quadratic program of `planning` for a
single period. Commands within the dead-band, which make no force, then become none or the least
that makes one, whichever is nearer.

Source: O. Harkegard, Efficient active set algorithms for solving constrained least squares problems
in aircraft control allocation, IEEE Conference on Decision and Control 2002 (the problem).
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from usm_baselines.planning import Foreseen, Problem, improve
from usm_baselines.signals import Array

# Ways to share a wrench out among the thrusters.
PSEUDO_INVERSE, QUADRATIC_PROGRAM = "pseudo-inverse", "quadratic program"
ALLOCATIONS = PSEUDO_INVERSE, QUADRATIC_PROGRAM
# Forces, N, that are as bad as a moment that is wrong by 1 N m, and as 1 N of a thruster.
MOMENT_WEIGHT, EFFORT_WEIGHT = 0.2, 0.05
# By how much more than the dead-band a command is, so that it still is as a number of 32 bits.
MARGIN = 1.0 + 1e-6


@cache
def problem_of_a_period(axes: int) -> Problem:
    """The problem, with a state of one number in each axis, which stays zero."""
    none = np.zeros((axes, axes))
    return Problem(none, none, np.ones(axes), 1.0, MOMENT_WEIGHT, EFFORT_WEIGHT)


def nearest(wanted: Array, limit: Array, allocation: Array, axes: int) -> Array:
    """Commands within the limits that come nearest to the wrench of others, N, (batch, thrusters).

    Args:
        wanted: Commands that make the wrench, whatever the limits, N, (batch, thrusters).
        limit: Limits of the thrusters, N, (batch,).
        allocation: Allocation matrices, (batch, axes + moments, thrusters).
        axes: Axes of the force.
    """
    bound = limit[:, np.newaxis]
    command = np.clip(wanted, -bound, bound)
    beyond = np.flatnonzero((command != wanted).any(axis=1))
    if beyond.size == 0:
        return command
    T = allocation[beyond]
    wrench = (T * wanted[beyond, np.newaxis]).sum(axis=2)
    plan = command[beyond, np.newaxis]
    foreseen = Foreseen(
        error=np.zeros((beyond.size, 1, axes)),
        held=wrench[:, np.newaxis, :axes].copy(),
        wanted=wrench[:, np.newaxis, axes:].copy(),
        allocation=T[:, np.newaxis].copy(),
    )
    improve(plan, limit[beyond], foreseen, problem_of_a_period(axes))
    command[beyond] = plan[:, 0]
    return command


def outside(command: Array, dead_band: float) -> Array:
    """Commands with those below the dead-band made none, or the least that makes a force."""
    size = np.abs(command)
    least = np.where(size < 0.5 * dead_band, 0.0, MARGIN * dead_band)
    return np.where(size < dead_band, np.copysign(least, command), command)


def within(
    action: NDArray[np.float32], limit: Array, dead_band: float, allocation: Array, axes: int
) -> NDArray[np.float32]:
    """Actions that come nearest to what others ask for, and that thrusters can carry out.

    Args:
        action: Thruster commands over the limit, (batch, thrusters).
        limit: Limits of the thrusters, N, (batch,).
        dead_band: Commands below this make no force, N.
        allocation: Allocation matrices, (batch, axes + moments, thrusters).
        axes: Axes of the force.
    """
    bound = limit[:, np.newaxis]
    command = outside(nearest(action * bound, limit, allocation, axes), dead_band)
    return (command / bound).astype(np.float32)
