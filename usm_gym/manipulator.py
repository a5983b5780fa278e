"""A robot whose joints are the policy's, too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from usm_gym.robots import AnyRobot


def bare(body: AnyRobot | Manipulator) -> AnyRobot:
    """The robot of a scenario, whoever moves its joints."""
    return body.robot if isinstance(body, Manipulator) else body


@dataclass(frozen=True)
class Manipulator:
    """A robot that is steered: a policy commands its thrusters and the rates of its joints.

    The commanded angle of a joint is the integral of its commanded rate, and the joint controller's
    reference lags behind it.

    Attributes:
        robot: The robot.
        joint_rate_limit: Largest commanded rate of a joint, rad/s.
        joint_angle_limit: Largest commanded angle of a joint, rad.
        joint_time_constant: By what the references lag behind the commanded angles, s.
    """

    robot: AnyRobot
    joint_rate_limit: float = 0.5
    joint_angle_limit: float = 1.2
    joint_time_constant: float = 0.1

    @property
    def joints(self) -> int:
        """Number of joints."""
        links: Any = self.robot.links
        return (links if isinstance(links, int) else len(links)) - 1
