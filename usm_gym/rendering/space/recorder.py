"""Takes pictures of a spatial robot from a simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from usm_gym.manipulator import bare
from usm_gym.rendering.picture import FAR, Trail, drift, velocity
from usm_gym.rendering.space.picture import Pose, SpatialPicture
from usm_gym.simulation import Simulation
from usm_gym.spatial_posture import centre_of_mass, link_poses
from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


class SpatialRecorder(Trail):
    """Records the past of one spatial robot of a simulation, for pictures with a trail."""

    def picture(self, simulation: Simulation) -> SpatialPicture:
        """Describe the present."""
        self.note(simulation)
        index, scenario = self.index, simulation.scenarios[self.index]
        count = int(simulation.count[index])
        time = count * scenario.conditions.control_period
        instants = self._recorded(count)
        errors = np.clip(self._errors[instants], -FAR, FAR)
        here = self._path[count]
        place = here + errors[-1]
        return SpatialPicture(
            robot=self._robot(simulation),
            time=time,
            body=self._pose(simulation, place),
            wanted=self._wanted(simulation, here),
            thrust=np.nan_to_num(simulation.read("force")[index]) / simulation.limit[index],
            limit=float(simulation.limit[index]),
            current=velocity(scenario.water, time),
            drift=drift(scenario.water, time),
            path=self._path,
            reference=here,
            middle=here,
            mass=place,
            times=instants * np.float64(scenario.conditions.control_period),
            track=self._path[instants] + errors,
            errors=errors,
            max_error=simulation.max_error[index].copy(),
            duration=scenario.duration,
            settle_time=scenario.settle_time,
            shifts=scenario.shifts,
            lost=bool(simulation.lost[index]),
        )

    def _robot(self, simulation: Simulation) -> SpatialRobot:
        robot = bare(simulation.scenarios[self.index].body)
        assert isinstance(robot, SpatialRobot)
        return robot

    def _pose(self, simulation: Simulation, place: Array) -> Pose:
        """The true pose; what follows the path is at a place, m, (3,)."""
        return posed(self._robot(simulation), *self._posture(simulation), place)

    def _wanted(self, simulation: Simulation, here: Array) -> Pose | None:
        """The pose that is asked for, if one is; the centre of mass should be here, m, (3,)."""
        quaternion, _ = self._posture(simulation)
        wanted = reference_posture(simulation, self.index, quaternion)
        return posed(self._robot(simulation), *wanted, here)

    def _posture(self, simulation: Simulation) -> tuple[Array, Array]:
        """Attitude of the root and joint angles; level and straight where they are not finite."""
        quaternion = simulation.read("attitude")[self.index]
        joints = simulation.read("joint_angles")[self.index]
        if not np.isfinite([*quaternion, *joints]).all():
            return LEVEL, np.zeros_like(joints)
        return quaternion, joints


class SpatialHeadRecorder(SpatialRecorder):
    """The same of a robot whose head follows the path, while its body stays at the station."""

    def picture(self, simulation: Simulation) -> SpatialPicture:
        """Describe the present."""
        shown = super().picture(simulation)
        mass = centre_of_mass(shown.robot, *shown.body)
        return replace(shown, middle=np.zeros(3), mass=mass, follower="head")

    def _pose(self, simulation: Simulation, place: Array) -> Pose:
        robot = self._robot(simulation)
        rotations, centres = link_poses(robot, np.zeros(3), *self._posture(simulation))
        tip = centres[-1] + rotations[-1, :, 0] * robot.lengths[-1] / 2
        return Pose(rotations, centres + place - tip)

    def _wanted(self, simulation: Simulation, here: Array) -> None:
        """None: a policy bends the robot as it likes."""


def posed(robot: SpatialRobot, quaternion: Array, joints: Array, mass: Array) -> Pose:
    """The pose of a robot whose centre of mass is at a place, m, (3,)."""
    rotations, centres = link_poses(robot, np.zeros(3), quaternion, joints)
    return Pose(rotations, centres + mass - centre_of_mass(robot, rotations, centres))


def reference_posture(simulation: Simulation, index: int, quaternion: Array) -> tuple[Array, Array]:
    """The attitude of the root and the joint angles, rad, that are asked for.

    Args:
        simulation: The simulation.
        index: The robot.
        quaternion: The attitude that it has.
    """
    joints = sum(
        simulation.read(f"{turn}_shares")[index] * simulation.read(turn)[index, 0]
        for turn in ("pan", "tilt")
    )
    pitch, yaw, roll = simulation.attitude_error[index]
    # The attitude is the reference, turned by the error about the axes of the root.
    return turned(quaternion, -np.array([roll, pitch, yaw])), np.nan_to_num(joints)


def turned(quaternion: Array, turn: Array) -> Array:
    """An attitude (w, x, y, z) that is turned about its own axes by a rotation vector, rad."""
    angle = float(np.linalg.norm(turn))
    w, axis = np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) * turn / 2
    scalar, vector = quaternion[0], quaternion[1:]
    parts = scalar * axis + w * vector + np.cross(vector, axis)
    return np.concatenate([[scalar * w - vector @ axis], parts])
