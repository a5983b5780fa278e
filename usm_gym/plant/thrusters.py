"""The thrusters: command, lag and force; from a wrench to forces and back (equation 4)."""

from __future__ import annotations

from typing import NamedTuple

from usm_gym.kernels.compile import compiled, piece, shared
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.kernels.lanes import load, store


class ThrusterRows(NamedTuple):
    """Where a block keeps its thrusters: first common numbers, then first rows of quantities.

    Attributes:
        lag: Share of the way to its target that a force covers in a physics step.
        mean_lag: Its mean over the step.
        limit: Largest command, N.
        dead_band: Smallest force that thrusters make, N.
        command: Commands, N.
        force: Forces, N.
        gain: Forces over commands.
        target: Forces that the commands lead to, N.
    """

    lag: int
    mean_lag: int
    limit: int
    dead_band: int
    command: int
    force: int
    gain: int
    target: int


@compiled
def lag_shares(time_constant, step):
    """Shares of the way to its command that a thruster covers in a physics step h.

    Args:
        time_constant: tau, s.
        step: h, s.

    Returns:
        The share at the end of the step, 1 - e^(-h/tau), and the mean over it.
    """
    if time_constant == 0.0:
        return 1.0, 1.0
    ratio = step / time_constant
    share = 1.0 - exp_of_negative(-ratio)
    return share, 1.0 - share / ratio


@shared
def saturated(value, limit):
    """A value cut off at a limit; not a `piece`, whose flags would leave infinity undefined."""
    return min(max(value, -limit), limit)


@piece
def delivered(command, gain, dead_band):
    """The force that a command leads to, N: none below the smallest force that thrusters make."""
    return gain * command if abs(command) >= dead_band else 0.0


@piece
def command(row, lanes, lane, rows, action):
    """Set the thruster commands of one robot from its action in [-1, 1]; beyond it saturates.

    `row` is the block of the robot, shape (rows * lanes,), `lane` its place in it, and `rows` are
    `ThrusterRows`.

    Returns:
        The mean absolute command, N.
    """
    limit, dead_band = row[rows.limit * lanes + lane], row[rows.dead_band * lanes + lane]
    effort = 0.0
    for j in range(action.size):
        force = saturated(float(action[j]), 1.0) * limit
        gain = row[(rows.gain + j) * lanes + lane]
        row[(rows.command + j) * lanes + lane] = force
        row[(rows.target + j) * lanes + lane] = delivered(force, gain, dead_band)
        effort += abs(force)
    return effort / action.size


@piece
def mean_force(block, like, rows, j):
    """Move the force of thruster j on by a physics step; returns its mean over the step, N."""
    force = load(block, rows.force + j, like)
    way = load(block, rows.target + j, like) - force
    store(block, rows.force + j, force + load(block, rows.lag, like) * way)
    return force + load(block, rows.mean_lag, like) * way


@piece
def allocate(T, wrench, rows, softness, work, forces):
    """Fill in the forces of least norm that make a wrench: f = T^T (T T^T + S)^-1 wrench.

    S is 0 but for the last row, which may be soft: where much force would be needed for it, it is
    made in part (damped least squares).

    The normal equations are solved by the decomposition L D L^T.

    Args:
        T: Allocation matrix, (rows, thrusters).
        wrench: Forces and moments, N and N m, (rows,).
        rows: How many; where it is a constant, the compiler unrolls the loops.
        softness: S of the last row, in the square of its unit over N.
        work: Room for D and what L is of it, for L, and for the solution, (2 rows + 1, rows).
        forces: Where to write, N, (thrusters,).
    """
    # D stands in the first rows of `work`, then L, then the solution z: views would cost more.
    L, z = rows, 2 * rows
    for i in range(rows):
        for j in range(i + 1):
            total, taken = 0.0, 0.0
            for k in range(forces.size):
                total += T[i, k] * T[j, k]
            for k in range(j):
                if i == j:
                    taken += work[L + i, k] * work[L + j, k] * work[k, k]
                else:
                    taken += work[i, k] * work[L + j, k]
            if i == j and i == rows - 1:
                total += softness
            work[i, j] = total - taken
            work[L + i, j] = work[i, j] / work[j, j]
    for i in range(rows):
        work[z, i] = wrench[i]
        for k in range(i):
            work[z, i] -= work[L + i, k] * work[z, k]
    for i in range(rows - 1, -1, -1):
        work[z, i] /= work[i, i]
        for k in range(i + 1, rows):
            work[z, i] -= work[L + k, i] * work[z, k]
    for j in range(forces.size):
        force = T[0, j] * work[z, 0]
        for i in range(1, rows):
            force += T[i, j] * work[z, i]
        forces[j] = force
