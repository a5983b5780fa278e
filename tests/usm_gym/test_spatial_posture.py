"""Poses of a spatial robot's links against rotations that SciPy composes, link after link."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from usm_gym.spatial_posture import centre_of_mass, link_poses, roll_pitch_yaw, rotation_of
from usm_gym.spatial_robot import EELY, EELY_THRUSTERS, Link, SpatialRobot

# Two joints about axes of no special direction, so that the root is the second of three links.
SHORT = SpatialRobot(
    links=(Link(0.9, keel=0.02), Link(0.7), Link(0.5, mass=30.0)),
    joint_axes=((0.48, 0.6, 0.64), (0.0, -0.6, 0.8)),
    thrusters=tuple(
        dataclasses.replace(thruster, link=link, position=(0.2, *thruster.position[1:]))
        for thruster, link in zip(EELY_THRUSTERS, (1, 1, 2, 2, 2, 3, 3), strict=True)
    ),
)


@pytest.mark.parametrize("robot", [EELY, SHORT], ids=["eely", "short"])
def test_links_turn_about_their_joints_and_hang_together(robot):
    random = np.random.default_rng(3)
    root = len(robot.links) // 2
    for _ in range(20):
        position, angles = random.normal(size=3), random.uniform(-2, 2, len(robot.joint_axes))
        attitude = Rotation.random(rng=random)
        x, y, z, w = 3 * attitude.as_quat()
        rotations, centres = link_poses(robot, position, (w, x, y, z), angles)
        np.testing.assert_allclose(rotations[root], attitude.as_matrix(), atol=1e-14)
        np.testing.assert_allclose(centres[root], position, atol=1e-15)
        for i, (axis, angle) in enumerate(zip(robot.joint_axes, angles, strict=True)):
            turn = Rotation.from_rotvec(angle * np.array(axis))
            expected = (Rotation.from_matrix(rotations[i]) * turn).as_matrix()
            np.testing.assert_allclose(rotations[i + 1], expected, atol=1e-13)
            tip = centres[i] + rotations[i] @ (robot.lengths[i] / 2, 0, 0)
            base = centres[i + 1] - rotations[i + 1] @ (robot.lengths[i + 1] / 2, 0, 0)
            np.testing.assert_allclose(tip, base, atol=1e-14)


def test_robots_in_a_batch_are_where_each_is_alone():
    random = np.random.default_rng(4)
    position, quaternion = random.normal(size=(5, 2, 3)), random.normal(size=(5, 2, 4))
    angles = random.normal(size=(5, 2, 8))
    rotations, centres = link_poses(EELY, position, quaternion, angles)
    masses = centre_of_mass(EELY, rotations, centres)
    assert (rotations.shape, centres.shape) == ((5, 2, 9, 3, 3), (5, 2, 9, 3))
    for k in np.ndindex(5, 2):
        alone = link_poses(EELY, position[k], quaternion[k], angles[k])
        np.testing.assert_allclose(rotations[k], alone[0], atol=1e-15)
        np.testing.assert_allclose(centres[k], alone[1], atol=1e-15)
        np.testing.assert_allclose(masses[k], centre_of_mass(EELY, *alone), atol=1e-15)


def test_a_positive_pan_turns_the_head_left_and_a_positive_tilt_lowers_it():
    for joint, side in ((6, (0, 1, 0)), (7, (0, 0, -1))):
        angles = np.zeros(8)
        angles[joint] = 0.3
        rotations, centres = link_poses(EELY, (0, 0, 0), (1, 0, 0, 0), angles)
        assert centres[-1] @ side > 0.05
        np.testing.assert_allclose(centres[:joint, 1:], 0, atol=1e-15)
        assert rotations[-1, :, 0] @ side == pytest.approx(np.sin(0.3))


def test_the_centre_of_mass_is_the_mean_of_the_links_by_mass_and_hangs_below():
    rotations, centres = link_poses(SHORT, (1, 2, 3), (1, 0, 0, 0), (0, 0))
    volumes = np.pi * 0.09**2 * np.array([0.9, 0.7])
    masses = np.array([*(1000 * volumes), 30.0])
    # Lengths of 0.9, 0.7 and 0.5 m, with the middle of the second at x = 1 m.
    x = masses @ np.array([1 - 0.8, 1.0, 1 + 0.6]) / masses.sum()
    z = 3 - 0.02 * masses[0] / masses.sum()
    np.testing.assert_allclose(centre_of_mass(SHORT, rotations, centres), (x, 2, z), atol=1e-12)


def test_roll_pitch_and_yaw_are_those_of_scipy():
    random = np.random.default_rng(5)
    turns = Rotation.random(50, rng=random)
    quaternions = turns.as_quat(scalar_first=True)
    np.testing.assert_allclose(rotation_of(quaternions), turns.as_matrix(), atol=1e-14)
    yaw_first = turns.as_euler("ZYX")
    np.testing.assert_allclose(roll_pitch_yaw(turns.as_matrix()), yaw_first[:, ::-1], atol=1e-12)
