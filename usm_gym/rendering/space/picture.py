"""The visible state of a spatial robot as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.rendering.picture import Follower
from usm_gym.spatial_posture import roll_pitch_yaw
from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]


class Pose(NamedTuple):
    """Where the links are, and how they are turned.

    Attributes:
        rotations: Their rotations, tail first, from link axes, (links, 3, 3).
        centres: Their centres, m, (links, 3).
    """

    rotations: Array
    centres: Array


@dataclass(frozen=True)
class SpatialPicture:
    """One robot at one control instant, in the global frame; all numbers are finite.

    Attributes:
        robot: The robot.
        time: Time since the start, s.
        body: The robot's true pose.
        wanted: The pose with the reference joint angles at the reference of the attitude, its
            centre of mass at the reference of the position; None where no pose is asked for.
        thrust: Forces of the thrusters over their limit, (thrusters,).
        limit: The limit, N.
        current: Velocity of the water, m/s, (3,).
        drift: How far the water has moved since the start, m, (3,).
        path: Reference of what follows it at some instants of the whole episode, m, (k, 3).
        reference: Its reference now, m, (3,).
        middle: The point around which the robot is shown: the reference now, or the station, where
            the centre of mass starts, of a robot that stays there, m, (3,).
        mass: The true centre of mass, m, (3,).
        times: The instants recorded so far, in ascending order, s, (n,); the last one is now.
        track: Where the follower was at these instants, m, (n, 3).
        errors: The true position errors at these instants, m, (n, 3).
        max_error: Largest absolute error after settling, m, (3,).
        duration: Duration of the episode, s.
        settle_time: When the scored part of the episode begins, s.
        shifts: When the joints start to move, s.
        lost: Whether the robot is lost.
        follower: What has to follow the path.
    """

    robot: SpatialRobot
    time: float
    body: Pose
    wanted: Pose | None
    thrust: Array
    limit: float
    current: Array
    drift: Array
    path: Array
    reference: Array
    middle: Array
    mass: Array
    times: Array
    track: Array
    errors: Array
    max_error: Array
    duration: float
    settle_time: float = 0.0
    shifts: tuple[float, ...] = ()
    lost: bool = False
    follower: Follower = "centre of mass"

    @property
    def attitude(self) -> Array:
        """Roll, pitch and yaw of the root, rad, (3,); a positive pitch lowers the head."""
        return roll_pitch_yaw(self.body.rotations[len(self.robot.links) // 2])
