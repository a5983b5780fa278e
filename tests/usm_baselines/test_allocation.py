"""Commands within the limits are the least squares that another method finds."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear
from usm_baselines.allocation import EFFORT_WEIGHT, MOMENT_WEIGHT, nearest, outside, within
from usm_baselines.registry import make

from usm_gym import Conditions, evaluate
from usm_gym.task.sampling import sample

Array = NDArray[np.float64]
THRUSTERS, AXES = 5, 2


def problems(seed: int, size: int) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed)
    allocation = rng.normal(0.0, 1.0, (size, 3, THRUSTERS))
    return rng.normal(0.0, 8.0, (size, THRUSTERS)), np.full(size, 8.0), allocation


def test_commands_are_the_least_squares_within_the_limits() -> None:
    wanted, limit, allocation = problems(0, 40)
    command = nearest(wanted, limit, allocation, AXES)
    bound = 0
    for asked, T, u in zip(wanted, allocation, command, strict=True):
        weights = np.array([1.0, 1.0, MOMENT_WEIGHT])
        A = np.vstack([weights[:, np.newaxis] * T, EFFORT_WEIGHT * np.eye(THRUSTERS)])
        b = np.concatenate([weights * (T @ asked), np.zeros(THRUSTERS)])
        best = lsq_linear(A, b, (-8.0, 8.0), method="bvls", tol=1e-14)
        assert np.abs(u).max() <= 8.0 * (1 + 1e-8)
        if np.abs(asked).max() > 8.0:
            assert np.sum((A @ u - b) ** 2) == pytest.approx(2.0 * best.cost, rel=1e-4, abs=1e-9)
            bound += 1
    assert bound > 20


def test_no_force_is_lost_that_a_thruster_has_left() -> None:
    wanted, limit, allocation = problems(1, 200)
    command = nearest(wanted, limit, allocation, AXES)

    def missed(u: Array) -> Array:
        force = (allocation * (u - wanted)[:, np.newaxis]).sum(axis=2)[:, :2]
        return np.asarray(np.linalg.norm(force, axis=1))

    clipped = missed(np.clip(wanted, -8.0, 8.0))
    assert (missed(command) <= clipped + 1e-2).all()
    assert missed(command).mean() < 0.5 * clipped.mean()


def test_within_the_limits_nothing_changes_and_robots_are_alone() -> None:
    wanted, limit, allocation = problems(2, 30)
    inside = (np.abs(wanted) <= 8.0).all(axis=1)
    assert 0 < inside.sum() < 30
    command = nearest(wanted, limit, allocation, AXES)
    assert np.array_equal(command[inside], wanted[inside])
    for b in range(30):
        one = slice(b, b + 1)
        assert np.array_equal(nearest(wanted[one], limit[one], allocation[one], AXES), command[one])


def test_commands_keep_out_of_the_dead_band() -> None:
    asked = np.array([[0.0, 0.1, -0.1, 0.16, -0.29, 0.3, -5.0]])
    expected = np.array([[0.0, 0.0, 0.0, 0.3, -0.3, 0.3, -5.0]])
    np.testing.assert_allclose(outside(asked, 0.3), expected, rtol=2e-6)
    assert np.array_equal(outside(asked, 0.0), asked)


def test_actions_are_within_the_limits_and_outside_the_dead_band() -> None:
    wanted, limit, allocation = problems(3, 200)
    action = within((wanted / 8.0).astype(np.float32), limit, 0.3, allocation, AXES)
    assert action.dtype == np.float32
    assert np.abs(action).max() <= 1.0
    force = np.abs(action.astype(np.float64)) * 8.0
    assert ((force == 0.0) | (force >= 0.3)).all()


def test_every_law_can_have_it_and_another_word_is_refused() -> None:
    conditions = Conditions(thruster_limit=5.0)
    scenario = sample("operation", conditions, np.random.default_rng(0))
    with pytest.raises(ValueError, match="allocation is 'magic'; allowed: pseudo-inverse"):
        make("sta", scenario.nominal, allocation="magic")
    for law in ("sta", "mpc"):
        policy = make(law, scenario.nominal, allocation="quadratic program")
        assert not evaluate(policy, [scenario]).per_episode["max_error_x"][0] > 1.0
