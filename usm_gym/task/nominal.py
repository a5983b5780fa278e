"""What a controller may know of the robot beforehand."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from usm_gym.robot import Robot
from usm_gym.task.scenario import Scenario


@dataclass(frozen=True)
class Nominal:
    """The nominal knowledge from which policies are made; no true coefficient, no current.

    Attributes:
        robot: The robot with its nominal coefficients.
        control_period: Time between two actions, s.
        thruster_time_constant: First-order lag of the thrusters, s.
        position_noise: Standard deviation of the position measurement in each axis, m.
    """

    robot: Robot
    control_period: float
    thruster_time_constant: float
    position_noise: float


def nominal_of(robot: Robot, scenario: Scenario) -> Nominal:
    """The nominal knowledge that goes with a scenario."""
    conditions = scenario.conditions
    stiffness, damping = scenario.joint_stiffness, scenario.joint_damping
    return Nominal(
        robot=dataclasses.replace(
            robot,
            joint_stiffness=robot.joint_stiffness if stiffness is None else stiffness,
            joint_damping=robot.joint_damping if damping is None else damping,
        ),
        control_period=conditions.control_period,
        thruster_time_constant=conditions.thruster_time_constant,
        position_noise=conditions.position_noise,
    )
