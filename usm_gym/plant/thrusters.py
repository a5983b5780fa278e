"""The thrusters: command, lag and force; from a wrench to forces and back (equation 4)."""

from __future__ import annotations

from usm_gym.kernels.compile import compiled, piece, shared
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.kernels.lanes import load, store
from usm_gym.plant.layout import *


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
def command(row, lanes, lane, links, action):
    """Set the thruster commands of one robot from its action in [-1, 1]; beyond it saturates.

    `row` is the block of the robot, shape (rows * lanes,), and `lane` its place in it.

    Returns:
        The mean absolute command, N.
    """
    limit, dead_band = row[LIMIT * lanes + lane], row[DEAD_BAND * lanes + lane]
    commands = thruster_row(COMMAND, links, action.size)
    gains = thruster_row(GAIN, links, action.size)
    targets = thruster_row(TARGET, links, action.size)
    effort = 0.0
    for j in range(action.size):
        force = saturated(float(action[j]), 1.0) * limit
        gain = row[(gains + j) * lanes + lane]
        row[(commands + j) * lanes + lane] = force
        row[(targets + j) * lanes + lane] = delivered(force, gain, dead_band)
        effort += abs(force)
    return effort / action.size


@piece
def push(block, like, plant):
    """First-order lag of every thruster, and its mean force over a physics step on its link."""
    links, thrusters = plant.links, plant.thruster_links.size
    along, across = row_of(PUSH_T, links), row_of(PUSH_N, links)
    for j in range(thrusters):
        store(block, along + plant.thruster_links[j], like)
        store(block, across + plant.thruster_links[j], like)
    lag, mean_lag = load(block, LAG, like), load(block, MEAN_LAG, like)
    forces = thruster_row(FORCE, links, thrusters)
    targets = thruster_row(TARGET, links, thrusters)
    for j in range(thrusters):
        force = load(block, forces + j, like)
        way = load(block, targets + j, like) - force
        store(block, forces + j, force + lag * way)
        target = plant.thruster_links[j] + (across if plant.thruster_is_normal[j] else along)
        store(block, target, load(block, target, like) + (force + mean_lag * way))


@piece
def allocation_matrix(sine, cosine, l, thruster_links, thruster_is_normal, T):
    """Fill in T, shape (3, thrusters): the wrench (N, N, N m) that a unit force of each makes.

    The moment is about the centre of mass. The paper prints its row without the factor l; here
    it is the true moment (docs/model.md section 6).

    Args:
        sine: Sines of the link angles, (n,).
        cosine: Cosines of the link angles, (n,).
        l: Half the length of a link, m.
        thruster_links: Zero-based link of each thruster.
        thruster_is_normal: Whether each thruster pushes across its link.
        T: Where to write.
    """
    n = sine.size
    share = 1.0 / n
    x, y, mean_x, mean_y = 0.0, 0.0, 0.0, 0.0
    for i in range(1, n):
        x += l * (cosine[i - 1] + cosine[i])
        y += l * (sine[i - 1] + sine[i])
        mean_x += x * share
        mean_y += y * share
    at, x, y = 0, -mean_x, -mean_y
    for j in range(thruster_links.size):
        link = thruster_links[j]
        if link < at:
            at, x, y = 0, -mean_x, -mean_y
        for i in range(at + 1, link + 1):
            x += l * (cosine[i - 1] + cosine[i])
            y += l * (sine[i - 1] + sine[i])
        at = link
        T[0, j] = -sine[link] if thruster_is_normal[j] else cosine[link]
        T[1, j] = cosine[link] if thruster_is_normal[j] else sine[link]
        T[2, j] = x * T[1, j] - y * T[0, j]


@piece
def allocate(T, wrench, rows, work, forces):
    """Fill in the forces of least norm that make a wrench: f = T^T (T T^T)^-1 wrench.

    The normal equations are solved by the decomposition L D L^T.

    Args:
        T: Allocation matrix, (rows, thrusters).
        wrench: Forces and moments, N and N m, (rows,).
        rows: How many; where it is a constant, the compiler unrolls the loops.
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
