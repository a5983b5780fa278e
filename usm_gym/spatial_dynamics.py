"""The forward dynamics of a spatial robot as one function of plain arrays."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from usm_gym.dynamics import CHUNK, Array, broadcast, vectors
from usm_gym.plant.spatial import layout as rows
from usm_gym.plant.spatial.chain import accelerate_all
from usm_gym.robots import spatial_robot_of
from usm_gym.spatial_packing import spatial_plant, spatial_row
from usm_gym.spatial_robot import UNIT_TOLERANCE, SpatialRobot
from usm_gym.support.validation import require


def spatial_accelerations(
    robot: SpatialRobot | str,
    quaternion: ArrayLike,
    angular_velocity: ArrayLike,
    linear_velocity: ArrayLike,
    joint_angles: ArrayLike,
    joint_rates: ArrayLike,
    joint_torques: ArrayLike,
    thruster_forces: ArrayLike,
    current: ArrayLike = (0.0, 0.0, 0.0),
) -> tuple[Array, Array, Array]:
    """Compute the accelerations of a spatial robot in given states (docs/model_spatial.md).

    The middle link is number n // 2 + 1 of n links from the tail. Its axes are x towards the head,
    y and z; gravity acts along the global -z. Any argument may have axes in front of its last one.
    They are broadcast against each other as NumPy does it, and each state gives the same bits as
    it would alone.

    Args:
        robot: The robot or its name; its own joint gains play no part here.
        quaternion: Attitude of the middle link, (w, x, y, z) of unit length, which takes its axes
            to the global ones, shape (..., 4).
        angular_velocity: That of the middle link, in its axes, rad/s, shape (..., 3).
        linear_velocity: Velocity of its middle in the global frame, m/s, shape (..., 3).
        joint_angles: Joint i turns link i + 1 against link i about its axis, right-handed, rad,
            shape (..., n - 1).
        joint_rates: Their rates, rad/s, shape (..., n - 1).
        joint_torques: Torque of joint i on link i + 1 about its axis (and its opposite on link i),
            N m, shape (..., n - 1).
        thruster_forces: Forces of the thrusters in the robot's order, N, shape (..., thrusters).
        current: Velocity of the water in the global frame, constant, m/s, shape (..., 3).

    Returns:
        The acceleration of the middle of the middle link in the global frame, m/s^2, (..., 3), the
        angular acceleration of that link in its axes, rad/s^2, (..., 3), and the accelerations of
        the joints, rad/s^2, (..., n - 1).

    Raises:
        ValueError: If the robot is unknown, a shape is wrong, shapes do not broadcast, a value is
            not finite or a quaternion is not of unit length.
    """
    robot = spatial_robot_of(robot)
    joints = len(robot.links) - 1
    given = {
        "quaternion": vectors("quaternion", quaternion, 4),
        "angular_velocity": vectors("angular_velocity", angular_velocity, 3),
        "linear_velocity": vectors("linear_velocity", linear_velocity, 3),
        "joint_angles": vectors("joint_angles", joint_angles, joints),
        "joint_rates": vectors("joint_rates", joint_rates, joints),
        "joint_torques": vectors("joint_torques", joint_torques, joints),
        "thruster_forces": vectors("thruster_forces", thruster_forces, len(robot.thrusters)),
        "current": vectors("current", current, 3),
    }
    length = np.linalg.norm(given["quaternion"], axis=-1, keepdims=True)
    unit = (np.abs(length - 1.0) <= UNIT_TOLERANCE).all()
    require(unit, "quaternion", quaternion, "(w, x, y, z) of unit length")
    given["quaternion"] = given["quaternion"] / length
    batch, states = broadcast(given)
    size = len(states[0])
    linear, angular, joint = np.empty((size, 3)), np.empty((size, 3)), np.empty((size, joints))
    for first in range(0, size, CHUNK):
        part = slice(first, first + CHUNK)
        blocks = _accelerated(robot, *(state[part] for state in states))
        linear[part] = blocks[:, rows.A : rows.A + 3]
        angular[part] = blocks[:, rows.DW : rows.DW + 3]
        phi_ddot = rows.row_of(rows.PHI_DDOT, joints + 1)
        joint[part] = blocks[:, phi_ddot : phi_ddot + joints]
    return (
        linear.reshape(*batch, 3),
        angular.reshape(*batch, 3),
        joint.reshape(*batch, joints),
    )


def _accelerated(
    robot: SpatialRobot,
    quaternion: Array,
    angular_velocity: Array,
    linear_velocity: Array,
    joint_angles: Array,
    joint_rates: Array,
    joint_torques: Array,
    thruster_forces: Array,
    current: Array,
) -> Array:
    """Blocks of robots in given states, their accelerations filled in."""
    plant, joints = spatial_plant(robot, 0.0), len(robot.links) - 1
    blocks = np.tile(spatial_row(robot, plant), (len(quaternion), 1))
    for row, values in (
        (rows.Q, quaternion),
        (rows.W, angular_velocity),
        (rows.V, linear_velocity),
        (rows.WATER, current),
        (rows.row_of(rows.PHI, joints + 1), joint_angles),
        (rows.row_of(rows.PHI_DOT, joints + 1), joint_rates),
        (rows.row_of(rows.TORQUE, joints + 1), joint_torques),
    ):
        blocks[:, row : row + values.shape[1]] = values
    entries = zip(plant.thruster_places, plant.thruster_shares, strict=True)
    for (thruster, row), share in entries:
        blocks[:, row] += share * thruster_forces[:, thruster]
    accelerate_all(blocks, plant)
    return blocks
