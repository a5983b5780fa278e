"""Episodes in which the head follows a path, and the policy moves thrusters and joints."""

from __future__ import annotations

import dataclasses
from abc import abstractmethod
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from usm_gym.manipulator import Manipulator
from usm_gym.robot import Damping, Robot, Stiffness
from usm_gym.robots import EELY, PAPER
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.support.validation import Number, validated
from usm_gym.task.base_scenario import BaseScenario, Duration, Seed, Time
from usm_gym.task.conditions import FIELD, SPATIAL_PRESETS, Coefficient, Conditions
from usm_gym.task.head_path import HeadPath
from usm_gym.task.head_posture import Demand, demand_of, start_of
from usm_gym.task.nominal import Nominal, nominal_under
from usm_gym.task.scenario import STILL, Path, Scenario
from usm_gym.task.sensing import Sensing
from usm_gym.task.spatial_scenario import (
    NO_SCAN,
    SpatialConditions,
    SpatialPath,
    SpatialScenario,
)
from usm_gym.task.spatial_water import SpatialWater
from usm_gym.task.water import Water

HeadMode = Literal["head"]
SpatialHeadMode = Literal["head3d"]
HEAD_MODES: tuple[HeadMode, ...] = get_args(HeadMode)
SPATIAL_HEAD_MODES: tuple[SpatialHeadMode, ...] = get_args(SpatialHeadMode)

Angle = Annotated[Number, Field(ge=-100, le=100)]
# What an episode at the station has of the head's.
HELD = (
    *("conditions", "water", "thruster_gains", "duration"),
    *("settle_time", "noise_seed", "robot"),
)
# Straight, and where it is it stays.
HERE, HERE_IN_SPACE = Path(speed=0.0, amplitude=0.0), SpatialPath(speed=0.0, sway=0.0, heave=0.0)


class HeadEpisode(BaseScenario):
    """What the scenarios of plane and space have in common.

    The body of such an episode is that of one in which it holds its station; a policy moves its
    joints.
    """

    path: HeadPath
    posture: tuple[float, ...]
    settle_time: float
    noise_seed: int

    @property
    @abstractmethod
    def station(self) -> Any:
        """The same episode with still joints, in which the centre of mass holds its station."""

    @property
    def _held(self) -> dict[str, Any]:
        """What the episode at the station has of this one, by name."""
        return {name: getattr(self, name) for name in HELD}

    @property
    def body(self) -> Manipulator:
        """The robot, steered, without the joint gains that the scenario may bring."""
        return Manipulator(self.station.body)

    @property
    def nominal(self) -> Nominal:
        """What a controller may know."""
        body = Manipulator(self.station.nominal.robot)
        return nominal_under(body, self.conditions, body.joint_time_constant)

    @property
    def shifts(self) -> tuple[float, ...]:
        """None: no joint reference changes but by the policy."""
        return ()

    def sensing(self) -> Sensing:
        """What the sensors make of the truth, as of the body that holds its station."""
        sensing: Sensing = self.station.sensing()
        return sensing

    def under(self, conditions: Conditions) -> Self:
        """The same episode under other conditions; water and gains are redrawn from its seed."""
        held = self.station.under(conditions)
        changed: dict[str, Any] = {"water": held.water, "thruster_gains": held.thruster_gains}
        return dataclasses.replace(self, conditions=conditions, **changed)  # type: ignore[type-var]

    def references(self) -> NDArray[np.float64]:
        """What is asked of the head at every control instant, as a path has it, (steps + 1, 3)."""
        conditions = self.conditions
        times = np.arange(self.steps + 1) * conditions.substeps * conditions.physics_step
        return self.path.at(times, self.start)

    def reference_positions(self) -> NDArray[np.float64]:
        """Reference of the position at every control instant, m, (steps + 1, axes)."""
        return self.references()[:, : len(self.station.water.current)]

    @property
    def demand(self) -> Demand:
        """What the path asks of the joints while the body stays as it is."""
        return demand_of(self.station.body, self.posture, self.path, self.duration)

    @property
    def start(self) -> NDArray[np.float64]:
        """Where the head is at the start, as a path has it, (3,)."""
        return start_of(self.station.body, self.posture)


@validated
class HeadScenario(HeadEpisode):
    """One episode of the head in the plane, complete.

    Attributes:
        path: Path of the head.
        mode: "head".
        posture: Joint angles at the start, from the tail, -100 to 100 rad; none: straight.
        conditions: Sensors, actuators, timing.
        water: The water of this episode.
        thruster_gains: Force of each thruster over its command, 0.01 to 100; none: 1. No controller
            is told.
        duration: Length of the episode, 1e-6 to 3600 s; a multiple of the control period, and
            100 million physics steps at most.
        settle_time: From when on errors count, 0 to 3600 s.
        noise_seed: Seed of the sensors' errors and gaps, 0 to 2^64 - 1.
        joint_stiffness: Joint controllers' proportional gain, 0 to 1e6 N m/rad.
        joint_damping: Joint controllers' derivative gain, 0 to 1e6 N m s/rad.
        robot: The robot, or its name, as of `Scenario`.
    """

    usual: ClassVar[str] = PAPER
    path: HeadPath
    mode: HeadMode = "head"
    posture: tuple[Angle, ...] = ()
    conditions: Conditions = FIELD
    water: Water = Water()
    thruster_gains: tuple[Coefficient, ...] = ()
    duration: Duration = 40.0
    settle_time: Time = 10.0
    noise_seed: Seed = 0
    joint_stiffness: Stiffness = 400.0
    joint_damping: Damping = 80.0
    robot: str | Robot = PAPER

    @property
    def station(self) -> Scenario:
        """The same episode with still joints, in which the centre of mass holds its station."""
        return Scenario(
            path=HERE,
            inspection=STILL,
            joint_stiffness=self.joint_stiffness,
            joint_damping=self.joint_damping,
            **self._held,
        )


@validated
class SpatialHeadScenario(HeadEpisode):
    """One episode of the head in space, complete.

    Attributes:
        path: Path of the head.
        mode: "head3d".
        posture: Joint angles at the start, from the tail, -100 to 100 rad; none: straight.
        conditions: Sensors, actuators, timing.
        water: The water of this episode.
        thruster_gains: Force of each thruster over its command, 0.01 to 100; none: 1. No controller
            is told.
        duration: Length of the episode, 1e-6 to 3600 s; a multiple of the control period, and
            100 million physics steps at most.
        settle_time: From when on errors count, 0 to 3600 s.
        noise_seed: Seed of the sensors' errors and gaps, 0 to 2^64 - 1.
        robot: The robot, or its name, as of `SpatialScenario`.
    """

    usual: ClassVar[str] = EELY
    path: HeadPath
    mode: SpatialHeadMode = "head3d"
    posture: tuple[Angle, ...] = ()
    conditions: SpatialConditions = SPATIAL_PRESETS["field"]
    water: SpatialWater = SpatialWater()
    thruster_gains: tuple[Coefficient, ...] = ()
    duration: Duration = 40.0
    settle_time: Time = 10.0
    noise_seed: Seed = 0
    robot: str | SpatialRobot = EELY

    @property
    def station(self) -> SpatialScenario:
        """The same episode with still joints, in which the centre of mass holds its station."""
        return SpatialScenario(
            path=HERE_IN_SPACE,
            scan=NO_SCAN,
            **self._held,
        )
