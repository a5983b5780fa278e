"""The worlds in which a policy moves thrusters and joints, and the head follows a path."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.lanes import padded
from usm_gym.manipulator import Manipulator
from usm_gym.packing import plant_of
from usm_gym.planar_world import PlanarWorld
from usm_gym.plant import layout as rows
from usm_gym.plant.plant import Plant
from usm_gym.plant.spatial import layout as spatial_rows
from usm_gym.plant.spatial.links import SpatialPlant
from usm_gym.plant.steering import ANGLE, QUANTITIES, steering_of, steering_row
from usm_gym.robot import Robot
from usm_gym.spatial_packing import spatial_plant
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.spatial_world import SpatialWorld
from usm_gym.support.validation import require
from usm_gym.task.head_observation import HeadLayout, head_jacobians
from usm_gym.task.head_path import PATH_ROWS, RAMP
from usm_gym.task.head_posture import link_angles, spatial_start
from usm_gym.task.head_scenario import HeadEpisode
from usm_gym.task.spatial_head_observation import SpatialHeadLayout, head_jacobians_in_space
from usm_gym.world import Array, Kernels, World, world_of

# Joints that follow a path leave no more error than this to the head, m.
LARGEST_MISS = 0.01


@dataclass(frozen=True)
class HeadWorld(World):
    """A steered robot, and the path of its head.

    It is the world of the same robot that holds its station, with more: the joints are the
    policy's, and error and reward are the head's. What is observed of the body comes first, as it
    is there, so that a law for the body can be given the beginning of an observation.

    Attributes:
        manipulator: The robot.
    """

    manipulator: Manipulator

    @cached_property
    def station(self) -> World:
        """The world of the robot that holds its station."""
        return world_of(self.manipulator.robot)

    @property
    def links(self) -> int:
        """Links of the robot."""
        return self.station.links

    @property
    def thrusters(self) -> int:
        """Thrusters of the robot."""
        return self.station.thrusters

    @property
    def actions(self) -> int:
        """Thrusters, then joints."""
        return self.thrusters + self.manipulator.joints

    @property
    def mass(self) -> float:
        """Mass of the robot, kg."""
        return self.station.mass

    @property
    def straight_body(self) -> tuple[Array, Array]:
        """Inertia, kg, and linear drag, N s/m, of the straight body in each axis."""
        return self.station.straight_body

    @property
    def rows(self) -> int:
        """Rows of the body at its station, then those of its steering and of the path."""
        return self._path + PATH_ROWS

    @cached_property
    def quantities(self) -> Mapping[str, slice]:
        """Those of the body at its station, and references and commanded rates of the joints."""
        first, joints = self.station.rows, self.manipulator.joints
        names = ("joint_references", "joint_reference_rates", "joint_commands")
        starts = {name: steering_row(first, ANGLE + k, self.links) for k, name in enumerate(names)}
        own = {name: slice(start, start + joints) for name, start in starts.items()}
        return {**self.station.quantities, **own}

    def check(self, scenario: HeadEpisode) -> None:
        """Refuse a scenario that the robot cannot carry out.

        Raises:
            ValueError: If the figure of the head goes beyond its reach, the posture is not one of
                the robot, or the body could not hold its station.
        """
        self.station.check(scenario.station)
        posture, joints = scenario.posture, self.manipulator.joints
        fitting = len(posture) in (0, joints)
        require(fitting, "posture", posture, f"none, or one angle for each of {joints} joints")
        limit = self.manipulator.joint_angle_limit
        within = all(abs(angle) <= limit for angle in posture)
        require(within, "posture", posture, f"angles of up to {limit:g} rad")
        demand, robot = scenario.demand, self.manipulator
        for name, asked, most, unit in (
            ("leaves the head behind by", demand.error, LARGEST_MISS, "m"),
            ("asks joints for", demand.rate, robot.joint_rate_limit, "rad/s"),
            ("asks joints for", demand.angle, robot.joint_angle_limit, "rad"),
        ):
            allowed = f"one that the joints can follow: up to {most:g} {unit}"
            require(asked <= most, "path", f"one that {name} {asked:.3g} {unit}", allowed)

    @abstractmethod
    def bend(self, scenario: Any, row: Array) -> None:
        """Write the posture at the start into the rows of a straight body."""

    @abstractmethod
    def jacobians(self, observation: NDArray[np.float32], matrices: Array) -> None:
        """Fill in how the head moves with the joints, as observed.

        Centre of mass and attitude of the body stay as they are.

        Args:
            observation: Observations, (batch, numbers).
            matrices: Where to write: velocity of the head, m/s, and in the plane the rate of its
                direction, rad/s, that unit rates of the joints make, (batch, 3, joints).
        """

    def write(self, scenario: HeadEpisode, row: Array) -> None:
        """Write a scenario and its start, at rest in its posture, into the rows."""
        first, path = self.station.rows, self._path
        self.station.write(scenario.station, row[:first])
        row[first:] = 0.0
        if scenario.posture:
            self.bend(scenario, row)
            row[first : first + self.manipulator.joints] = scenario.posture
        row[path : path + RAMP] = scenario.path.channels(scenario.start).ravel()
        row[path + RAMP] = scenario.path.ramp

    def shared(self, scenario: HeadEpisode, previous: Any) -> Any:
        """What all robots share, with how they are steered."""
        manipulator = self.manipulator
        plant = self.station.shared(scenario.station, previous)
        steering = steering_of(
            self.station.rows,
            plant.h,
            manipulator.joint_time_constant,
            manipulator.joint_rate_limit,
            manipulator.joint_angle_limit,
        )
        return plant._replace(**steering._asdict())

    def truth(self, read: Callable[[str], Array]) -> dict[str, Array]:
        """Those of the body."""
        return self.station.truth(read)

    def allocate(self, observation: NDArray[np.float32], matrices: Array) -> None:
        """Fill in the allocation matrices of robots as observed; those of the body."""
        body = np.ascontiguousarray(observation[:, : self.station.layout.size])
        self.station.allocate(body, matrices)

    @property
    def _path(self) -> int:
        """The first row of the path."""
        return self.station.rows + QUANTITIES * padded(self.links)


@dataclass(frozen=True)
class PlanarHeadWorld(HeadWorld):
    """The steered robot in the plane, whose head has a direction, too."""

    axes: ClassVar[tuple[str, ...]] = PlanarWorld.axes
    attitude: ClassVar[tuple[str, ...]] = ("direction",)
    watched: ClassVar[tuple[str, ...]] = PlanarWorld.attitude
    kernels: ClassVar[Kernels] = PlanarWorld.kernels

    @cached_property
    def layout(self) -> HeadLayout:
        """The table of the observation."""
        return HeadLayout(self.links, self.thrusters)

    def bend(self, scenario: Any, row: Array) -> None:
        """Write the angles of the links."""
        first = rows.row_of(rows.THETA, self.links)
        row[first : first + self.links] = link_angles(self._robot, scenario.posture)

    def jacobians(self, observation: NDArray[np.float32], matrices: Array) -> None:
        """Fill in the Jacobians of the head, see `HeadWorld.jacobians`."""
        head_jacobians(observation, self.layout.kernel_table, self._plant, matrices)

    @cached_property
    def _plant(self) -> Plant:
        return plant_of(self._robot, 0.0)

    @property
    def _robot(self) -> Robot:
        robot = self.manipulator.robot
        assert isinstance(robot, Robot)
        return robot


@dataclass(frozen=True)
class SpatialHeadWorld(HeadWorld):
    """The steered robot in space."""

    axes: ClassVar[tuple[str, ...]] = SpatialWorld.axes
    watched: ClassVar[tuple[str, ...]] = SpatialWorld.attitude + SpatialWorld.watched
    kernels: ClassVar[Kernels] = SpatialWorld.kernels

    @cached_property
    def layout(self) -> SpatialHeadLayout:
        """The table of the observation."""
        return SpatialHeadLayout(self.manipulator.joints, self.thrusters)

    def bend(self, scenario: Any, row: Array) -> None:
        """Write the angles of the joints, and where the middle link is then."""
        first = spatial_rows.row_of(spatial_rows.PHI, self.links)
        row[first : first + self.manipulator.joints] = scenario.posture
        _, centre = spatial_start(self._robot, scenario.posture)
        row[spatial_rows.P : spatial_rows.P + 3] = -centre

    def jacobians(self, observation: NDArray[np.float32], matrices: Array) -> None:
        """Fill in the Jacobians of the head, see `HeadWorld.jacobians`."""
        head_jacobians_in_space(observation, self.layout.kernel_table, self._plant, matrices)

    @cached_property
    def _plant(self) -> SpatialPlant:
        return spatial_plant(self._robot, 0.0)

    @property
    def _robot(self) -> SpatialRobot:
        robot = self.manipulator.robot
        assert isinstance(robot, SpatialRobot)
        return robot


@world_of.register
@lru_cache
def _head_world(robot: Manipulator) -> HeadWorld:
    kinds: dict[type, type[HeadWorld]] = {Robot: PlanarHeadWorld, SpatialRobot: SpatialHeadWorld}
    return kinds[type(robot.robot)](robot)
