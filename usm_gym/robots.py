"""Robots by name, for scenarios to name theirs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from usm_gym.robot import Robot, read_robot
from usm_gym.spatial_robot import EELY_NEUTRAL, SpatialRobot, read_spatial_robot
from usm_gym.support.validation import require

PAPER, EELY = "paper", "eely"
AnyRobot = Robot | SpatialRobot

_robots: dict[str, AnyRobot] = {
    PAPER: Robot(),
    EELY: SpatialRobot(),
    "eely-neutral": EELY_NEUTRAL,
}


def register_robot(name: str, robot: AnyRobot) -> None:
    """Give a robot a name.

    Raises:
        ValueError: If another robot has it.
    """
    require(_robots.get(name, robot) == robot, "name", name, "one that no other robot has")
    _robots[name] = robot


def robot_of(value: str | Mapping[str, Any] | Robot | None) -> Robot:
    """The planar robot of a name, or of the fields that differ from the paper's, which is for None.

    Raises:
        ValueError: If there is none of that name, or a field is unknown or its value not allowed.
    """
    if isinstance(value, str):
        planar: Robot = _known(value, Robot)
        return planar
    return value if isinstance(value, Robot) else read_robot({} if value is None else value)


def spatial_robot_of(value: str | Mapping[str, Any] | SpatialRobot | None) -> SpatialRobot:
    """The spatial robot of a name, or of the fields that differ from Eely's, which is for None.

    Raises:
        ValueError: If there is none of that name, or a field is unknown or its value not allowed.
    """
    if isinstance(value, str):
        spatial: SpatialRobot = _known(value, SpatialRobot)
        return spatial
    given = {} if value is None else value
    return given if isinstance(given, SpatialRobot) else read_spatial_robot(given)


def name_of(robot: Any) -> Any:
    """The name of a robot; the robot itself where it has none."""
    return next((name for name, known in _robots.items() if known == robot), robot)


def _known(name: str, kind: type[Any]) -> Any:
    names = [known for known, robot in _robots.items() if isinstance(robot, kind)]
    require(name in names, "robot", name, ", ".join(names))
    return _robots[name]
