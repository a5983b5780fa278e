"""The posture of a steered robot at the start, and what a path asks of its joints."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.packing import plant_of
from usm_gym.robot import Robot
from usm_gym.robots import AnyRobot
from usm_gym.spatial_packing import spatial_plant
from usm_gym.spatial_posture import centre_of_mass, link_poses
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.task.head_kinematics import trace_in_plane, trace_in_space
from usm_gym.task.head_path import HeadPath

Array = NDArray[np.float64]
Joints = tuple[float, ...]
# Between instants at which the demand of a path is looked at, s.
STEP = 0.1


class Demand(NamedTuple):
    """What a path asks of the joints, while centre of mass and attitude of the body stay.

    Attributes:
        error: Largest error that is left to the head, m.
        rate: Largest rate of a joint, rad/s.
        angle: Largest angle of a joint, rad.
    """

    error: float
    rate: float
    angle: float


def angles_of(robot: AnyRobot, posture: Joints) -> Array:
    """The joint angles of a posture, rad, (joints,); none: straight."""
    joints = (robot.links if isinstance(robot, Robot) else len(robot.links)) - 1
    return np.array(posture) if posture else np.zeros(joints)


def link_angles(robot: Robot, posture: Joints) -> Array:
    """The angles of the links of a planar robot, whose mean is 0, rad, (links,)."""
    angles = np.concatenate([[0.0], -np.cumsum(angles_of(robot, posture))])
    return np.asarray(angles - angles.mean())


def spatial_start(robot: SpatialRobot, posture: Joints) -> tuple[Array, Array]:
    """Head and centre of mass of a level robot, from its middle link's middle, m, (3,) each."""
    level = (1.0, 0.0, 0.0, 0.0)
    rotations, centres = link_poses(robot, np.zeros(3), level, angles_of(robot, posture))
    head = centres[-1] + rotations[-1, :, 0] * robot.lengths[-1] / 2
    return head, centre_of_mass(robot, rotations, centres)


def start_of(robot: AnyRobot, posture: Joints) -> Array:
    """Where the head is at the start, from the centre of mass, as a path has it, (3,)."""
    if isinstance(robot, SpatialRobot):
        head, centre = spatial_start(robot, posture)
        return np.asarray(head - centre)
    angles = link_angles(robot, posture)
    links = 2.0 * robot.half_length * np.stack([np.cos(angles), np.sin(angles)])
    # Half a link and those before it are behind the middle of a link, on average.
    head = links @ (np.arange(robot.links) + 0.5) / robot.links
    return np.array([*head, angles[-1]])


@lru_cache(maxsize=4096)
def demand_of(robot: AnyRobot, posture: Joints, path: HeadPath, duration: float) -> Demand:
    """What a path asks of the joints over an episode of a duration, s."""
    times = np.arange(0.0, duration + STEP, STEP)
    references = path.at(times, start_of(robot, posture))
    home = angles_of(robot, posture)
    if isinstance(robot, SpatialRobot):
        return Demand(*trace_in_space(references, STEP, spatial_plant(robot, 0.0), home))
    return Demand(*trace_in_plane(references, STEP, plant_of(robot, 0.0), home))
