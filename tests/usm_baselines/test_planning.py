"""Plans within limits: the least squares that they solve, solved densely by another method."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from usm_baselines import planning
from usm_baselines.estimation import kalman
from usm_baselines.planning import Foreseen, Problem, problem_of

Array = NDArray[np.float64]
PERIODS, THRUSTERS = 8, 5
improve: Any = planning.improve
# Axes and moments in the plane and in space.
PLANE, SPACE = (2, 1), (3, 3)
INERTIA, DAMPING = np.array([10.6, 16.9, 13.1]), (0.3, 8.0, 2.0)


def problem(lag: float, axes: int = 2) -> Problem:
    transition = np.stack([kalman.sampled(damping, lag, 0.02) for damping in DAMPING[:axes]])
    return problem_of(transition, INERTIA[:axes], 3e-6, 1e-5, 1e-6)


def foreseen(
    rng: np.random.Generator, size: int, error: float, world: tuple[int, int] = PLANE
) -> Foreseen:
    """Errors of this size that the limits matter for, and thrusters in arbitrary directions."""
    axes, moments = world
    return Foreseen(
        rng.normal(0.0, error, (size, PERIODS, axes)),
        rng.normal(0.0, 3.0, (size, PERIODS, axes)),
        rng.normal(0.0, 5.0, (size, PERIODS, moments)),
        rng.normal(0.0, 1.0, (size, PERIODS, axes + moments, THRUSTERS)),
    )


def residuals(change: Array, plan: Array, known: Foreseen, given: Problem) -> Array:
    """What the plan of one robot is to make small, after a change of its commands."""
    axes = given.inertia.size
    x, rows = np.zeros(3 * axes), []
    for i in range(PERIODS):
        T, command = known.allocation[i], plan[i] + change[i]
        held = known.held[i] + given.inertia * x[2::3]
        x = given.transition @ x + given.input @ (T[:axes] @ change[i])
        rows += [
            known.error[i] + x[::3],
            given.variation * (T[:axes] @ command - held),
            given.moment * (T[axes:] @ command - known.wanted[i]),
            given.effort * command,
        ]
    return np.concatenate(rows)


def one(known: Foreseen, b: int) -> Foreseen:
    return Foreseen(*(each[b].copy() for each in known))


@pytest.mark.parametrize("lag", [0.0, 0.1])
@pytest.mark.parametrize("limit", [5.0, 1e6])
@pytest.mark.parametrize("world", [PLANE, SPACE])
def test_a_plan_is_the_least_squares_within_the_limits(
    lag: float, limit: float, world: tuple[int, int]
) -> None:
    rng, size = np.random.default_rng(3), 4
    known, given = foreseen(rng, size, 1e-4, world), problem(lag, world[0])
    plan = rng.uniform(-5.0, 5.0, (size, PERIODS, THRUSTERS))
    before, at = plan.copy(), [one(known, b) for b in range(size)]
    improve(plan, np.full(size, limit), known, given)
    met = 0
    for b in range(size):
        zero = residuals(np.zeros((PERIODS, THRUSTERS)), before[b], at[b], given)
        units = np.eye(PERIODS * THRUSTERS).reshape(-1, PERIODS, THRUSTERS)
        J = np.stack([residuals(unit, before[b], at[b], given) - zero for unit in units], axis=1)
        low, high = (side * limit - before[b].ravel() for side in (-1.0, 1.0))
        # Scaled, for what the solver counts as converged.
        best = lsq_linear(1e5 * J, -1e5 * zero, (low, high), method="bvls", tol=1e-12)
        expected = np.sum((J @ best.x + zero) ** 2)
        reached = np.sum(residuals(plan[b] - before[b], before[b], at[b], given) ** 2)
        assert reached == pytest.approx(expected, rel=1e-4)
        assert np.abs(plan[b]).max() <= limit * (1 + 1e-8)
        met += int(np.count_nonzero(best.active_mask))
    assert (met > 10) == (limit < 10.0)


def test_what_is_foreseen_changes_with_the_plan() -> None:
    rng = np.random.default_rng(4)
    known, given = foreseen(rng, 1, 1e-4), problem(0.1)
    plan = rng.uniform(-5.0, 5.0, (1, PERIODS, THRUSTERS))
    before, start = plan[0].copy(), one(known, 0)
    improve(plan, np.array([5.0]), known, given)
    after = residuals(plan[0] - before, before, start, given).reshape(PERIODS, -1)
    np.testing.assert_allclose(known.error[0], after[:, :2], rtol=1e-9, atol=1e-15)


def test_robots_are_planned_for_alone() -> None:
    rng, size = np.random.default_rng(5), 3
    known, given = foreseen(rng, size, 1e-4), problem(0.1)
    limit = np.array([2.0, 1e6, 10.0])
    plan = rng.uniform(-2.0, 2.0, (size, PERIODS, THRUSTERS))
    alone = [(plan[b : b + 1].copy(), one(known, b)) for b in range(size)]
    improve(plan, limit, known, given)
    for b, (own, at) in enumerate(alone):
        single = Foreseen(*(each[np.newaxis] for each in at))
        improve(own, limit[b : b + 1], single, given)
        assert np.array_equal(own[0], plan[b])
