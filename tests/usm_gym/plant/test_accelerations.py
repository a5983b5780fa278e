"""The fast plant agrees with two that share no code with it."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from support import oracle
from support.swimming import State, random_state, relative_difference, swimmer

import usm_gym
from usm_gym import Robot, Thruster

Array = NDArray[np.float64]


@pytest.mark.parametrize("hydrodynamics", ["consistent", "kelasidi2014"])
@pytest.mark.parametrize("links", [2, 3, 10, 16])
def test_agrees_with_the_dense_oracle(links: int, hydrodynamics: str) -> None:
    robot = swimmer(links)
    rng = np.random.default_rng(links)
    for _ in range(200):
        state = random_state(robot, rng)
        actual = usm_gym.accelerations(robot, *state, hydrodynamics=hydrodynamics)
        expected = oracle.accelerations(robot, *state, hydrodynamics=hydrodynamics)
        assert relative_difference(actual, expected) < 1e-11


@pytest.mark.parametrize("links", [3, 16])
def test_current_defaults_to_still_water_and_hydrodynamics_to_consistent(links: int) -> None:
    robot = swimmer(links)
    state = random_state(robot, np.random.default_rng(links))
    actual = usm_gym.accelerations(robot, *state[:-1])
    expected = oracle.accelerations(robot, *state[:-1], (0.0, 0.0), "consistent")
    assert relative_difference(actual, expected) < 1e-11


@pytest.mark.parametrize("links", [2, 3, 10, 16])
def test_agrees_with_mujoco_without_fluid(links: int) -> None:
    robot = replace(
        swimmer(links),
        drag_coefficient=0.0,
        friction_coefficient=0.0,
        added_mass_coefficient=0.0,
        added_inertia_coefficient=0.0,
    )
    model = mujoco.MjModel.from_xml_string(mjcf(robot))
    rng = np.random.default_rng(links)
    for _ in range(100):
        state, expected = mujoco_accelerations(model, robot, random_state(robot, rng))
        actual = usm_gym.accelerations(robot, *state)
        assert relative_difference(actual, expected) < 1e-9


@pytest.mark.parametrize("links", [2, 3, 10, 16])
def test_inertia_is_symmetric_positive_definite(links: int) -> None:
    # With three thrusters the inputs span all n + 2 generalized forces, and what the plant
    # answers to unit inputs, seen along the same inputs, is G^T M^-1 G.
    ends = (Thruster(1, "axial"), Thruster(1, "normal"), Thruster(links, "normal"))
    robot = Robot(links=links, thrusters=ends)
    rng = np.random.default_rng(links)
    for _ in range(10):
        state = random_state(robot, rng).coasting()
        rest = np.concatenate(usm_gym.accelerations(robot, *state))
        response = np.empty((links + 2, links + 2))
        for column, unit in enumerate(np.eye(links + 2)):
            pushed = state._replace(
                joint_torques=unit[: links - 1], thruster_forces=unit[links - 1 :]
            )
            response[:, column] = np.concatenate(usm_gym.accelerations(robot, *pushed)) - rest
        compliance = oracle.input_matrix(robot, state.theta).T @ response
        scale = np.max(np.abs(compliance))
        np.testing.assert_allclose(compliance, compliance.T, rtol=0.0, atol=1e-11 * scale)
        assert np.linalg.eigvalsh(compliance)[0] > 0.0


def mjcf(robot: Robot) -> str:
    """Write the bare chain: a planar root at the tail end, hinges, no gravity, no damping."""
    half, mass, inertia = robot.half_length, robot.link_mass, robot.link_inertia
    bodies = ""
    for link in reversed(range(robot.links)):
        slides = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
        bodies = (
            f'<body pos="{2 * half if link else 0!r} 0 0">'
            f"{'' if link else slides}"
            '<joint type="hinge" axis="0 0 1"/>'
            f'<inertial pos="{half!r} 0 0" mass="{mass!r}"'
            f' diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
            f"{bodies}</body>"
        )
    return f'<mujoco><option gravity="0 0 0"/><worldbody>{bodies}</worldbody></mujoco>'


def mujoco_accelerations(
    model: mujoco.MjModel, robot: Robot, state: State
) -> tuple[State, tuple[Array, Array]]:
    """Return the state with MuJoCo's own CM velocity, and (theta_ddot, p_ddot) in that state."""
    data = mujoco.MjData(model)
    data.qpos[2:] = np.diff(state.theta, prepend=0.0)
    data.qvel[:2] = state.p_dot  # of the tail end here
    data.qvel[2:] = np.diff(state.theta_dot, prepend=0.0)
    # MuJoCo's hinge i turns link i + 1 against link i: the opposite of phi_i.
    data.qfrc_applied[3:] = -state.joint_torques
    for thruster, force in zip(robot.thrusters, state.thruster_forces, strict=True):
        heading = state.theta[thruster.link - 1]
        heading += np.pi / 2 if thruster.direction == "normal" else 0.0
        data.xfrc_applied[thruster.link, :2] += force * np.cos(heading), force * np.sin(heading)
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    mujoco.mj_rnePostConstraint(model, data)
    link_accelerations = np.zeros((robot.links, 6))  # angular, then linear at the link's CM
    for link, acceleration in enumerate(link_accelerations):
        mujoco.mj_objectAcceleration(
            model, data, mujoco.mjtObj.mjOBJ_BODY, link + 1, acceleration, 0
        )
    moving = state._replace(p_dot=data.subtree_linvel[1, :2].copy())
    return moving, (np.cumsum(data.qacc[2:]), link_accelerations[:, 3:5].mean(axis=0))
