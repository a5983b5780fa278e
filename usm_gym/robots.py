"""Robots by name, for scenarios to name theirs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from usm_gym.robot import Robot, read_robot
from usm_gym.support.validation import require

PAPER = "paper"

_robots: dict[str, Robot] = {PAPER: Robot()}


def register_robot(name: str, robot: Robot) -> None:
    """Give a robot a name.

    Raises:
        ValueError: If another robot has it.
    """
    require(_robots.get(name, robot) == robot, "name", name, "one that no other robot has")
    _robots[name] = robot


def robot_of(value: str | Mapping[str, Any] | Robot | None) -> Robot:
    """The robot of a name, or of the fields that differ from the paper's; None means the paper's.

    Raises:
        ValueError: If there is none of that name, or a field is unknown or its value not allowed.
    """
    if isinstance(value, str):
        require(value in _robots, "robot", value, ", ".join(_robots))
        return _robots[value]
    return value if isinstance(value, Robot) else read_robot({} if value is None else value)


def name_of(robot: Robot) -> str | Robot:
    """The name of a robot; the robot itself where it has none."""
    return next((name for name, known in _robots.items() if known == robot), robot)
