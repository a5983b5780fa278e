"""What a controller may know of the robot beforehand."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any

from usm_gym.support.validation import require
from usm_gym.task.conditions import Conditions


@dataclass(frozen=True)
class Nominal:
    """The nominal knowledge from which policies are made: nothing that is drawn for an episode.

    Attributes:
        robot: The robot with its nominal coefficients; `usm_gym.world.world_of` gives its axes.
        control_period: Time between two actions, s.
        thruster_time_constant: First-order lag of the thrusters, s.
        position_noise: Standard deviation of the position measurement, per axis, m.
        position_delay: By how many control periods a measured position is late.
        action_delay: After how many control periods a command takes effect.
        position_period: Control periods between measurements of the position.
        velocity_period: The same of the velocity; None if nothing measures it.
        velocity_delay: By how many control periods a measured velocity is late.
        velocity_noise: Standard deviation of the velocity measurement, per axis, m/s.
        tail_angle_noise: The same of the measured angle of the tail, rad.
        joint_angle_noise: The same of the joint angles, rad.
        rate_noise: The same of the rates of tail and joints, rad/s.
        thruster_dead_band: Commands below this make no force, N.
        joint_time_constant: By what the references of joints lag behind the angles that a policy
            commands, s; 0 if the task moves the joints.
    """

    robot: Any
    control_period: float
    thruster_time_constant: float
    position_noise: float
    position_delay: int = 0
    action_delay: int = 0
    position_period: int = 1
    velocity_period: int | None = None
    velocity_delay: int = 0
    velocity_noise: float = 0.0
    tail_angle_noise: float = 0.0
    joint_angle_noise: float = 0.0
    rate_noise: float = 0.0
    thruster_dead_band: float = 0.0
    joint_time_constant: float = 0.0


def nominal_under(robot: Any, conditions: Conditions, joint_time_constant: float = 0.0) -> Nominal:
    """What a controller may know of a robot, nominal as given, under some conditions."""
    given = ("robot", "joint_time_constant")
    names = [field.name for field in fields(Nominal) if field.name not in given]
    known = {name: getattr(conditions, name) for name in names}
    return Nominal(robot, **known, joint_time_constant=joint_time_constant)


def shared_nominal(scenarios: Iterable[Any]) -> Nominal:
    """The nominal knowledge that goes with all of some scenarios.

    Raises:
        ValueError: If they do not agree in it.
    """
    nominal: Nominal
    nominal, *others = dict.fromkeys(scenario.nominal for scenario in scenarios)
    kinds = f"{len(others) + 1} kinds"
    require(not others, "scenarios", kinds, "one nominal knowledge for all")
    return nominal
