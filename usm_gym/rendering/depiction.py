"""How the robots of a world are shown: what takes pictures of them, and what draws these.

`depiction_of.register(YourRobot)` makes the one of another world known.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import singledispatch
from typing import TYPE_CHECKING, Any, Protocol

from usm_gym.manipulator import Manipulator
from usm_gym.rendering.look import WIDTH, Colour, Frame
from usm_gym.rendering.picture import HeadRecorder, Recorder
from usm_gym.rendering.space.recorder import SpatialHeadRecorder, SpatialRecorder
from usm_gym.robot import Robot
from usm_gym.simulation import Simulation
from usm_gym.spatial_robot import SpatialRobot

if TYPE_CHECKING:
    import pygame

# Points in a metre where a robot that is bent all the time has room, alone and in a row.
BENT_METRE, BENT_METRE_OF_ROW = 195.0, 92.0


class AnyRecorder(Protocol):
    """Takes pictures of one robot of a simulation."""

    @property
    def index(self) -> int:
        """Which robot it is."""

    def note(self, simulation: Simulation) -> None:
        """Record the present; call it at every control instant that a trail should show."""

    def picture(self, simulation: Simulation) -> Any:
        """Describe the present, as an `AnyPicture` that the world's canvas draws."""


class AnyCanvas(Protocol):
    """Draws pictures of one size."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""

    def draw(self, picture: Any, title: str, scale: float | None = None) -> Frame:
        """Draw a picture.

        Args:
            picture: The picture.
            title: The words above it.
            scale: The largest error shown, m; None fits the errors so far.

        Returns:
            Red, green and blue, (height, width, 3).
        """


class AnyRow(Protocol):
    """Draws a policy's robot among those of others, and its error under a lens."""

    def draw(self, frame: pygame.Surface, picture: Any, colour: Colour) -> None:
        """Draw a picture on a frame, the track in a colour."""


class Depiction(ABC):
    """How the robots of a world are shown.

    Only what draws needs the extra `render`, and imports it when it is asked for.
    """

    @abstractmethod
    def recorder(self, index: int = 0) -> AnyRecorder:
        """What takes pictures of the robot `index` of a simulation."""

    @abstractmethod
    def canvas(self, width: int = WIDTH) -> AnyCanvas:
        """What draws them in frames of a width, pixels."""

    @abstractmethod
    def rows(self, areas: list[pygame.Rect], unit: float, ring: float) -> list[AnyRow]:
        """What draws several policies, one above the other.

        Args:
            areas: Where, points.
            unit: Pixels in a point.
            ring: The error at the outer ring of the lenses, m.
        """


@singledispatch
def depiction_of(robot: Any) -> Depiction:
    """How a robot is shown."""
    raise TypeError(f"nothing draws {type(robot).__name__}")


class _Planar(Depiction):
    def recorder(self, index: int = 0) -> AnyRecorder:
        return Recorder(index)

    def canvas(self, width: int = WIDTH) -> AnyCanvas:
        from usm_gym.rendering.canvas import Canvas

        return Canvas(width)

    def rows(self, areas: list[pygame.Rect], unit: float, ring: float) -> list[AnyRow]:
        from usm_gym.rendering.row import Row

        return [Row(area, unit, ring, k == 0) for k, area in enumerate(areas)]


class _Spatial(Depiction):
    def recorder(self, index: int = 0) -> AnyRecorder:
        return SpatialRecorder(index)

    def canvas(self, width: int = WIDTH) -> AnyCanvas:
        from usm_gym.rendering.space.canvas import SpatialCanvas

        return SpatialCanvas(width)

    def rows(self, areas: list[pygame.Rect], unit: float, ring: float) -> list[AnyRow]:
        from usm_gym.rendering.space.row import SpatialRow

        return [SpatialRow(area, unit, ring) for area in areas]


class _PlanarHead(_Planar):
    def recorder(self, index: int = 0) -> AnyRecorder:
        return HeadRecorder(index)

    def canvas(self, width: int = WIDTH) -> AnyCanvas:
        from usm_gym.rendering.canvas import Canvas

        return Canvas(width, BENT_METRE)

    def rows(self, areas: list[pygame.Rect], unit: float, ring: float) -> list[AnyRow]:
        from usm_gym.rendering.row import Row

        return [Row(area, unit, ring, k == 0, BENT_METRE_OF_ROW) for k, area in enumerate(areas)]


class _SpatialHead(_Spatial):
    def recorder(self, index: int = 0) -> AnyRecorder:
        return SpatialHeadRecorder(index)


@depiction_of.register
def _(robot: Manipulator) -> Depiction:
    kinds: dict[type, type[Depiction]] = {Robot: _PlanarHead, SpatialRobot: _SpatialHead}
    return kinds[type(robot.robot)]()


@depiction_of.register
def _(robot: Robot) -> Depiction:
    return _Planar()


@depiction_of.register
def _(robot: SpatialRobot) -> Depiction:
    return _Spatial()
