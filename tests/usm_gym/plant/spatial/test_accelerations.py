"""The fast spatial plant agrees with the dense one, keeps the laws and refuses what is no state."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support import planar_twin
from support import spatial_oracle as oracle
from support.spatial_swimming import (
    ROBOTS,
    at_rest,
    moved,
    random_chain,
    random_state,
    relative_difference,
    rotated,
    swim,
    unit_quaternion,
    without_drag,
)
from support.swimming import random_state as random_planar_state

import usm_gym
from usm_gym.spatial_robot import EELY, EELY_NEUTRAL, SpatialRobot

Array = NDArray[np.float64]

every_robot = pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
DURATION = 5.0  # s


@every_robot
def test_agrees_with_the_dense_oracle(robot: SpatialRobot) -> None:
    rng = np.random.default_rng(1)
    for _ in range(25):
        state = random_state(robot, rng)
        actual = usm_gym.spatial_accelerations(robot, *state)
        assert [part.shape for part in actual] == [(3,), (3,), (len(robot.joint_axes),)]
        assert relative_difference(actual, oracle.accelerations(robot, *state)) < 1e-12


@every_robot
def test_agrees_in_a_straight_body_at_rest(robot: SpatialRobot) -> None:
    for forces in (np.zeros(len(robot.thrusters)), np.linspace(-20.0, 30.0, len(robot.thrusters))):
        state = at_rest(robot)._replace(thruster_forces=forces)
        actual = np.concatenate(usm_gym.spatial_accelerations(robot, *state))
        expected = np.concatenate(oracle.accelerations(robot, *state))
        scale = max(1.0, np.max(np.abs(expected)))  # a neutral robot stays at rest
        np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-12 * scale)


def test_knows_robots_by_name_and_still_water_by_default() -> None:
    for name, robot in (("eely", EELY), ("eely-neutral", EELY_NEUTRAL)):
        state = random_state(robot, np.random.default_rng(0))._replace(current=np.zeros(3))
        actual = usm_gym.spatial_accelerations(name, *state[:-1])
        assert relative_difference(actual, oracle.accelerations(robot, *state)) < 1e-12


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("links", [2, 3, 10, 16])
def test_a_chain_in_the_plane_moves_as_the_planar_robot(links: int, up: str) -> None:
    # Across the links without drag: here cross-flow drag is not that of the links' centres.
    robot = planar_twin.planar_robot(links, drag_coefficient=0.0)
    twin = planar_twin.twin(robot, up)
    rng = np.random.default_rng(links)
    for _ in range(50):
        state = random_planar_state(robot, rng)
        planar = usm_gym.accelerations(robot, *state, drag="quadratic")
        expected = planar_twin.twin_accelerations(robot, state, *planar, up)
        turned = planar_twin.twin_state(robot, state, 0.0, up)
        actual = usm_gym.spatial_accelerations(twin, *turned)
        assert relative_difference(actual, expected) < 1e-12


@every_robot
def test_knows_no_north_and_without_gravity_no_up(robot: SpatialRobot) -> None:
    rng = np.random.default_rng(0)
    for _ in range(25):
        state, heading = random_state(robot, rng), rng.normal()
        about_z = np.array([np.cos(heading), 0.0, 0.0, np.sin(heading)])
        for same, turn in ((robot, about_z), (replace(robot, gravity=0.0), unit_quaternion(rng))):
            linear, *others = usm_gym.spatial_accelerations(same, *state)
            actual = usm_gym.spatial_accelerations(same, *rotated(state, turn))
            expected = (oracle.rotation_of(turn) @ linear, *others)
            assert relative_difference(actual, expected) < 1e-12


@every_robot
def test_both_quaternions_of_an_attitude_are_the_same(robot: SpatialRobot) -> None:
    state = random_state(robot, np.random.default_rng(0))
    expected = usm_gym.spatial_accelerations(robot, *state)
    actual = usm_gym.spatial_accelerations(robot, *state._replace(quaternion=-state.quaternion))
    assert relative_difference(actual, expected) < 1e-14


@every_robot
def test_only_velocity_relative_to_the_water_matters(robot: SpatialRobot) -> None:
    rng = np.random.default_rng(0)
    for _ in range(25):
        state = random_state(robot, rng)
        expected = usm_gym.spatial_accelerations(robot, *state)
        actual = usm_gym.spatial_accelerations(robot, *moved(state, rng.normal(size=3)))
        assert relative_difference(actual, expected) < 1e-12


@pytest.mark.parametrize("name", ["eely", "eely-neutral", "eely-uneven", "4 links"])
def test_energy_and_impulse_are_conserved_without_drag(name: str) -> None:
    robot = without_drag(ROBOTS[name])
    motion = swim(robot, random_state(robot, np.random.default_rng(0)).coasting(), DURATION)
    samples = list(zip(*motion[1:], strict=True))
    energy = np.array([oracle.energy(robot, *sample) for sample in samples])
    impulse = np.array([oracle.impulse(robot, *sample) for sample in samples])
    lift = (robot.displaced_masses.sum() - robot.total_mass) * robot.gravity
    impulse[:, 2] -= lift * motion.time
    # Weight and buoyancy have moments about level axes, unless there is no righting moment.
    kept = slice(6) if name == "eely-neutral" else [0, 1, 2, 5]
    assert drift(energy) < 1e-10
    assert drift(impulse[:, kept]) < 1e-10


def drift(quantity: Array) -> float:
    """Return the largest change from the start, relative to the size at the start."""
    return float(np.max(np.abs(quantity - quantity[0])) / np.max(np.abs(quantity[0])))


def test_drag_takes_energy_at_every_moment() -> None:
    state = random_state(EELY, np.random.default_rng(0)).coasting()
    samples = zip(*swim(EELY, state, DURATION)[1:], strict=True)
    energy = np.array([oracle.energy(EELY, *sample) for sample in samples])
    assert np.all(np.diff(energy) < 0.0)


def test_a_quaternion_may_be_as_far_from_unit_length_as_it_is_rounded() -> None:
    state = random_state(EELY, np.random.default_rng(0))
    expected = usm_gym.spatial_accelerations(EELY, *state)
    for size in (1.0 - 5e-7, 1.0 + 5e-7):
        rounded = state._replace(quaternion=size * state.quaternion)
        actual = usm_gym.spatial_accelerations(EELY, *rounded)
        assert relative_difference(actual, expected) < 1e-5


SIZES = {
    "quaternion": 4,
    "angular_velocity": 3,
    "linear_velocity": 3,
    "joint_angles": 3,
    "joint_rates": 3,
    "joint_torques": 3,
    "thruster_forces": 12,
    "current": 3,
}


@pytest.mark.parametrize("size", [0.0, 1.0 - 2e-6, 1.0 + 2e-6, 2.0])
def test_a_quaternion_that_is_no_attitude_is_refused(size: float) -> None:
    refused("quaternion", size * np.array([0.5, -0.5, 0.5, -0.5]))


@pytest.mark.parametrize("name", SIZES)
def test_arguments_of_another_shape_or_not_finite_are_refused(name: str) -> None:
    good = np.ones(SIZES[name]) / np.sqrt(SIZES[name])
    refused(name, good[:-1])
    refused(name, np.append(good, 0.0))
    refused(name, 0.0)
    for bad in (np.nan, np.inf):
        refused(name, np.append(good[:-1], bad))
    refused(name, ["a"] * SIZES[name])
    refused(name, good + 1j)


def refused(name: str, value: Any) -> None:
    """Assert that a value is refused in one line that begins with the argument's name."""
    robot = random_chain(4)
    state = random_state(robot, np.random.default_rng(0))._asdict()
    assert {name: part.size for name, part in state.items()} == SIZES
    with pytest.raises(ValueError, match=f"^{name}\\b") as caught:
        usm_gym.spatial_accelerations(robot, **{**state, name: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "robot", ["snake", "paper", usm_gym.Robot()], ids=["snake", "paper", "Robot"]
)
def test_a_robot_that_is_none_in_space_is_refused(robot: Any) -> None:
    state = random_state(EELY, np.random.default_rng(0))
    with pytest.raises(ValueError, match=r"^robot\b"):
        usm_gym.spatial_accelerations(robot, *state)
