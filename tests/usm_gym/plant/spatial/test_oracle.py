"""The dense spatial oracle keeps the laws and agrees with two plants that share no code with it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from support import planar_twin
from support import spatial_oracle as oracle
from support.spatial_swimming import (
    ROBOTS,
    SpatialState,
    at_rest,
    attitude_rate,
    moved,
    random_state,
    relative_difference,
    rotated,
    unit_quaternion,
    without_drag,
)
from support.swimming import random_state as random_planar_state

import usm_gym
from usm_gym.spatial_robot import EELY_NEUTRAL, SpatialRobot

Array = NDArray[np.float64]

every_robot = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
STEP = 1e-30  # of the complex-step derivative: no difference, so no cancellation


@every_robot
def test_agrees_with_mujoco_without_fluid(robot: SpatialRobot) -> None:
    mujoco = pytest.importorskip("mujoco")
    from support import spatial_mujoco

    dry = replace(without_drag(robot), added_mass_along=0.0, added_mass_across=0.0)
    model = mujoco.MjModel.from_xml_string(spatial_mujoco.mjcf(dry))
    rng = np.random.default_rng(0)
    for _ in range(10):
        state = random_state(dry, rng)._replace(current=np.zeros(3))
        expected = spatial_mujoco.accelerations(model, dry, *state[:-1])
        assert relative_difference(oracle.accelerations(dry, *state), expected) < 1e-11


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("links", [2, 3, 10, 16])
def test_a_chain_in_the_plane_moves_as_the_planar_robot(links: int, up: str) -> None:
    robot = planar_twin.planar_robot(links)
    twin = planar_twin.twin(robot, up)
    rng = np.random.default_rng(links)
    for _ in range(10):
        state = random_planar_state(robot, rng)
        planar = usm_gym.accelerations(robot, *state)
        expected = planar_twin.twin_accelerations(robot, state, *planar, up)
        turned = planar_twin.twin_state(robot, state, robot.linear_yaw_drag, up)
        actual = oracle.accelerations(twin, *turned, gauss_points=1)
        assert relative_difference(actual, expected) < 1e-12


def test_a_straight_body_carries_a_fifth_of_its_water_along() -> None:
    robot, forces = EELY_NEUTRAL, np.array([0.0, 0.0, 0.0, 3.0, 3.0, 0.0, 0.0])
    state = at_rest(robot)._replace(thruster_forces=forces)
    linear, *others = oracle.accelerations(robot, *state)
    expected = [6.0 / (1.2 * robot.total_mass), 0.0, 0.0]
    np.testing.assert_allclose(linear, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(np.concatenate(others), 0.0, rtol=0.0, atol=1e-12)


@every_robot
def test_knows_no_north_and_without_gravity_no_up(robot: SpatialRobot) -> None:
    rng = np.random.default_rng(0)
    weightless = replace(robot, gravity=0.0)
    for _ in range(3):
        state, heading, turn = random_state(robot, rng), rng.normal(), unit_quaternion(rng)
        about_z = np.array([np.cos(heading), 0.0, 0.0, np.sin(heading)])
        assert rotation_matters(robot, state, about_z) < 1e-13
        assert rotation_matters(weightless, state, turn) < 1e-13
        if robot is not EELY_NEUTRAL:
            assert rotation_matters(robot, state, turn) > 1e-6


def rotation_matters(robot: SpatialRobot, state: SpatialState, turn: Array) -> float:
    """Return by how much the accelerations of a turned state are not the turned ones."""
    linear, *others = oracle.accelerations(robot, *state)
    actual = oracle.accelerations(robot, *rotated(state, turn))
    return relative_difference(actual, (oracle.rotation_of(turn) @ linear, *others))


@every_robot
def test_only_velocity_relative_to_the_water_matters(robot: SpatialRobot) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        state = random_state(robot, rng)
        actual = oracle.accelerations(robot, *moved(state, rng.normal(size=3)))
        assert relative_difference(actual, oracle.accelerations(robot, *state)) < 1e-13


@every_robot
def test_water_that_accelerates_upwards_is_more_gravity(robot: SpatialRobot) -> None:
    state = random_state(robot, np.random.default_rng(0))
    rising = np.array([0.0, 0.0, 1.5])
    linear, *others = oracle.accelerations(robot, *state, current_rate=rising)
    heavy = replace(robot, gravity=robot.gravity + 1.5)
    expected = oracle.accelerations(heavy, *state)
    assert relative_difference((linear - rising, *others), expected) < 1e-13


def test_accelerating_water_carries_along_what_has_its_density() -> None:
    state = random_state(EELY_NEUTRAL, np.random.default_rng(0))
    rate = np.array([0.3, -0.2, 0.5])
    linear, *others = oracle.accelerations(EELY_NEUTRAL, *state, current_rate=rate)
    expected = oracle.accelerations(EELY_NEUTRAL, *state)
    assert relative_difference((linear - rate, *others), expected) < 1e-13


@every_robot
@pytest.mark.parametrize("speed", [1.0, 20.0])
def test_energy_changes_by_the_power_of_joints_and_thrusters(
    robot: SpatialRobot, speed: float
) -> None:
    ideal, rng = without_drag(robot), np.random.default_rng(0)
    for _ in range(3):
        state = fast_state(ideal, rng, speed)
        powers = [*state.joint_rates * state.joint_torques, *thruster_powers(ideal, state)]
        turnover = oracle.energy(ideal, *state.motion(), np.zeros(3)) * fastest(state)
        scale = abs(turnover) + np.abs(powers).sum()
        rate = rate_of_change(oracle.energy, ideal, state, np.zeros(3))
        assert abs(rate - sum(powers)) < 1e-13 * scale


@every_robot
@pytest.mark.parametrize("speed", [1.0, 20.0])
def test_impulse_changes_by_thrust_and_weight(robot: SpatialRobot, speed: float) -> None:
    ideal, rng = without_drag(robot), np.random.default_rng(0)
    for _ in range(3):
        state, position = fast_state(ideal, rng, speed), rng.normal(size=3)
        body = oracle.links(ideal, *state.motion(), position)
        wrenches = oracle.thrust(ideal, state.thruster_forces)
        wrenches += oracle.weight(ideal, body, np.zeros(3))
        force = np.einsum("kij,kj->ki", body.rotation, wrenches[:, :3])
        moment = np.einsum("kij,kj->ki", body.rotation, wrenches[:, 3:])
        moment += np.cross(body.centre, force)
        expected = np.concatenate([force.sum(axis=0), moment.sum(axis=0)])
        size = np.abs(oracle.impulse(ideal, *state.motion(), position)).max() * fastest(state)
        scale = size + np.abs(force).sum() + np.abs(moment).sum()
        rate = rate_of_change(oracle.impulse, ideal, state, position)
        np.testing.assert_allclose(rate, expected, rtol=0.0, atol=1e-13 * scale)


@every_robot
def test_drag_takes_energy(robot: SpatialRobot) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        state = random_state(robot, rng).coasting()
        assert rate_of_change(oracle.energy, robot, state, np.zeros(3)) < 0.0


def fast_state(robot: SpatialRobot, rng: np.random.Generator, speed: float) -> SpatialState:
    """Draw a state whose joints turn at about twice `speed`, rad/s."""
    state = random_state(robot, rng)
    return state._replace(joint_rates=speed * state.joint_rates)


def fastest(state: SpatialState) -> float:
    """Return the largest rate of turning, rad/s."""
    return float(np.max(np.abs([*state.joint_rates, *state.angular_velocity])))


def thruster_powers(robot: SpatialRobot, state: SpatialState) -> Array:
    """Return what the thrusters do to the links in the frame of the water, W, by component."""
    body = oracle.links(robot, *state.motion())
    return np.ravel(oracle.in_link_axes(body) * oracle.thrust(robot, state.thruster_forces))


def rate_of_change(
    function: Callable[..., Array], robot: SpatialRobot, state: SpatialState, position: Array
) -> Array:
    """Return the derivative of an energy or impulse along the motion, by a complex step."""
    linear, angular, joints = oracle.accelerations(robot, *state)
    quaternion, omega, velocity, _, rates = state.motion()
    rise = (attitude_rate(quaternion, omega), angular, linear, rates, joints, velocity)
    moving = (*state.motion(), position)
    ahead = [value + 1j * STEP * by for value, by in zip(moving, rise, strict=True)]
    return np.imag(function(robot, *ahead)) / STEP


def test_drag_of_a_link_follows_its_formulas() -> None:
    robot = EELY_NEUTRAL
    rho, r, L = robot.water_density, robot.radii, robot.lengths

    def drag(*V: float, points: int = 5) -> Array:
        return oracle.drag(robot, np.tile(V, (len(L), 1)), points).T

    u = -0.3
    surge = -0.5 * rho * np.pi * r**2 * 0.2 * abs(u) * u - 0.1 * 0.1 * rho * r * L * u
    assert_wrench(drag(u, 0.0, 0.0, 0.0, 0.0, 0.0), {0: surge})
    roll = -0.5 * rho * L * np.pi * r**4 * 0.1 * abs(u) * u - 0.1 * 0.1 * rho * r**3 * L * u
    assert_wrench(drag(0.0, 0.0, 0.0, u, 0.0, 0.0), {3: roll})
    size = rho * r * L * (0.5 * 0.5 + 0.1)  # the water comes at 0.5 m/s from the side and below
    assert_wrench(drag(0.0, 0.3, 0.4, 0.0, 0.0, 0.0), {1: -0.3 * size, 2: -0.4 * size})
    for axis in (4, 5):
        turning = np.eye(6)[axis] * 2.0
        yaw = -rho * r * (0.5 * 2.0**2 * L**4 / 32 + 0.1 * 2.0 * L**3 / 12)
        assert_wrench(drag(*turning, points=200), {axis: yaw}, 1e-5)
        assert_wrench(drag(*turning), {axis: yaw}, 5e-3)


def assert_wrench(actual: Array, expected: dict[int, Array], tolerance: float = 1e-14) -> None:
    """Compare wrenches of all links, (6, n), with the components that are not zero."""
    whole = np.zeros_like(actual)
    whole[list(expected)] = list(expected.values())
    np.testing.assert_allclose(actual, whole, rtol=tolerance, atol=1e-14)
