"""The plant knows no handedness, no north and no absolute rest, and swims as fast as it must."""

import numpy as np
import pytest
from numpy.typing import NDArray
from support.swimming import State, random_state, relative_difference, swim, swimmer

import usm_gym
from usm_gym import Robot

Array = NDArray[np.float64]

MIRROR = np.array([1.0, -1.0])  # y -> -y


@pytest.mark.parametrize("hydrodynamics", ["consistent", "kelasidi2014"])
@pytest.mark.parametrize("links", [2, 3, 16])
def test_mirrored_states_accelerate_mirrored(links: int, hydrodynamics: str) -> None:
    robot = swimmer(links)
    sides = [1.0 if thruster.direction == "axial" else -1.0 for thruster in robot.thrusters]
    rng = np.random.default_rng(links)
    for _ in range(50):
        state = random_state(robot, rng)
        mirrored = State(
            theta=-state.theta,
            theta_dot=-state.theta_dot,
            p_dot=MIRROR * state.p_dot,
            joint_torques=-state.joint_torques,
            thruster_forces=np.array(sides) * state.thruster_forces,
            current=MIRROR * state.current,
        )
        theta_ddot, p_ddot = usm_gym.accelerations(robot, *state, hydrodynamics=hydrodynamics)
        actual = usm_gym.accelerations(robot, *mirrored, hydrodynamics=hydrodynamics)
        assert relative_difference(actual, (-theta_ddot, MIRROR * p_ddot)) < 1e-12


@pytest.mark.parametrize("hydrodynamics", ["consistent", "kelasidi2014"])
@pytest.mark.parametrize("links", [2, 3, 16])
def test_rotated_states_accelerate_rotated(links: int, hydrodynamics: str) -> None:
    robot = swimmer(links)
    rng = np.random.default_rng(links)
    for _ in range(50):
        state = random_state(robot, rng)
        angle = rng.uniform(-np.pi, np.pi)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        rotated = state._replace(
            theta=state.theta + angle, p_dot=turn @ state.p_dot, current=turn @ state.current
        )
        theta_ddot, p_ddot = usm_gym.accelerations(robot, *state, hydrodynamics=hydrodynamics)
        actual = usm_gym.accelerations(robot, *rotated, hydrodynamics=hydrodynamics)
        assert relative_difference(actual, (theta_ddot, turn @ p_ddot)) < 1e-11


def difference_on_a_moving_train(robot: Robot, state: State, hydrodynamics: str) -> float:
    """Return how much an equal addition to the velocities of robot and water matters."""
    train = np.array([0.7, -0.4])
    moved = state._replace(p_dot=state.p_dot + train, current=state.current + train)
    return relative_difference(
        usm_gym.accelerations(robot, *moved, hydrodynamics=hydrodynamics),
        usm_gym.accelerations(robot, *state, hydrodynamics=hydrodynamics),
    )


@pytest.mark.parametrize("links", [2, 3, 16])
def test_only_velocity_relative_to_the_water_matters(links: int) -> None:
    robot = swimmer(links)
    rng = np.random.default_rng(links)
    for _ in range(50):
        state = random_state(robot, rng)
        assert difference_on_a_moving_train(robot, state, "consistent") < 1e-11


def test_the_published_form_is_not_galilean() -> None:
    robot = swimmer(16)
    state = random_state(robot, np.random.default_rng(0))
    assert difference_on_a_moving_train(robot, state, "kelasidi2014") > 1e-3


def straight_at_rest(robot: Robot, thruster_forces: Array, joint_torques: Array) -> State:
    """Return a straight robot along x, at rest in still water, under these inputs."""
    zeros = np.zeros(2)
    still = np.zeros(robot.links)
    return State(still, still, zeros, joint_torques, thruster_forces, zeros)


def speed(force: float, drag: float, mass: float, time: Array) -> Array:
    """Return the solution of mass v' = force - drag (v + v |v|) from rest."""
    terminal = (np.sqrt(1.0 + 4.0 * abs(force) / drag) - 1.0) / 2.0  # the root where v' = 0
    decay = np.exp(-drag / mass * (1.0 + 2.0 * terminal) * time)
    ratio = terminal / (1.0 + terminal)
    return np.sign(force) * terminal * (1.0 - decay) / (1.0 + ratio * decay)


@pytest.mark.parametrize("force", [5.0, -5.0])
def test_surge_follows_the_analytic_speed(force: float) -> None:
    robot = swimmer(16)
    thrust = np.array([force, 0.0, 0.0, 0.0, 0.0])
    motion = swim(robot, straight_at_rest(robot, thrust, np.zeros(15)), duration=30.0)
    drag = robot.links * robot.tangential_drag
    expected = speed(force, drag, robot.total_mass, motion.time)
    np.testing.assert_allclose(motion.p_dot[:, 0], expected, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(motion.p_dot[:, 1], 0.0, atol=1e-9)
    np.testing.assert_allclose(motion.theta, 0.0, atol=1e-9)
    v = motion.p_dot[-1, 0]
    assert drag * (v + v * abs(v)) == pytest.approx(force, rel=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_sway_follows_the_analytic_speed(sign: float) -> None:
    robot = swimmer(16)
    thrust = sign * np.array([0.0, 10.0, 30.0, 30.0, 10.0])  # no moment: the arms are -11 -5 5 11
    state = straight_at_rest(robot, thrust, torques_that_keep_straight(robot, thrust))
    motion = swim(robot, state, duration=5.0)
    drag = robot.links * robot.normal_drag
    mass = robot.total_mass + robot.links * robot.added_mass
    expected = speed(thrust.sum(), drag, mass, motion.time)
    np.testing.assert_allclose(motion.p_dot[:, 1], expected, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(motion.p_dot[:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(motion.theta, 0.0, atol=1e-9)
    v = motion.p_dot[-1, 1]
    assert drag * (v + v * abs(v)) == pytest.approx(thrust.sum(), rel=1e-6)


def torques_that_keep_straight(robot: Robot, thruster_forces: Array) -> Array:
    """Return the joint torques that carry normal thrust on few links to all links alike."""
    load = np.zeros(robot.links)
    for thruster, force in zip(robot.thrusters, thruster_forces, strict=True):
        load[thruster.link - 1] += force
    shear = np.cumsum(load - load.mean())  # handed from link i to link i + 1
    return robot.half_length * np.cumsum(shear + np.concatenate([[0.0], shear[:-1]]))[:-1]
