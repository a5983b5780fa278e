"""The visible state of a spatial robot as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
            centre of mass at the reference of the position.
        thrust: Forces of the thrusters over their limit, (thrusters,).
        limit: The limit, N.
        current: Velocity of the water, m/s, (3,).
        drift: How far the water has moved since the start, m, (3,).
        path: Reference of the centre of mass at some instants of the whole episode, m, (k, 3).
        reference: Its reference now, m, (3,).
        times: The instants recorded so far, in ascending order, s, (n,); the last one is now.
        track: The true centre of mass at these instants, m, (n, 3).
        errors: The true position errors at these instants, m, (n, 3).
        max_error: Largest absolute error after settling, m, (3,).
        duration: Duration of the episode, s.
        settle_time: When the scored part of the episode begins, s.
        shifts: When the joints start to move, s.
        lost: Whether the robot is lost.
    """

    robot: SpatialRobot
    time: float
    body: Pose
    wanted: Pose
    thrust: Array
    limit: float
    current: Array
    drift: Array
    path: Array
    reference: Array
    times: Array
    track: Array
    errors: Array
    max_error: Array
    duration: float
    settle_time: float = 0.0
    shifts: tuple[float, ...] = ()
    lost: bool = False

    @property
    def attitude(self) -> Array:
        """Roll, pitch and yaw of the root, rad, (3,); a positive pitch lowers the head."""
        return roll_pitch_yaw(self.body.rotations[len(self.robot.links) // 2])
