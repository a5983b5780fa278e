"""Thruster commands over a horizon within the thrusters' limits: a quadratic program.

Of a plan it is known what comes of it. What changes of the commands add to that is taken from the
linear model of the straight body (`kalman`), and the changes are to minimise, summed over the
horizon,

    |error|^2 + variation^2 |T u - thrust|^2 + moment^2 (t u - moment)^2 + effort^2 |u|^2

with the commands u of a period within their limits, T the rows of the allocation matrix for the
forces and t that for the moment. If no limit is met, this is one Newton step, from a Riccati
recursion over the horizon. Else a primal-dual interior-point method takes some, each of them the
same recursion with a term for each limit (C. V. Rao, S. J. Wright, J. B. Rawlings, Application of
interior-point methods to model predictive control, Journal of Optimization Theory and Applications
99, 1998).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.estimation.kalman import COMMAND, ERROR, RATE, THRUST
from usm_baselines.signals import Array
from usm_gym.kernels.compile import compiled

# Axes, numbers of each, and of both: error, its rate, thrust over inertia.
AXES, PER_AXIS = 2, 3
NUMBERS = AXES * PER_AXIS
# Of the interior-point method: steps, the share of the distance to the limits that a step leaves
# at least, and by what the complementarity is to shrink in each.
STEPS, LEFT, SHRINKING = 14, 0.01, 0.15
# It begins this share of a limit inside it.
INSIDE = 0.1


class Foreseen(NamedTuple):
    """What comes of the plans of a batch of robots.

    Attributes:
        error: Position errors at the end of each period, m, (batch, periods, 2).
        thrust: Forces of the thrusters at its beginning along the axes, N, (batch, periods, 2).
        moment: Wanted moment, N m, (batch, periods).
        allocation: Allocation matrices, (batch, periods, 3, thrusters).
    """

    error: Array
    thrust: Array
    moment: Array
    allocation: Array


class Problem(NamedTuple):
    """What the plans of all robots share.

    Attributes:
        transition: Of (error, rate, thrust over inertia) of both axes over a period, (6, 6).
        input: What a unit of force commanded in an axis adds to them, (6, 2).
        inertia: Inertia of the axes, kg, (2,).
        variation: Error that is as bad as 1 N between command and thrust in an axis, m/N.
        moment: Error that is as bad as 1 N m too much or too little, m/(N m).
        effort: Error that is as bad as 1 N of a thruster, m/N.
    """

    transition: Array
    input: Array
    inertia: Array
    variation: float
    moment: float
    effort: float


class Room(NamedTuple):
    """Where one robot's plan is worked on.

    Attributes:
        gain: Change of the commands over change of the state, (periods, thrusters, 6).
        change: Change of the commands, N, (periods, thrusters).
        curvature: Second derivatives that the limits add, (periods, thrusters).
        slope: First derivatives that they add, (periods, thrusters).
        low: Multipliers of the lower limits, (periods, thrusters).
        high: Multipliers of the upper limits, (periods, thrusters).
    """

    gain: Array
    change: Array
    curvature: Array
    slope: Array
    low: Array
    high: Array


def problem_of(transition: Array, inertia: Array, weights: tuple[float, float, float]) -> Problem:
    """The problem of a robot whose axes have these transitions (`kalman`), (2, 4, 6)."""
    kept = [ERROR, RATE, THRUST]
    A, B = np.zeros((NUMBERS, NUMBERS)), np.zeros((NUMBERS, AXES))
    for axis in range(AXES):
        place = slice(PER_AXIS * axis, PER_AXIS * (axis + 1))
        A[place, place] = transition[axis][np.ix_(kept, kept)]
        B[place, axis] = transition[axis][kept, COMMAND] / inertia[axis]
    return Problem(A, B, inertia, *weights)


@compiled
def add_product(X, Y, out):
    """Add X Y to a matrix."""
    for i in range(out.shape[0]):
        for k in range(Y.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] += X[i, k] * Y[k, j]


@compiled
def factorise(H):
    """Cholesky factor of a matrix, in its lower triangle."""
    for i in range(H.shape[0]):
        for j in range(i + 1):
            total = H[i, j]
            for k in range(j):
                total -= H[i, k] * H[j, k]
            H[i, j] = np.sqrt(total) if i == j else total / H[j, j]


@compiled
def solve(L, X):
    """Solve L L^T X = X in place, X of any number of columns."""
    n = L.shape[0]
    for i in range(n):
        for c in range(X.shape[1]):
            for k in range(i):
                X[i, c] -= L[i, k] * X[k, c]
            X[i, c] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for c in range(X.shape[1]):
            for k in range(i + 1, n):
                X[i, c] -= L[k, i] * X[k, c]
            X[i, c] /= L[i, i]


@compiled
def newton(u, error, thrust, moment, allocation, problem, room):
    """Find the Newton step: fills in `gain`, and `change` for a state that has not changed."""
    periods, m = u.shape
    n = NUMBERS
    A, At = problem.transition, problem.transition.T.copy()
    # The last column of each is the linear part, so V is (value's Hessian, gradient).
    V, VA = np.zeros((n, n + 1)), np.empty((n, n + 1))
    B, VB = np.empty((n, m)), np.empty((n, m))
    H, K, rest = np.empty((m, m)), np.empty((m, n + 1)), np.empty((m, n + 1))
    D, C = np.empty((AXES + 1, m)), np.zeros((AXES + 1, n + 1))
    for i in range(periods - 1, -1, -1):
        T = allocation[i]
        for r in range(AXES + 1):
            weight = problem.variation if r < AXES else problem.moment
            target = thrust[i, r] if r < AXES else moment[i]
            C[r, n] = -weight * target
            for j in range(m):
                D[r, j] = weight * T[r, j]
                C[r, n] += D[r, j] * u[i, j]
            if r < AXES:
                C[r, PER_AXIS * r + 2] = -weight * problem.inertia[r]
        B[:] = 0.0
        add_product(problem.input, T[:AXES], B)
        for axis in range(AXES):
            V[PER_AXIS * axis, PER_AXIS * axis] += 1.0
            V[PER_AXIS * axis, n] += error[i, axis]
        VA[:] = 0.0
        add_product(V[:, :n], A, VA[:, :n])
        VA[:, n] = V[:, n]
        VB[:] = 0.0
        add_product(V[:, :n], B, VB)
        H[:] = 0.0
        add_product(B.T, VB, H)
        add_product(D.T, D, H)
        K[:] = 0.0
        add_product(B.T, VA, K)
        add_product(D.T, C, K)
        for j in range(m):
            H[j, j] += problem.effort**2 + room.curvature[i, j]
            K[j, n] += problem.effort**2 * u[i, j] + room.slope[i, j]
        V[:] = 0.0
        add_product(At, VA, V)
        add_product(C[:, :n].T, C, V)
        rest[:] = K
        factorise(H)
        solve(H, K)
        K *= -1.0
        add_product(rest[:, :n].T, K, V)
        for r in range(n):
            for c in range(r):
                V[r, c] = V[c, r]
        room.gain[i] = K[:, :n]
        room.change[i] = K[:, n]


@compiled
def follow(problem, allocation, room, error_change, thrust_change, closed):
    """Follow changes of the commands through the model; closed: with their gains on the state."""
    periods, m = room.change.shape
    x, y = np.zeros(NUMBERS), np.empty(NUMBERS)
    for i in range(periods):
        for axis in range(AXES):
            thrust_change[i, axis] = problem.inertia[axis] * x[PER_AXIS * axis + 2]
        if closed:
            for j in range(m):
                for k in range(NUMBERS):
                    room.change[i, j] += room.gain[i, j, k] * x[k]
        y[:] = 0.0
        for axis in range(AXES):
            force = 0.0
            for j in range(m):
                force += allocation[i, axis, j] * room.change[i, j]
            for k in range(NUMBERS):
                y[k] += problem.input[k, axis] * force
        for r in range(NUMBERS):
            for k in range(NUMBERS):
                y[r] += problem.transition[r, k] * x[k]
        x[:] = y
        for axis in range(AXES):
            error_change[i, axis] = x[PER_AXIS * axis]


@compiled
def improve(plan, limit, foreseen, problem):
    """Improve the plans of a batch, in place.

    Args:
        plan: Commands of the thrusters in each period, N, (batch, periods, thrusters).
        limit: Limits of the thrusters, N, (batch,).
        foreseen: What comes of the plans.
        problem: What they share.
    """
    size, periods, m = plan.shape
    room = Room(
        np.empty((periods, m, NUMBERS)),
        np.empty((periods, m)),
        np.empty((periods, m)),
        np.empty((periods, m)),
        np.empty((periods, m)),
        np.empty((periods, m)),
    )
    error_change, thrust_change = np.empty((periods, AXES)), np.empty((periods, AXES))
    for b in range(size):
        u, L = plan[b], limit[b]
        error, thrust = foreseen.error[b], foreseen.thrust[b]
        moment, T = foreseen.moment[b], foreseen.allocation[b]
        room.curvature[:] = 0.0
        room.slope[:] = 0.0
        newton(u, error, thrust, moment, T, problem, room)
        follow(problem, T, room, error_change, thrust_change, True)
        inside = True
        for i in range(periods):
            for j in range(m):
                inside &= abs(u[i, j] + room.change[i, j]) <= L
        if inside:
            u += room.change
            continue
        for i in range(periods):
            for j in range(m):
                room.change[i, j] = min(max(u[i, j], (INSIDE - 1) * L), (1 - INSIDE) * L) - u[i, j]
        follow(problem, T, room, error_change, thrust_change, False)
        u += room.change
        error += error_change
        thrust += thrust_change
        cost = 0.0
        for i in range(periods):
            for axis in range(AXES):
                cost += error[i, axis] ** 2
        mu = 0.1 * cost / (periods * m)
        for i in range(periods):
            for j in range(m):
                room.low[i, j] = mu / (L + u[i, j])
                room.high[i, j] = mu / (L - u[i, j])
        for _ in range(STEPS):
            mu = 0.0
            for i in range(periods):
                for j in range(m):
                    mu += room.low[i, j] * (L + u[i, j]) + room.high[i, j] * (L - u[i, j])
            mu *= SHRINKING / (2 * periods * m)
            for i in range(periods):
                for j in range(m):
                    below, above = L + u[i, j], L - u[i, j]
                    room.curvature[i, j] = room.low[i, j] / below + room.high[i, j] / above
                    room.slope[i, j] = mu / above - mu / below
            newton(u, error, thrust, moment, T, problem, room)
            follow(problem, T, room, error_change, thrust_change, True)
            share = 1.0 / (1.0 - LEFT)
            for i in range(periods):
                for j in range(m):
                    below, above, du = L + u[i, j], L - u[i, j], room.change[i, j]
                    low, high = room.low[i, j], room.high[i, j]
                    d_low = (mu - low * du) / below - low
                    d_high = (mu + high * du) / above - high
                    if du < 0.0:
                        share = min(share, -below / du)
                    if du > 0.0:
                        share = min(share, above / du)
                    if d_low < 0.0:
                        share = min(share, -low / d_low)
                    if d_high < 0.0:
                        share = min(share, -high / d_high)
            share *= 1.0 - LEFT
            for i in range(periods):
                for j in range(m):
                    below, above, du = L + u[i, j], L - u[i, j], room.change[i, j]
                    low, high = room.low[i, j], room.high[i, j]
                    room.low[i, j] += share * ((mu - low * du) / below - low)
                    room.high[i, j] += share * ((mu + high * du) / above - high)
                    u[i, j] += share * du
            error += share * error_change
            thrust += share * thrust_change
