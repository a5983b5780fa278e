"""Thruster commands over a horizon within the thrusters' limits: a quadratic program.

Of a plan it is known what comes of it. What changes of its commands add to that is taken from the
linear model of the straight body (`kalman`). They minimise, summed over the periods,

    |error|^2 + variation^2 |force - held|^2 + moment^2 |moment - wanted|^2 + effort^2 |u|^2,

where the commands u, each within its limits, make the force and the moment, which have as many
components as the world has axes and angles. What the force is held
to is up to the problem: the thrust, which lags behind it, or the force of the period before. If no
limit is met this is one Newton step, from a Riccati recursion over
the horizon. Else a primal-dual interior-point method takes several, each of them the same recursion
with a term for every limit.

Source: C. V. Rao, S. J. Wright, J. B. Rawlings, Application of interior-point methods to model
predictive control, Journal of Optimization Theory and Applications 99, 1998.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.estimation.kalman import COMMAND, ERROR, RATE, THRUST
from usm_baselines.signals import Array
from usm_gym.kernels.compile import compiled, piece

# The interior-point method: how far inside the limits it begins, over the limit; its steps; how far
# each of them may go towards the limits; by what it is to bring complementarity down.
INSIDE, STEPS, REACH, SHRINKING = 0.1, 14, 0.99, 0.15
# Commands nearer to a limit than this, over the limit, count as this far from it.
NEAREST = 1e-9


class Problem(NamedTuple):
    """What the plans of all robots share.

    The state has as many numbers of each axis: the error first, and last what the commanded force
    is held to, over the inertia.

    Attributes:
        transition: Of the state over a period, (numbers, numbers).
        input: What a force of 1 N commanded along an axis adds to it, (numbers, axes).
        inertia: Inertia of the axes, kg, (axes,).
        variation: Error that is as bad as 1 N between the force and what it is held to, m/N.
        moment: Error that is as bad as a moment that is wrong by 1 N m, m/(N m).
        effort: Error that is as bad as 1 N of a thruster, m/N.
    """

    transition: Array
    input: Array
    inertia: Array
    variation: float
    moment: float
    effort: float


class Foreseen(NamedTuple):
    """What comes of the plans of a batch of robots, by period; or of the plan of one of them.

    Attributes:
        error: Position errors at the end, m, (batch, periods, axes).
        held: Forces along the axes that the commanded ones are held to, N, the same shape.
        wanted: Wanted moments, N m, (batch, periods, moments).
        allocation: Allocation matrices, (batch, periods, axes + moments, thrusters).
    """

    error: Array
    held: Array
    wanted: Array
    allocation: Array


class Room(NamedTuple):
    """Where the plan of one robot is worked on.

    Attributes:
        gain: Change of the commands over change of the state, (periods, thrusters, numbers).
        change: Change of the commands, N, (periods, thrusters).
        error: What that changes of the errors, m, (periods, axes).
        held: What it changes of the forces that they are held to, N, (periods, axes).
        curvature: Second derivatives that the limits add, (periods, thrusters).
        slope: First derivatives that they add, (periods, thrusters).
        low: Multipliers of the lower limits, (periods, thrusters).
        high: Multipliers of the upper limits, (periods, thrusters).
    """

    gain: Array
    change: Array
    error: Array
    held: Array
    curvature: Array
    slope: Array
    low: Array
    high: Array


def problem_of(
    transition: Array,
    inertia: Array,
    variation: float,
    moment: float,
    effort: float,
    *,
    changes: bool = False,
) -> Problem:
    """The problem of a robot whose axes have these transitions, see `kalman`, (axes, 4, 6).

    Args:
        transition: The transitions.
        inertia: As in `Problem`, and so the other weights.
        variation: The same.
        moment: The same.
        effort: The same.
        changes: Whether the force is held to that of the period before; else to the thrust.
    """
    rows = [ERROR, RATE, THRUST]
    axes, numbers = len(transition), len(rows) + changes
    A, B = np.zeros((axes * numbers, axes * numbers)), np.zeros((axes * numbers, axes))
    for axis in range(axes):
        first = numbers * axis
        own = slice(first, first + len(rows))
        A[own, own] = transition[axis][np.ix_(rows, rows)]
        B[own, axis] = transition[axis][rows, COMMAND] / inertia[axis]
        if changes:
            B[first + len(rows), axis] = 1.0 / inertia[axis]
    return Problem(A, B, inertia, variation, moment, effort)


@compiled
def add_product(X, Y, out):
    """Add X Y to a matrix."""
    for i in range(out.shape[0]):
        for k in range(Y.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] += X[i, k] * Y[k, j]


@compiled
def solve(H, X):
    """Solve H Z = X by Cholesky's decomposition; Z replaces X, the factor the lower half of H."""
    n = H.shape[0]
    for i in range(n):
        for j in range(i + 1):
            for k in range(j):
                H[i, j] -= H[i, k] * H[j, k]
            H[i, j] = np.sqrt(H[i, j]) if i == j else H[i, j] / H[j, j]
    for c in range(X.shape[1]):
        for i in range(n):
            for k in range(i):
                X[i, c] -= H[i, k] * X[k, c]
            X[i, c] /= H[i, i]
        for i in range(n - 1, -1, -1):
            for k in range(i + 1, n):
                X[i, c] -= H[k, i] * X[k, c]
            X[i, c] /= H[i, i]


@piece
def misses(u, held, wanted, T, problem, D, C):
    """Fill in the residuals D du + C (dx, 1) of force and moment in a period, weighted."""
    n, axes = problem.input.shape
    per_axis = n // axes
    for r in range(T.shape[0]):
        weight = problem.variation if r < axes else problem.moment
        C[r, n] = -weight * (held[r] if r < axes else wanted[r - axes])
        for j in range(u.size):
            D[r, j] = weight * T[r, j]
            C[r, n] += D[r, j] * u[j]
    for axis in range(axes):
        C[axis, per_axis * (axis + 1) - 1] = -problem.variation * problem.inertia[axis]


@compiled
def newton(u, foreseen, problem, room):
    """Fill in the gains of the Newton step, and its changes where the state does not change."""
    periods, m = u.shape
    A, effort = problem.transition, problem.effort**2
    (n, axes), rows = problem.input.shape, foreseen.allocation.shape[1]
    per_axis = n // axes
    # Hessian and gradient of the value, the latter as the last column; so it is in VA, K and C.
    V, VA, VB = np.zeros((n, n + 1)), np.empty((n, n + 1)), np.empty((n, m))
    B, D, C = np.empty((n, m)), np.empty((rows, m)), np.zeros((rows, n + 1))
    H, G, K = np.empty((m, m)), np.empty((m, n + 1)), np.empty((m, n + 1))
    for i in range(periods - 1, -1, -1):
        T = foreseen.allocation[i]
        misses(u[i], foreseen.held[i], foreseen.wanted[i], T, problem, D, C)
        for axis in range(axes):
            V[per_axis * axis, per_axis * axis] += 1.0
            V[per_axis * axis, n] += foreseen.error[i, axis]
        for matrix in (B, VB, H):
            matrix[:] = 0.0
        for matrix in (VA, G):
            matrix[:] = 0.0
        add_product(problem.input, T[:axes], B)
        add_product(V, A, VA[:, :n])
        VA[:, n] = V[:, n]
        add_product(V, B, VB)
        add_product(B.T, VB, H)
        add_product(D.T, D, H)
        add_product(B.T, VA, G)
        add_product(D.T, C, G)
        for j in range(m):
            H[j, j] += effort + room.curvature[i, j]
            G[j, n] += effort * u[i, j] + room.slope[i, j]
        K[:] = -G
        solve(H, K)
        V[:] = 0.0
        add_product(A.T, VA, V)
        add_product(C.T, C, V)
        add_product(G.T, K, V)
        room.gain[i], room.change[i] = K[:, :n], K[:, n]


@compiled
def follow(foreseen, problem, room, closed):
    """Follow the changes of the commands through the model; `closed` adds what the gains make."""
    periods, m = room.change.shape
    n, axes = problem.input.shape
    per_axis = n // axes
    x, after = np.zeros(n), np.empty(n)
    for i in range(periods):
        T = foreseen.allocation[i]
        for j in range(m):
            for k in range(n if closed else 0):
                room.change[i, j] += room.gain[i, j, k] * x[k]
        for r in range(n):
            after[r] = 0.0
            for k in range(n):
                after[r] += problem.transition[r, k] * x[k]
            for axis in range(axes):
                for j in range(m):
                    after[r] += problem.input[r, axis] * T[axis, j] * room.change[i, j]
        for axis in range(axes):
            room.held[i, axis] = problem.inertia[axis] * x[per_axis * (axis + 1) - 1]
            room.error[i, axis] = after[per_axis * axis]
        x[:] = after


# Loops: numba compiles expressions of whole arrays, however short, for seconds.
@compiled
def add_share(share, X, out):
    """Add a share of a matrix to another."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] += share * X[i, j]


@piece
def change_by(share, u, foreseen, room):
    """Make a share of the change that was followed."""
    add_share(share, room.change, u)
    add_share(share, room.error, foreseen.error)
    add_share(share, room.held, foreseen.held)


@piece
def distances(u, limit):
    """How far a command is from its lower and from its upper limit, N."""
    return max(limit + u, NEAREST * limit), max(limit - u, NEAREST * limit)


@piece
def multiplier_changes(mu, low, high, below, above, change):
    """What brings the products of multipliers and distances to mu as the command changes."""
    return (mu - low * change) / below - low, (mu + high * change) / above - high


@compiled
def go_inside(u, limit, foreseen, problem, room):
    """Begin the interior-point method: away from the limits, with multipliers to match."""
    periods, m = u.shape
    inner = (1.0 - INSIDE) * limit
    for i in range(periods):
        for j in range(m):
            room.change[i, j] = min(max(u[i, j], -inner), inner) - u[i, j]
    follow(foreseen, problem, room, False)
    change_by(1.0, u, foreseen, room)
    (n, axes), rows = problem.input.shape, foreseen.allocation.shape[1]
    D, C, cost = np.empty((rows, m)), np.zeros((rows, n + 1)), 0.0
    for i in range(periods):
        T = foreseen.allocation[i]
        misses(u[i], foreseen.held[i], foreseen.wanted[i], T, problem, D, C)
        for axis in range(axes):
            cost += foreseen.error[i, axis] ** 2
        for r in range(rows):
            cost += C[r, n] ** 2
    mu = INSIDE * cost / (periods * m)
    for i in range(periods):
        for j in range(m):
            below, above = distances(u[i, j], limit)
            room.low[i, j], room.high[i, j] = mu / below, mu / above


@compiled
def step_inside(u, limit, foreseen, problem, room):
    """A step of the interior-point method."""
    periods, m = u.shape
    mu, share = 0.0, 1.0 / REACH
    for i in range(periods):
        for j in range(m):
            below, above = distances(u[i, j], limit)
            mu += room.low[i, j] * below + room.high[i, j] * above
    mu *= SHRINKING / (2 * periods * m)
    for i in range(periods):
        for j in range(m):
            below, above = distances(u[i, j], limit)
            room.curvature[i, j] = room.low[i, j] / below + room.high[i, j] / above
            room.slope[i, j] = mu / above - mu / below
    newton(u, foreseen, problem, room)
    follow(foreseen, problem, room, True)
    for i in range(periods):
        for j in range(m):
            below, above = distances(u[i, j], limit)
            low, high, change = room.low[i, j], room.high[i, j], room.change[i, j]
            by_low, by_high = multiplier_changes(mu, low, high, below, above, change)
            for distance, by in ((below, change), (above, -change), (low, by_low), (high, by_high)):
                if by < 0.0:
                    share = min(share, -distance / by)
    share *= REACH
    for i in range(periods):
        for j in range(m):
            below, above = distances(u[i, j], limit)
            low, high, change = room.low[i, j], room.high[i, j], room.change[i, j]
            by_low, by_high = multiplier_changes(mu, low, high, below, above, change)
            room.low[i, j] += share * by_low
            room.high[i, j] += share * by_high
    change_by(share, u, foreseen, room)


@piece
def stays_within(u, change, limit):
    """Whether changed commands are within their limits."""
    largest = 0.0
    for i in range(u.shape[0]):
        for j in range(u.shape[1]):
            largest = max(largest, abs(u[i, j] + change[i, j]))
    return largest <= limit


@compiled
def improve(plan, limit, foreseen, problem):
    """Improve the plans of a batch, in place, and with them what is foreseen.

    Args:
        plan: Commands, N, within their limits, (batch, periods, thrusters).
        limit: Limits of the thrusters, N, (batch,).
        foreseen: What comes of the plans.
        problem: What they share.
    """
    size, periods, m = plan.shape
    n, axes = problem.input.shape
    gain, changes = np.empty((periods, m, n)), np.empty((2, periods, axes))
    rest = np.empty((5, periods, m))
    room = Room(gain, rest[0], changes[0], changes[1], rest[1], rest[2], rest[3], rest[4])
    for b in range(size):
        u = plan[b]
        own = Foreseen(
            foreseen.error[b], foreseen.held[b], foreseen.wanted[b], foreseen.allocation[b]
        )
        room.curvature[:] = 0.0
        room.slope[:] = 0.0
        newton(u, own, problem, room)
        follow(own, problem, room, True)
        if stays_within(u, room.change, limit[b]):
            change_by(1.0, u, own, room)
            continue
        go_inside(u, limit[b], own, problem, room)
        for _ in range(STEPS):
            step_inside(u, limit[b], own, problem, room)
