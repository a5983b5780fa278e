"""What happens in an episode in space: path, scan of the head, conditions, water; its JSON."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field

from usm_gym.plant.references import MAX_SHIFTS
from usm_gym.robots import EELY, spatial_robot_of
from usm_gym.spatial_robot import MOST_LINKS, SpatialRobot
from usm_gym.support.validation import Count, Number, Switch, require, validated
from usm_gym.task.base_scenario import (
    BaseScenario,
    Duration,
    LookAhead,
    Seed,
    Time,
    require_rising,
)
from usm_gym.task.conditions import SPATIAL_PRESETS, Coefficient, Conditions, FilterFrequency
from usm_gym.task.nominal import Nominal, nominal_under
from usm_gym.task.scenario import times_faster
from usm_gym.task.sensing import Sensing, sensing
from usm_gym.task.spatial_guidance import space_positions
from usm_gym.task.spatial_water import SpatialWater

SpatialMode = Literal["operation3d", "torpedo3d"]
SPATIAL_MODES: tuple[SpatialMode, ...] = get_args(SpatialMode)
AXES = 3

Amplitude = Annotated[Number, Field(ge=-100, le=100)]
Angle = Annotated[Number, Field(ge=-100, le=100)]
Angles = tuple[Angle, ...]
Times = Annotated[tuple[Time, ...], Field(max_length=MAX_SHIFTS)]


def _on_field(value: Any) -> Any:
    """Fields of conditions on top of those of the preset "field" in space."""
    fields = dataclasses.asdict(SPATIAL_PRESETS["field"])
    return fields | value if isinstance(value, dict) else value


SpatialConditions = Annotated[Conditions, BeforeValidator(_on_field)]


@validated
class SpatialPath:
    """The path of the centre of mass in space.

    It is p_ref = (speed s, sway sin(sway_frequency s), heave sin(heave_frequency s)).

    Attributes:
        speed: v, -10 to 10 m/s.
        sway: Amplitude to the side, -100 to 100 m.
        sway_frequency: Its angular frequency, -100 to 100 rad/s.
        heave: Amplitude upwards, -100 to 100 m.
        heave_frequency: Its angular frequency, -100 to 100 rad/s.
        ramp: Time over which path time s starts from rest, 0 (at full speed) to 3600 s.
    """

    speed: Annotated[Number, Field(ge=-10, le=10)] = 0.05
    sway: Amplitude = 0.2
    sway_frequency: Angle = 0.1
    heave: Amplitude = 0.1
    heave_frequency: Angle = 0.15
    ramp: Time = 2.0


@validated
class Scan:
    """The motion of the head: it looks to the side and up, and elsewhere, and back.

    A pan is the angle that the head turns to the left, shared equally by the bending joints about
    z; a tilt that by which it rises, by those about y.

    Attributes:
        bending_joints: How many joints bend, counted from the head, 1 to 63.
        times: When pan and tilt change, up to 16 rising times, 0 to 3600 s.
        pans: To what the pan changes at those times, -100 to 100 rad.
        tilts: The same of the tilt, -100 to 100 rad.
        filter_frequency: Natural frequency of the critically damped second-order filter between
            those steps and the joint references, 0.01 to 1000 rad/s; None leaves them steps.
    """

    bending_joints: Annotated[Count, Field(le=MOST_LINKS - 1)] = 4
    times: Times = (10.0, 20.0, 30.0)
    pans: Angles = (0.8, -0.8, 0.0)
    tilts: Angles = (0.4, -0.4, 0.0)
    filter_frequency: FilterFrequency | None = 4.0

    def __post_init__(self) -> None:
        """Refuse times that do not rise or do not match pans and tilts."""
        for name in ("pans", "tilts"):
            angles = getattr(self, name)
            require(len(angles) == len(self.times), name, angles, "as many as times")
        require_rising(self.times)

    def shares(self, robot: SpatialRobot) -> NDArray[np.float64]:
        """Which part of the pan and of the tilt is the reference of each joint, (2, joints)."""
        weights = np.array([(axis[2], -axis[1]) for axis in robot.joint_axes]).T
        weights[:, : weights.shape[1] - self.bending_joints] = 0.0
        sizes = (weights**2).sum(axis=1, keepdims=True)
        return np.asarray(weights / np.where(sizes > 0.0, sizes, 1.0))


NO_SCAN = Scan(bending_joints=1, times=(), pans=(), tilts=())


@validated
class SpatialScenario(BaseScenario):
    """One episode in space, complete.

    Attributes:
        mode: "operation3d" or "torpedo3d".
        path: Path of the centre of mass.
        scan: Motion of the head.
        conditions: Sensors, actuators, timing.
        water: The water of this episode.
        thruster_gains: Force of each thruster over its command, 0.01 to 100; none: 1. No controller
            is told.
        duration: Length of the episode, 1e-6 to 3600 s; a multiple of the control period, and
            100 million physics steps at most.
        settle_time: From when on errors count, 0 to 3600 s.
        noise_seed: Seed of the sensors' errors and gaps, 0 to 2^64 - 1.
        look_ahead: Look-ahead distance of the line-of-sight guidance, 0.01 to 1000 m; None: pitch
            and yaw references 0.
        cross_track: Whether that guidance aims at the path, rather than at the x axis as the paper
            prints it.
        robot: The robot, or its name (`usm_gym.robots`); all but Eely are kept as the robot itself,
            so that a file of scenarios is complete.
    """

    usual: ClassVar[str] = EELY
    mode: SpatialMode = "operation3d"
    path: SpatialPath = SpatialPath()
    scan: Scan = Scan()
    conditions: SpatialConditions = SPATIAL_PRESETS["field"]
    water: SpatialWater = SpatialWater()
    thruster_gains: tuple[Coefficient, ...] = ()
    duration: Duration = 40.0
    settle_time: Time = 5.0
    noise_seed: Seed = 0
    look_ahead: LookAhead | None = None
    cross_track: Switch = False
    robot: str | SpatialRobot = EELY

    @property
    def body(self) -> SpatialRobot:
        """The robot."""
        return spatial_robot_of(self.robot)

    @property
    def nominal(self) -> Nominal:
        """What a controller may know."""
        return nominal_under(self.body, self.conditions)

    @property
    def shifts(self) -> tuple[float, ...]:
        """When the joint references change, s; empty if the joints keep still."""
        return self.scan.times if self.conditions.motion else ()

    def sensing(self) -> Sensing:
        """What the sensors make of the truth: angles of attitude and joints, then their rates."""
        conditions, joints = self.conditions, len(self.body.links) - 1
        angles = [conditions.tail_angle_noise] * 3 + [conditions.joint_angle_noise] * joints
        rates = [conditions.rate_noise] * (3 + joints)
        return sensing(conditions, self.steps, AXES, angles + rates, self.noise_seed)

    def reference_positions(self) -> NDArray[np.float64]:
        """Reference of the position at every control instant, m, shape (steps + 1, 3)."""
        conditions, path = self.conditions, self.path
        times = np.arange(self.steps + 1) * conditions.substeps * conditions.physics_step
        positions = np.empty((self.steps + 1, AXES))
        space_positions(
            times,
            path.speed,
            path.sway,
            path.sway_frequency,
            path.heave,
            path.heave_frequency,
            path.ramp,
            positions,
        )
        return positions

    def bending(self, further: float = 1.0, faster: float = 1.0) -> SpatialScenario:
        """The same episode with joints that move further or faster, by factors.

        Raises:
            ValueError: If nothing filters the joint references, so that they cannot be faster.
        """
        scan = self.scan
        changed = dataclasses.replace(
            scan,
            pans=tuple(further * angle for angle in scan.pans),
            tilts=tuple(further * angle for angle in scan.tilts),
            filter_frequency=times_faster(scan.filter_frequency, faster),
        )
        return dataclasses.replace(self, scan=changed)

    def under(self, conditions: Conditions) -> SpatialScenario:
        """The same episode under other conditions; water and gains are redrawn from its seed."""
        body, seed = self.body, self.noise_seed
        water, gains = SpatialWater.draw(conditions, seed, len(body.links), len(body.thrusters))
        return dataclasses.replace(self, conditions=conditions, water=water, thruster_gains=gains)
