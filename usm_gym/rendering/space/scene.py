"""Draws a spatial robot in the water (needs the extra `render`)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pygame

from usm_gym.rendering.look import (
    AXIS_COLOURS,
    CURRENT,
    GREY,
    INK,
    REFERENCE,
    TRAIL,
    WANTED,
    Colour,
    Points,
    faded,
)
from usm_gym.rendering.panel import MIDDLE, Panel, write
from usm_gym.rendering.scene import arrow, dot, thinned
from usm_gym.rendering.space.body import body, hull, jets
from usm_gym.rendering.space.camera import NEAR, Camera, View
from usm_gym.rendering.space.mesh import Mesh
from usm_gym.rendering.space.paint import Task, jet_painter, paint
from usm_gym.rendering.space.picture import SpatialPicture
from usm_gym.spatial_robot import SpatialRobot

# The water's colour over the angle above the horizon, degrees.
SLOPES = np.array([-90.0, -30.0, -9.0, -0.4, 0.4, 3.0, 14.0, 90.0])
HUES = np.array(
    [
        (206, 224, 233),
        (217, 232, 239),
        (229, 240, 245),
        (236, 245, 249),
        (241, 248, 251),
        (232, 244, 250),
        (205, 231, 245),
        (190, 224, 242),
    ]
)
SHADOW, SHADE = (60, 92, 112), 0.30
# Over the robot's length: depth of the floor below the deepest point of the path, and how far the
# floor's lines reach.
FLOOR, REACH = 0.16, 2.6
# Steps in which they fade.
FADES = 16
GRID_LINE, GROUND, PATH_SHADOW = (176, 199, 211), (226, 238, 244), (128, 158, 174)
# The water's arrows, over the robot's length: their distances, how far from the middle they are,
# the longest one, and half an arm of the goal's cross; how far the water moves along an arrow, s.
SPACING, AROUND, LONGEST, ARM = np.array([0.3, 0.3, 0.22]), 0.9, 0.09, 0.045
SECONDS = 4.0
MARKS = tuple(digit * 10.0**power for power in (-4, -3, -2, -1, 0, 1, 2) for digit in (1, 2, 5))

# Length of an axis in the corner, points.
AXIS = 24.0
Word = tuple[str, tuple[float, float], Colour]


class SpatialScene:
    """A view of a robot in the water, over a floor with its shadow."""

    def __init__(self, area: pygame.Rect, unit: float, measured: bool = True) -> None:
        """Prepare a view on an area, in points of `unit` pixels.

        Args:
            area: Where the view is.
            unit: Pixels in a point.
            measured: Whether it has a bar that shows a length, and the directions of the axes.
        """
        self._panel, self._measured = Panel(area, unit), measured
        self._area, self._unit = area, unit
        self._robot: SpatialRobot | None = None

    def draw(
        self,
        frame: pygame.Surface,
        picture: SpatialPicture,
        camera: Camera,
        track: Colour = TRAIL,
    ) -> View:
        """Draw a picture, as a camera sees it, on a frame; return the view.

        Args:
            frame: The frame.
            picture: The picture.
            camera: The camera.
            track: Colour of the track of what follows the path.
        """
        if picture.robot is not self._robot:
            self._robot = picture.robot
            self._body, self._hull = body(picture.robot), hull(picture.robot)
            self._length = float(picture.robot.lengths.sum())
            self.grid = max(mark for mark in MARKS if mark <= self._length / 6)
        area = self._area
        view = self._view = View(camera, area.center, area.width, NEAR * self._length)
        deepest = min(picture.path[:, 2].min(), picture.middle[2])
        self._floor = float(deepest) - FLOOR * self._length
        self._water()
        self._lines(picture)
        self._shadow(self._hull.posed(*picture.body))
        self._path(picture)
        if picture.wanted is not None:
            self._ghost(self._hull.posed(*picture.wanted))
        mesh = self._body.posed(*picture.body)
        paint(self._panel, self._view, mesh, self._jets(picture) + self._stream(picture))
        self._marks(picture, track)
        words = []
        if self._measured:
            words = [*self._axes(), *self._bar(view.metre(picture.middle))]
        self._panel.show(frame)
        for word, at, colour in words:
            write(frame, self._unit, word, at, 10, colour, MIDDLE)
        return view

    def _water(self) -> None:
        heights = np.arange(self._area.top, self._area.bottom, dtype=np.float64) + 0.5
        slopes = np.degrees(self._view.slopes(heights))
        hues = [np.interp(slopes, SLOPES, HUES[:, k]) for k in range(3)]
        self._panel.shades(np.stack(hues, axis=1))

    def _lines(self, picture: SpatialPicture) -> None:
        """Draw the floor's grid, which fades away from the middle."""
        middle, reach = picture.middle[:2], REACH * self._length
        low, high = (np.rint((middle + side * reach) / self.grid) for side in (-1, 1))
        marks = [np.arange(low[k], high[k] + 1) * self.grid for k in (0, 1)]
        parts = []
        for axis in (0, 1):
            cross, along = np.meshgrid(marks[1 - axis], marks[axis], indexing="ij")
            points = np.full((*cross.shape, 3), self._floor)
            points[..., 1 - axis], points[..., axis] = cross, along
            parts.append(np.stack([points[:, :-1], points[:, 1:]], axis=2).reshape(-1, 2, 3))
        ends = np.concatenate(parts)
        far = np.linalg.norm(ends.mean(axis=1)[:, :2] - middle, axis=1) / reach
        inside = (self._view.depth(ends) > self._view.near).all(axis=1)
        places = self._view.see(ends)
        for step in range(FADES):
            chosen = inside & (np.floor(FADES * far) == step)
            colour = faded(GRID_LINE, 1 - (step + 0.5) / FADES, GROUND)
            self._panel.segments(places[chosen], 0.9, colour)

    def _shadow(self, mesh: Mesh) -> None:
        """Draw what a mesh hides of the light from above."""
        dropped = mesh.corners[mesh.normals[..., 2] > 0].copy()
        dropped[..., 2] = self._floor
        seen = (self._view.depth(dropped) > self._view.near).all(axis=1)
        if seen.any():
            self._panel.veil(self._view.see(dropped[seen]), SHADOW, SHADE)

    def _ghost(self, mesh: Mesh) -> None:
        """Draw the pose that is asked for, of which the body leaves free where it is not."""
        seen = (self._view.depth(mesh.corners) > self._view.near).all(axis=2)
        if seen.any():
            self._panel.veil(self._view.see(mesh.corners[seen]), REFERENCE, WANTED)

    def _jets(self, picture: SpatialPicture) -> list[Task]:
        tasks = []
        for jet, share in jets(picture.robot, picture.thrust):
            posed = jet.posed(*picture.body)
            task = jet_painter(self._panel, self._view, posed, share)
            tasks += [task] if task else []
        return tasks

    def _stream(self, picture: SpatialPicture) -> list[Task]:
        """What draws arrows that drift with the water; the faster it is, the longer they are."""
        speed = float(np.linalg.norm(picture.current))
        if speed == 0.0:
            return []
        longest = LONGEST * self._length
        reach = min(longest, SECONDS * speed) * picture.current / speed
        tasks = []
        for place, share in self._lattice(picture):
            ends = np.stack([place - reach / 2, place + reach / 2])
            if (self._view.depth(ends) > self._view.near).all():
                distance = float(np.linalg.norm(self._view.position - place))
                tasks.append((distance, self._arrow_painter(ends, share)))
        return tasks

    def _lattice(self, picture: SpatialPicture) -> list[tuple[Points, float]]:
        """Places around the middle that drift with the water, and how near to it they are."""
        spacing = SPACING * self._length
        middle = picture.middle - picture.drift
        low, high = (np.rint((middle + side * AROUND * self._length) / spacing) for side in (-1, 1))
        axes = [np.arange(low[k], high[k] + 1) for k in range(3)]
        cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        # Every second row and layer is shifted, so that the arrows do not stand in ranks.
        cells[:, :2] += 0.5 * (cells[:, [1, 2]] % 2)
        places = cells * spacing + picture.drift
        far = np.linalg.norm((places - picture.middle) / (AROUND * self._length), axis=1)
        seen = (far < 1) & (places[:, 2] > self._floor)
        return list(zip(places[seen], (1 - far[seen] ** 2).tolist(), strict=True))

    def _arrow_painter(self, ends: Points, share: float) -> Callable[[], None]:
        start, tip = self._view.see(ends)
        colour = faded(CURRENT, 0.15 + 0.4 * share, GROUND)
        return lambda: arrow(self._panel, start, tip, 1.0, colour)

    def _path(self, picture: SpatialPicture) -> None:
        """Draw the path on the floor, and how high above it that is what follows it."""
        fallen = thinned(picture.path, 400).copy()
        fallen[:, 2] = self._floor
        foot = picture.track[-1].copy()
        foot[2] = self._floor
        for line in (fallen, np.stack([picture.track[-1], foot])):
            for part in self._view.see_line(line):
                self._panel.line(part, 1.0, PATH_SHADOW)
        if self._view.depth(foot) > self._view.near:
            self._panel.disc(self._view.see(foot), 2.5, PATH_SHADOW)

    def _marks(self, picture: SpatialPicture, track: Colour) -> None:
        """Draw path, track, what follows the path, its goal and the centre of mass, on top."""
        panel, view = self._panel, self._view
        dots = self._dots(picture.path)
        close = np.linalg.norm(dots - picture.middle, axis=1) < REACH * self._length
        dots = dots[close & (view.depth(dots) > view.near)]
        if len(dots):
            panel.disc(view.see(dots), 1.3, INK)
        for part in view.see_line(thinned(picture.track, 500)):
            panel.line(part, 2.2, track)
        arm = ARM * self._length
        for axis in np.eye(3):
            for part in view.see_line(picture.reference + arm * np.outer((-1, 1), axis)):
                panel.line(part, 1.8, REFERENCE)
        # The larger sign of the centre of mass hides the dot where that is what follows the path.
        if view.depth(picture.track[-1]) > view.near:
            dot(panel, view.see(picture.track[-1]), track)
        if view.depth(picture.mass) > view.near:
            panel.centre_of_mass(view.see(picture.mass))

    def _axes(self) -> list[Word]:
        """Draw the directions of the global axes in a corner; return their letters."""
        origin = np.add(self._area.bottomleft, (38.0, -34.0))
        words: list[Word] = []
        for letter, colour, tip in zip(
            "xyz", AXIS_COLOURS, AXIS * self._view.turned(np.eye(3)), strict=True
        ):
            arrow(self._panel, origin, origin + tip, 1.3, colour)
            x, y = origin + 1.3 * tip
            words.append((letter, (float(x), float(y) - 7), colour))
        return words

    def _bar(self, metre: float) -> list[Word]:
        """Draw how long the width of the floor's grid is in the middle; return its length."""
        length = self.grid * metre
        if length > self._area.width / 2:
            return []
        end = np.subtract(self._area.bottomright, (14.0, 8.0))
        self._panel.line(np.stack([end - (length, 0.0), end]), 1.5, GREY)
        return [(f"{self.grid:g} m", (end[0] - length / 2, end[1] - 15), GREY)]

    def _dots(self, path: Points) -> Points:
        """Points on a path, twelve along the grid's width."""
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        length = np.concatenate([[0.0], np.cumsum(steps)])
        places = np.arange(0.0, length[-1], self.grid / 12)
        return np.stack([np.interp(places, length, path[:, k]) for k in range(3)], axis=1)
