"""What a page must know of a robot to draw it: its shape, and its postures as rows of numbers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import singledispatch
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from usm_gym.manipulator import Manipulator
from usm_gym.rendering.figure import robot_drawing
from usm_gym.rendering.look import BODY, BODY_EDGE, HEAD, HEAD_EDGE, TAIL, Colour
from usm_gym.rendering.picture import Follower, Picture
from usm_gym.rendering.space.body import JET_LENGTH, jet_place, solids
from usm_gym.rendering.space.figure import spatial_robot_drawing
from usm_gym.rendering.space.mesh import Solid
from usm_gym.rendering.space.picture import Pose, SpatialPicture
from usm_gym.robot import Robot
from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]

# The names that the page has for colours.
NAMES: dict[Colour, str] = {
    BODY: "--body",
    BODY_EDGE: "--joint",
    HEAD: "--head",
    HEAD_EDGE: "--nose",
    TAIL: "--tail",
}


class Stage(ABC):
    """How a page draws the robots of a world.

    Attributes:
        view: The name that the page has for the way in which it draws them.
        follower: What has to follow the path.
    """

    view: ClassVar[str]
    follower: Follower

    @abstractmethod
    def robot(self) -> dict[str, Any]:
        """The robot's shape, as the page's scripts take it."""

    @abstractmethod
    def drawing(self) -> tuple[str, str]:
        """A drawing of the robot with its signs, as SVG, and what it shows, in words."""

    @abstractmethod
    def postures(self, pictures: Sequence[Any]) -> Array:
        """True postures, (pictures, numbers)."""

    @abstractmethod
    def references(self, pictures: Sequence[Any]) -> Array | None:
        """Reference postures, (pictures, numbers); None where no posture is asked for."""


@singledispatch
def stage_of(robot: Any) -> Stage:
    """How a page draws a robot."""
    raise TypeError(f"no page draws {type(robot).__name__}")


class PlanarStage(Stage):
    """Draws a chain of equal links from above; a posture is the angles of its links, rad."""

    view = "plane"

    def __init__(self, robot: Robot, follower: Follower = "centre of mass") -> None:
        """Draw a robot."""
        self._robot, self.follower = robot, follower

    def robot(self) -> dict[str, Any]:
        """Length and half width of a link, m, and the thrusters."""
        robot = self._robot
        return {
            "length": robot.link_length,
            "halfWidth": robot.half_width,
            "thrusters": [
                {"link": thruster.link - 1, "normal": thruster.direction == "normal"}
                for thruster in robot.thrusters
            ],
        }

    def drawing(self) -> tuple[str, str]:
        """The robot from above, on its path if that is its centre of mass's."""
        on_path = self.follower == "centre of mass"
        error = ", the error from the path to the centre of mass," if on_path else ""
        return robot_drawing(self._robot, on_path), (
            f"The robot from above: links 1 to {self._robot.links} from tail to head, positive "
            f"thruster forces{error} and the signs of all angles"
        )

    def postures(self, pictures: Sequence[Picture]) -> Array:
        """Link angles, rad, (pictures, links)."""
        return np.array([picture.body.angles for picture in pictures])

    def references(self, pictures: Sequence[Picture]) -> Array | None:
        """Link angles asked for, rad, (pictures, links), if any are."""
        asked = [picture.reference.angles for picture in pictures if picture.reference]
        return np.array(asked) if asked else None


class SpatialStage(Stage):
    """Draws solids in space; a posture is the root's quaternion and the joint angles, rad."""

    view = "space"

    def __init__(self, robot: SpatialRobot, follower: Follower = "centre of mass") -> None:
        """Draw a robot."""
        self._robot, self.follower = robot, follower

    def robot(self) -> dict[str, Any]:
        """Links, joints, solids and jets; lengths in m, masses in kg."""
        robot = self._robot
        places = [(each.link - 1, *jet_place(robot, each)) for each in robot.thrusters]
        return {
            "lengths": _rounded(robot.lengths),
            "masses": _rounded(robot.masses),
            "keels": _rounded(robot.keels),
            "jointAxes": [list(axis) for axis in robot.joint_axes],
            "solids": [_solid(solid) for solid in solids(robot)],
            "jets": [
                {
                    "link": link,
                    "at": _rounded(at),
                    "direction": _rounded(direction),
                    "mouth": round(mouth, 4),
                    "width": round(width, 4),
                }
                for link, at, direction, mouth, width in places
            ],
            "jetLength": JET_LENGTH * float(robot.lengths.sum()),
        }

    def drawing(self) -> tuple[str, str]:
        """The straight robot from three sides."""
        return spatial_robot_drawing(self._robot), (
            "The robot in space from above, from its right and from behind: links 1 to "
            f"{len(self._robot.links)} from tail to head, joints with the signs of their angles, "
            "positive thruster forces, and the centres of mass and of buoyancy"
        )

    def postures(self, pictures: Sequence[SpatialPicture]) -> Array:
        """Quaternions (w, x, y, z) and joint angles, (pictures, 4 + joints)."""
        return self._numbers([picture.body for picture in pictures])

    def references(self, pictures: Sequence[SpatialPicture]) -> Array | None:
        """The same of the reference, (pictures, 4 + joints), if there is one."""
        asked = [picture.wanted for picture in pictures if picture.wanted]
        return self._numbers(asked) if asked else None

    def _numbers(self, poses: Sequence[Pose]) -> Array:
        rotations = np.array([pose.rotations for pose in poses])
        root = rotations.shape[1] // 2
        quaternions = Rotation.from_matrix(rotations[:, root]).as_quat()[:, [3, 0, 1, 2]]
        # Of the two quaternions of an attitude, the one nearer to the last, so that they mix.
        same = (quaternions[1:] * quaternions[:-1]).sum(axis=1) >= 0.0
        quaternions[1:] *= np.cumprod(np.where(same, 1.0, -1.0))[:, np.newaxis]
        turns = np.swapaxes(rotations[:, :-1], 2, 3) @ rotations[:, 1:]
        vectors = Rotation.from_matrix(turns.reshape(-1, 3, 3)).as_rotvec()
        vectors = vectors.reshape(*turns.shape[:2], 3)
        angles = (vectors * np.array(self._robot.joint_axes)).sum(axis=2)
        return np.concatenate([quaternions, angles], axis=1)


@stage_of.register
def _(robot: Robot) -> Stage:
    return PlanarStage(robot)


@stage_of.register
def _(robot: SpatialRobot) -> Stage:
    return SpatialStage(robot)


@stage_of.register
def _(robot: Manipulator) -> Stage:
    kinds: dict[type, Callable[[Any, Follower], Stage]]
    kinds = {Robot: PlanarStage, SpatialRobot: SpatialStage}
    return kinds[type(robot.robot)](robot.robot, "head")


def _solid(solid: Solid) -> dict[str, Any]:
    return {
        "link": solid.link,
        "profile": _rounded(solid.profile),
        "colours": [NAMES[colour] for colour in solid.colours],
        "edge": NAMES[solid.edge],
        "at": _rounded(solid.at),
        "axis": _rounded(solid.axis),
        "stripe": list(solid.stripe),
        "inside": bool(solid.deeper > 0.0),
    }


def _rounded(values: Any) -> list[Any]:
    listed: list[Any] = np.asarray(values, np.float64).round(4).tolist()
    return listed
