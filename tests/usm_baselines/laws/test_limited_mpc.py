"""With limits that bind nowhere it is `mpc`; where they bind, no command is beyond them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from usm_baselines.estimation import kalman
from usm_baselines.laws.limited_mpc import EFFORT_WEIGHT, MOMENT_WEIGHT
from usm_baselines.laws.mpc import forced_response
from usm_baselines.planning import Foreseen, improve, problem_of
from usm_baselines.registry import make

from usm_gym import Robot
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import sample
from usm_gym.world import world_of

PERIODS, THRUSTERS, WEIGHT = 8, 5, 5e-5
better: Any = improve


def actions(limit: float, periods: int, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """What both laws do along an episode that `mpc` steers; off its path by noise."""
    conditions = replace(PRESETS["field"], thruster_limit=limit, position_noise=noise)
    scenario = sample("operation", conditions, np.random.default_rng(1))
    simulation = Simulation([scenario])
    laws = [make(id, scenario.nominal) for id in ("mpc", "mpc-limits")]
    states: list[Any] = [None, None]
    taken: list[list[np.ndarray]] = [[], []]
    for _ in range(periods):
        for k, law in enumerate(laws):
            action, states[k] = law.predict(simulation.observation, states[k])
            taken[k].append(action[0])
        simulation.step(taken[0][-1][np.newaxis])
    return np.array(taken[0]), np.array(taken[1])


def test_without_binding_limits_it_is_mpc() -> None:
    plain, limited = actions(1000.0, 100, 5e-5)
    assert np.abs(plain).max() < 0.5
    np.testing.assert_allclose(limited, plain, atol=5e-3 * np.abs(plain).max())


def test_where_limits_bind_it_keeps_them_and_mpc_does_not() -> None:
    plain, limited = actions(0.5, 100, 5e-5)
    assert np.abs(plain).max() > 1.0
    assert np.abs(limited).max() <= 1.0
    assert np.abs(limited).max() > 0.99


def test_the_plan_is_the_best_of_all_changes_within_the_limits() -> None:
    # Independently: the dense least squares of `mpc`, with commands for changes of the force.
    rng, inertia = np.random.default_rng(2), world_of(Robot()).straight_body[0]
    transition = np.stack([kalman.sampled(damping, 0.05, 0.02) for damping in (0.3, 8.0)])
    moment, effort = MOMENT_WEIGHT * WEIGHT, EFFORT_WEIGHT * WEIGHT
    given = problem_of(transition, inertia, WEIGHT, moment, effort, changes=True)
    T, last = rng.normal(size=(3, THRUSTERS)), rng.uniform(-4.0, 4.0, THRUSTERS)
    free, wanted = rng.normal(0.0, 5e-3, (PERIODS, 2)), 3.0
    steps = [forced_response(each, PERIODS) for each in transition]
    whole = np.kron(np.eye(PERIODS), np.eye(THRUSTERS))
    rows, right = [], []
    # Changes of the force from period to period, from the commands of all periods.
    difference = np.eye(PERIODS) - np.eye(PERIODS, k=-1)
    for axis in range(2):
        change = np.kron(difference, T[axis : axis + 1])
        first = np.zeros(PERIODS)
        first[0] = T[axis] @ last
        rows += [steps[axis] @ change / inertia[axis], WEIGHT * change]
        right += [steps[axis] @ first / inertia[axis] - free[:, axis], WEIGHT * first]
    rows += [moment * np.kron(np.eye(PERIODS), T[2:]), effort * whole]
    right += [np.full(PERIODS, moment * wanted), np.zeros(PERIODS * THRUSTERS)]
    A, b = 1e4 * np.vstack(rows), 1e4 * np.concatenate(right)
    best = lsq_linear(A, b, (-4.0, 4.0), method="bvls", tol=1e-14)
    assert np.count_nonzero(best.active_mask) > 3

    plan = np.tile(last, (1, PERIODS, 1))
    held = np.tile(T[:2] @ last, (1, PERIODS, 1))
    allocation = np.tile(T, (1, PERIODS, 1, 1))
    foreseen = Foreseen(free[np.newaxis].copy(), held, np.full((1, PERIODS, 1), wanted), allocation)
    better(plan, np.array([4.0]), foreseen, given)
    assert np.sum((A @ plan.ravel() - b) ** 2) == pytest.approx(2.0 * best.cost, rel=1e-3)
