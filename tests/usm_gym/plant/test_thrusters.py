"""Thruster allocation makes exactly the wrench asked for, with the least effort (equation 4)."""

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from support import oracle
from support.swimming import swimmer

from usm_gym import Robot, Thruster
from usm_gym.plant import push, thrusters

Array = NDArray[np.float64]

REDUNDANT = Robot(
    links=7,
    link_length=0.3,
    thrusters=(
        Thruster(2, "normal"),
        Thruster(7, "axial"),
        Thruster(4, "axial"),
        Thruster(5, "normal"),
        Thruster(7, "normal"),
        Thruster(1, "axial"),
    ),
)
ROBOTS = [Robot(), REDUNDANT, swimmer(2), swimmer(10)]


@numba.njit
def fill_in(sine, cosine, l, links, is_normal, T):  # type: ignore[no-untyped-def]
    push.allocation_matrix(sine, cosine, l, links, is_normal, T)


@numba.njit
def solve(T, wrench, forces):  # type: ignore[no-untyped-def]
    thrusters.allocate(T, wrench, 3, 0.0, np.empty((7, 3)), forces)


def allocation_matrix(robot: Robot, theta: Array) -> Array:
    T = np.full((3, len(robot.thrusters)), np.nan)
    fill_in(
        np.sin(theta),
        np.cos(theta),
        robot.half_length,
        robot.thruster_links,
        robot.thruster_is_normal,
        T,
    )
    return T


def allocate(T: Array, wrench: Array) -> Array:
    forces = np.full(T.shape[1], np.nan)
    solve(T, wrench, forces)
    return forces


def poses(robot: Robot) -> Array:
    """Return random poses from gently to wildly bent, of any heading, (100, n) rad."""
    rng = np.random.default_rng(robot.links)
    bends = rng.normal(0.0, 1.0, (100, robot.links)) * np.linspace(0.0, 1.0, 100)[:, None]
    return np.asarray(rng.uniform(-10.0, 10.0, (100, 1)) + bends)


def test_arms_of_the_straight_body() -> None:
    robot = Robot()
    l = robot.half_length
    expected = [[1, 0, 0, 0, 0], [0, 1, 1, 1, 1], [0, -11 * l, -5 * l, 5 * l, 11 * l]]
    np.testing.assert_allclose(allocation_matrix(robot, np.zeros(16)), expected, atol=1e-15)


@pytest.mark.parametrize("robot", ROBOTS)
def test_wrench_of_each_thruster_is_that_of_the_equations_of_motion(robot: Robot) -> None:
    # A turn of the whole body about its centre raises all angles alike, so the moment is the sum
    # of the generalized forces on the angles.
    for theta in poses(robot):
        G = oracle.input_matrix(robot, theta)[:, robot.links - 1 :]
        expected = np.vstack([G[robot.links :], G[: robot.links].sum(axis=0)])
        np.testing.assert_allclose(allocation_matrix(robot, theta), expected, atol=1e-13)


@pytest.mark.parametrize("robot", ROBOTS)
def test_forces_make_the_wrench_with_the_least_norm(robot: Robot) -> None:
    rng = np.random.default_rng(0)
    for theta in poses(robot):
        T = allocation_matrix(robot, theta)
        if np.linalg.cond(T) > 1e3:  # three thrusters may happen to pull nearly alike
            continue
        wrench = rng.normal(0.0, [10.0, 10.0, 5.0])
        forces = allocate(T, wrench)
        scale = np.abs(forces).max()
        np.testing.assert_allclose(T @ forces, wrench, atol=1e-10 * scale)
        np.testing.assert_allclose(forces, np.linalg.pinv(T) @ wrench, atol=1e-9 * scale)
        # Of least norm: nothing of it lies where T does not see it.
        unseen = np.linalg.svd(T)[2][3:]
        np.testing.assert_allclose(unseen @ forces, 0.0, atol=1e-9 * scale)


def test_a_straight_body_shares_out_by_arms() -> None:
    T = allocation_matrix(Robot(), np.zeros(16))
    l = Robot().half_length
    np.testing.assert_allclose(allocate(T, np.array([3.0, 0.0, 0.0])), [3, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(allocate(T, np.array([0.0, 4.0, 0.0])), [0, 1, 1, 1, 1], atol=1e-12)
    np.testing.assert_allclose(
        allocate(T, np.array([0.0, 0.0, 292.0 * l])), [0, -11, -5, 5, 11], atol=1e-11
    )
