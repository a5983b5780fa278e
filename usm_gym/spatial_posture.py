"""Where the links of a spatial robot are, from its state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]


def link_poses(
    robot: SpatialRobot, position: ArrayLike, quaternion: ArrayLike, joint_angles: ArrayLike
) -> tuple[Array, Array]:
    """Rotations and centres of the links, of any number of robots at once.

    Args:
        robot: The robot.
        position: Centre of the root, its middle link (`links // 2`, counted from 0), in the global
            frame, m, (..., 3).
        quaternion: Attitude of the root (w, x, y, z), from its axes to the global ones, of any
            length but 0, (..., 4).
        joint_angles: Angle by which each joint turns the link after it, right-handed about its
            axis, rad, (..., joints).

    Returns:
        Rotations, whose columns are the links' axes in the global frame, (..., links, 3, 3), and
        centres in the global frame, m, (..., links, 3).
    """
    position = np.asarray(position, np.float64)
    turns = _turns(np.array(robot.joint_axes), np.asarray(joint_angles, np.float64))
    links, root = len(robot.links), len(robot.links) // 2
    rotations = np.empty((*turns.shape[:-3], links, 3, 3))
    rotations[..., root, :, :] = rotation_of(quaternion)
    for i in range(root, links - 1):
        rotations[..., i + 1, :, :] = rotations[..., i, :, :] @ turns[..., i, :, :]
    for i in range(root, 0, -1):
        back = np.swapaxes(turns[..., i - 1, :, :], -1, -2)
        rotations[..., i - 1, :, :] = rotations[..., i, :, :] @ back
    # From the middle of a link to its head end.
    halves = rotations[..., 0] * (robot.lengths / 2)[:, np.newaxis]
    ways = np.zeros_like(halves)
    np.cumsum(halves[..., :-1, :] + halves[..., 1:, :], axis=-2, out=ways[..., 1:, :])
    centres = ways - ways[..., root, np.newaxis, :] + position[..., np.newaxis, :]
    return rotations, centres


def centre_of_mass(robot: SpatialRobot, rotations: Array, centres: Array) -> Array:
    """Centre of mass in the global frame, m, (..., 3), from what `link_poses` returns."""
    lowered = centres - rotations[..., 2] * robot.keels[:, np.newaxis]
    return np.asarray(robot.masses @ lowered / robot.total_mass)


def rotation_of(quaternion: ArrayLike) -> Array:
    """Rotation, (..., 3, 3), that a quaternion (w, x, y, z) of any length but 0 stands for."""
    quaternion = np.asarray(quaternion, np.float64)
    unit = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    w, cross = unit[..., :1, np.newaxis], _cross(unit[..., 1:])
    return np.asarray(np.eye(3) + 2 * w * cross + 2 * cross @ cross)


def roll_pitch_yaw(rotation: Array) -> Array:
    """Angles of a rotation, rad, (..., 3): yaw about z, then pitch about y, then roll about x.

    Positive pitch lowers the head, because y is to the left.
    """
    x, y, z = rotation[..., 0], rotation[..., 1], rotation[..., 2]
    level = np.hypot(x[..., 0], x[..., 1])
    angles = [
        np.arctan2(y[..., 2], z[..., 2]),
        np.arctan2(-x[..., 2], level),
        np.arctan2(x[..., 1], x[..., 0]),
    ]
    return np.stack(angles, axis=-1)


def _turns(axes: Array, angles: Array) -> Array:
    """Rotations by angles, (..., k), about unit vectors, (k, 3): Rodrigues' formula."""
    cross, angles = _cross(axes), angles[..., np.newaxis, np.newaxis]
    return np.asarray(np.eye(3) + np.sin(angles) * cross + (1 - np.cos(angles)) * cross @ cross)


def _cross(vectors: Array) -> Array:
    """Matrices, (..., 3, 3), that multiply as the cross product with vectors, (..., 3), does."""
    columns = [np.cross(vectors, unit) for unit in np.eye(3)]
    return np.stack(columns, axis=-1)
