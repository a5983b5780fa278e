"""What happens in an episode: path, joint motion, conditions, water; its JSON.

All of it is plain data. A `Scenario` fixes an episode completely, sensor noise included, and is the
same in JSON (`to_dict`, `from_dict`).
"""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from pydantic import Field

from usm_gym.plant.references import MAX_SHIFTS
from usm_gym.robot import Damping, Robot, Stiffness
from usm_gym.robots import PAPER, robot_of
from usm_gym.support.validation import Count, Number, Switch, require, validated
from usm_gym.task.base_scenario import (
    BaseScenario,
    Duration,
    LookAhead,
    Seed,
    Time,
    require_rising,
)
from usm_gym.task.conditions import FIELD, Coefficient, Conditions, FilterFrequency
from usm_gym.task.guidance import path_positions
from usm_gym.task.nominal import Nominal, nominal_under
from usm_gym.task.sensing import Sensing, sensing
from usm_gym.task.water import Water

Mode = Literal["operation", "torpedo"]
MODES: tuple[Mode, ...] = get_args(Mode)


@validated
class Path:
    """The path of the centre of mass, p_ref = (speed s, amplitude sin(frequency s)).

    Attributes:
        speed: v, -10 to 10 m/s.
        amplitude: A, -100 to 100 m.
        frequency: Angular frequency, -100 to 100 rad/s.
        ramp: Time over which path time s starts from rest, 0 (at full speed) to 3600 s.
    """

    speed: Annotated[Number, Field(ge=-10, le=10)] = 0.042
    amplitude: Annotated[Number, Field(ge=-100, le=100)] = 0.18
    frequency: Annotated[Number, Field(ge=-100, le=100)] = 0.065
    ramp: Time = 2.0


@validated
class Inspection:
    """The joint motion: the head side of the body bends one way, the other way, and back.

    A head deflection d is the reference d / bending_joints on each of the last joints, and turns
    the head to -d.

    Attributes:
        bending_joints: How many joints bend, counted from the head, 1 to 255.
        times: When the deflection changes, up to 16 rising times, 0 to 3600 s.
        deflections: To what it changes at those times, -100 to 100 rad.
        filter_frequency: Natural frequency of the critically damped second-order filter between
            those steps and the joint references, 0.01 to 1000 rad/s; None leaves them steps.
    """

    bending_joints: Annotated[Count, Field(le=255)] = 11
    times: Annotated[tuple[Time, ...], Field(max_length=MAX_SHIFTS)] = (10.0, 20.0, 30.0)
    deflections: tuple[Annotated[Number, Field(ge=-100, le=100)], ...] = (0.98, -0.98, 0.0)
    filter_frequency: FilterFrequency | None = 8.0

    def __post_init__(self) -> None:
        """Refuse times that do not rise or do not match the deflections."""
        require(
            len(self.times) == len(self.deflections),
            "deflections",
            self.deflections,
            "as many as times",
        )
        require_rising(self.times)


STILL = Inspection(bending_joints=1, times=(), deflections=())


@validated
class Scenario(BaseScenario):
    """One episode, complete.

    Attributes:
        mode: "operation" or "torpedo".
        path: Path of the centre of mass.
        inspection: Joint motion.
        conditions: Sensors, actuators, timing.
        water: The water of this episode.
        thruster_gains: Force of each thruster over its command, 0.01 to 100; none: 1. No controller
            is told.
        duration: Length of the episode, 1e-6 to 3600 s; a multiple of the control period, and
            100 million physics steps at most.
        settle_time: From when on errors count, 0 to 3600 s.
        noise_seed: Seed of the sensors' errors and gaps, 0 to 2^64 - 1.
        joint_stiffness: Joint controllers' proportional gain, 0 to 1e6 N m/rad; None: the robot's.
        joint_damping: Joint controllers' derivative gain, 0 to 1e6 N m s/rad; None: the robot's.
        heading: Whether heading means the mean link angle or the head link's.
        look_ahead: Look-ahead distance of the line-of-sight guidance, 0.01 to 1000 m; None: heading
            reference 0.
        cross_track: Whether that guidance aims at the path, rather than at the x axis as the paper
            prints it.
        robot: The robot, or its name (`usm_gym.robots`); all but the paper's are kept as the robot
            itself, so that a file of scenarios is complete.
    """

    usual: ClassVar[str] = PAPER
    mode: Mode = "operation"
    path: Path = Path()
    inspection: Inspection = Inspection()
    conditions: Conditions = FIELD
    water: Water = Water()
    thruster_gains: tuple[Coefficient, ...] = ()
    duration: Duration = 40.0
    settle_time: Time = 5.0
    noise_seed: Seed = 0
    joint_stiffness: Stiffness | None = None
    joint_damping: Damping | None = None
    heading: Literal["mean", "head"] = "mean"
    look_ahead: LookAhead | None = None
    cross_track: Switch = False
    robot: str | Robot = PAPER

    @property
    def body(self) -> Robot:
        """The robot, without the joint gains that the scenario may bring."""
        return robot_of(self.robot)

    @property
    def joint_gains(self) -> tuple[float, float]:
        """Stiffness, N m/rad, and damping, N m s/rad, of the joint controllers."""
        stiffness, damping = self.joint_stiffness, self.joint_damping
        return (
            self.body.joint_stiffness if stiffness is None else stiffness,
            self.body.joint_damping if damping is None else damping,
        )

    @property
    def nominal(self) -> Nominal:
        """What a controller may know: the robot, with the joint gains that the scenario brings."""
        body, conditions = self.body, self.conditions
        stiffness, damping = self.joint_gains
        if (stiffness, damping) != (body.joint_stiffness, body.joint_damping):
            body = dataclasses.replace(body, joint_stiffness=stiffness, joint_damping=damping)
        return nominal_under(body, conditions)

    @property
    def shifts(self) -> tuple[float, ...]:
        """When the joint references change, s; empty if the joints keep still."""
        return self.inspection.times if self.conditions.motion else ()

    def sensing(self) -> Sensing:
        """What the sensors make of the truth: of tail and joints, angles come before rates."""
        conditions, joints = self.conditions, self.body.links - 1
        angles = [conditions.tail_angle_noise, *[conditions.joint_angle_noise] * joints]
        rates = [conditions.rate_noise] * (1 + joints)
        return sensing(conditions, self.steps, 2, angles + rates, self.noise_seed)

    def reference_positions(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Reference of the position at every control instant, m, shape (steps + 1, 2)."""
        conditions, path = self.conditions, self.path
        instants = np.arange(self.steps + 1) * conditions.substeps
        positions = np.empty((self.steps + 1, 2))
        path_positions(
            instants * conditions.physics_step,
            path.speed,
            path.amplitude,
            path.frequency,
            path.ramp,
            positions,
        )
        return positions

    def bending(self, further: float = 1.0, faster: float = 1.0) -> Scenario:
        """The same episode with joints that move further or faster, by factors.

        Raises:
            ValueError: If nothing filters the joint references, so that they cannot be faster.
        """
        motion = self.inspection
        changed = dataclasses.replace(
            motion,
            deflections=tuple(further * angle for angle in motion.deflections),
            filter_frequency=times_faster(motion.filter_frequency, faster),
        )
        return dataclasses.replace(self, inspection=changed)

    def under(self, conditions: Conditions) -> Scenario:
        """The same episode under other conditions; water and gains are redrawn from its seed."""
        body = self.body
        water, gains = Water.draw(conditions, self.noise_seed, body.links, len(body.thrusters))
        return dataclasses.replace(self, conditions=conditions, water=water, thruster_gains=gains)


def times_faster(frequency: float | None, factor: float) -> float | None:
    """The frequency of a filter of joint references that are faster by a factor.

    Raises:
        ValueError: If there is no filter.
    """
    filtered = frequency is not None or factor == 1.0
    require(filtered, "filter_frequency", frequency, "a number that can be varied")
    return None if frequency is None else factor * frequency


def require_mode(value: Any, modes: tuple[str, ...]) -> None:
    """Raise a `ValueError` that names the modes unless a value is the name of one of them."""
    require(isinstance(value, str) and value in modes, "mode", value, " or ".join(modes))
