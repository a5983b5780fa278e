"""Draws a robot in the water, and its error under a lens (needs the extra `render`)."""

from __future__ import annotations

import numpy as np
import pygame

from usm_gym.rendering.look import (
    BODY,
    BODY_EDGE,
    CURRENT,
    FAINT,
    GREY,
    HEAD,
    HEAD_EDGE,
    INK,
    JET,
    JET_CORE,
    PAPER,
    REFERENCE,
    RULE,
    TAIL,
    TRAIL,
    WATER,
    Colour,
    Points,
    faded,
    outlines,
)
from usm_gym.rendering.panel import Panel
from usm_gym.rendering.picture import AnyPicture, Follower, Picture, drift

GRID = 0.5
# Length of a jet at the thruster's limit, m.
JET_LENGTH = 0.36
# The water's arrows: their distance in a row and that of the rows, m; how far the water moves along
# an arrow, s, and the longest arrow, m.
SPACING, SECONDS, LONGEST = np.array([0.6, 0.33]), 8.0, 0.3
STREAM, OUTLINE = faded(CURRENT, 0.45), faded(REFERENCE, 0.45)
# How much of the past a lens shows, s.
LENS_PAST = 2.0


class Scene:
    """A view of the water from above around the middle of what is shown."""

    def __init__(self, area: pygame.Rect, unit: float, metre: float, middle: Points) -> None:
        """Prepare a view on an area, in points of `unit` pixels.

        Args:
            area: Where the view is.
            unit: Pixels in a point.
            metre: Points in a metre.
            middle: Where in the area the middle of what is shown is.
        """
        self._panel = Panel(area, unit, WATER)
        self._area, self._metre, self._middle = area, metre, middle
        self._path: Points | None = None
        self._dots = np.empty((0, 2))

    def draw(
        self,
        frame: pygame.Surface,
        picture: Picture,
        track: Colour = TRAIL,
        bar: Points | None = None,
    ) -> None:
        """Draw a picture on a frame.

        Args:
            frame: The frame.
            picture: The picture.
            track: Colour of the track of what follows the path.
            bar: Where a bar as long as the grid is wide ends; None for no bar.
        """
        panel = self._panel
        panel.clear()
        self._origin = picture.middle
        self._grid()
        self._current(picture)
        if picture.reference is not None:
            for points in self._at(outlines(picture.robot, picture.reference)):
                panel.outline(points, 1.5, OUTLINE)
        self._jets(picture)
        self._body(picture)
        panel.disc(self._at(self._path_dots(picture.path)), 1.3, INK)
        places = self._at(thinned(picture.track, 500))
        panel.line(places, 2.2, track)
        cross_hair(panel, self._at(picture.path[picture.instants[-1]]))
        # The larger sign of the centre of mass hides the dot where that is what follows the path.
        dot(panel, places[-1], track)
        panel.centre_of_mass(self._at(picture.mass))
        if bar is not None:
            panel.line(np.stack([bar - (GRID * self._metre, 0.0), bar]), 1.5, GREY)
        panel.show(frame)

    def _view(self) -> tuple[Points, Points]:
        """The lower left and the upper right corner, m."""
        corners = np.array([self._area.bottomleft, self._area.topright])
        low, high = self._origin + (corners - self._middle) * (1, -1) / self._metre
        return low, high

    def _grid(self) -> None:
        low, high = self._view()
        for axis in (0, 1):
            marks = np.arange(np.ceil(low[axis] / GRID) * GRID, high[axis], GRID)
            lines = np.tile(np.stack([low, high]), (len(marks), 1, 1))
            lines[..., axis] = marks[:, np.newaxis]
            for ends in self._at(lines):
                self._panel.line(ends, 0.8, FAINT)

    def _current(self, picture: Picture) -> None:
        """Draw arrows that drift with the water; the faster it is, the longer they are."""
        speed = float(np.hypot(*picture.current))
        if speed == 0.0:
            return
        moved = drift(picture.scenario.water, picture.time)
        low, high = self._view()
        first, last = (np.rint((edge - moved) / SPACING).astype(int) for edge in (low, high))
        rows = np.arange(first[1] - 1, last[1] + 2)
        columns = np.arange(first[0] - 1, last[0] + 2)
        across, up = (part.ravel() for part in np.meshgrid(columns, rows))
        places = np.stack([across + 0.5 * (up % 2), up], axis=1) * SPACING + moved
        reach = min(LONGEST, SECONDS * speed) * picture.current / speed
        for place in places:
            start, tip = self._at(np.stack([place - reach / 2, place + reach / 2]))
            arrow(self._panel, start, tip, 1.2, STREAM)

    def _body(self, picture: Picture) -> None:
        links = self._at(outlines(picture.robot, picture.body))
        centres = self._at(picture.body.centres)
        size = picture.robot.half_width * self._metre / 11.0
        self._panel.disc((centres[:-1] + centres[1:]) / 2, 6.0 * size, BODY_EDGE)
        for points in links:
            self._panel.shape(points, BODY, BODY_EDGE)
        self._panel.shape(links[0], TAIL, BODY_EDGE)
        self._panel.shape(links[-1], HEAD, HEAD_EDGE)
        eye = centres[-1] + 0.45 * (centres[-1] - centres[-2])
        self._panel.disc(eye, 3.0 * size, HEAD_EDGE)

    def _jets(self, picture: Picture) -> None:
        """Draw the water that leaves a thruster, against its force and beside the body."""
        robot, body = picture.robot, picture.body
        for link, normal, thrust in zip(
            robot.thruster_links, robot.thruster_is_normal, picture.thrust, strict=True
        ):
            angle = body.angles[link]
            tangent = np.array([np.cos(angle), np.sin(angle)])
            left = np.array([-tangent[1], tangent[0]])
            flow = -thrust * (left if normal else tangent)
            for side in (-np.sign(thrust),) if normal else (-1.0, 1.0):
                start = body.centres[link] + 0.9 * side * robot.half_width * left
                jet = JET_LENGTH * self._metre * flow * (1, -1)
                draw_jet(self._panel, self._at(start), jet, 1.0 if normal else 0.6)

    def _path_dots(self, path: Points) -> Points:
        """Points on a path every 4 cm, computed again only for another path."""
        if path is not self._path:
            self._path = path
            length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
            places = np.arange(0.0, length[-1], 0.04)
            self._dots = np.stack([np.interp(places, length, path[:, k]) for k in (0, 1)], axis=1)
        low, high = self._view()
        seen = ((self._dots > low) & (self._dots < high)).all(axis=1)
        return np.asarray(self._dots[seen])

    def _at(self, points: Points) -> Points:
        return np.asarray(self._middle + (points - self._origin) * (self._metre, -self._metre))


class Lens:
    """A round view of the error, magnified, with the goal in its middle."""

    def __init__(self, middle: Points, radius: float, unit: float, ground: Colour = PAPER) -> None:
        """Prepare a view around a point, in points of `unit` pixels, on ground of a colour."""
        (left, top), side = np.floor(middle - radius - 2).tolist(), 2 * radius + 4
        self._panel = panel = Panel(pygame.Rect(left, top, side, side), unit, ground)
        self._middle = middle
        self.reach = 0.84 * radius
        panel.disc(middle, radius + 1.2, RULE)
        inside = PAPER if ground == WATER else WATER
        panel.disc(middle, radius, inside)
        for share in (1.0, 0.5):
            panel.disc(middle, share * self.reach + 0.5, RULE)
            panel.disc(middle, share * self.reach - 0.5, inside)
        cross_hair(panel, middle)
        panel.keep()

    def draw(
        self,
        frame: pygame.Surface,
        follower: Follower,
        errors: Points,
        scale: float,
        colour: Colour = TRAIL,
    ) -> None:
        """Draw an error on a frame.

        Args:
            frame: The frame.
            follower: Whose error it is.
            errors: The error and its last past, m, (n, 2).
            scale: The error at the outer ring, m.
            colour: Its colour.
        """
        marks = errors / scale
        marks /= np.maximum(np.hypot(*marks.T), 1.0)[:, np.newaxis]
        points = self._middle + self.reach * marks * (1, -1)
        self._panel.clear()
        self._panel.line(thinned(points), 1.2, colour)
        arrow(self._panel, self._middle, points[-1], 2.2, colour)
        draw_follower(self._panel, follower, points[-1], colour)
        self._panel.show(frame)


def latest(picture: AnyPicture) -> Points:
    """The errors that a lens shows, m, (n, axes)."""
    return picture.errors[picture.times > picture.time - LENS_PAST]


def cross_hair(panel: Panel, at: Points, size: float = 1.0) -> None:
    """Draw the goal of what follows the path."""
    for arm in np.array([(1.0, 0.0), (0.0, 1.0)]) * 15.0 * size:
        panel.line(np.stack([at - arm, at + arm]), 1.8, REFERENCE)


def draw_follower(panel: Panel, follower: Follower, at: Points, colour: Colour) -> None:
    """Draw what follows the path: a centre of mass by its usual sign, a head as a dot."""
    if follower == "head":
        dot(panel, at, colour)
    else:
        panel.centre_of_mass(at)


def dot(panel: Panel, at: Points, colour: Colour) -> None:
    """Draw a dot that stands out from a line or a body of its colour."""
    panel.disc(at, 5.0, PAPER)
    panel.disc(at, 3.8, colour)


def arrow(panel: Panel, start: Points, tip: Points, width: float, colour: Colour) -> None:
    """Draw a straight arrow, without a shaft if it is short."""
    length = float(np.hypot(*(tip - start)))
    head = 4.0 * width
    if length < 0.5 * head:
        return
    ahead = (tip - start) / length
    across = 0.45 * head * np.array([-ahead[1], ahead[0]])
    neck = tip - min(head, length) * ahead
    panel.line(np.stack([start, neck]), width, colour)
    panel.shape(np.stack([tip, neck + across, neck - across]), colour, colour)


def draw_jet(panel: Panel, start: Points, jet: Points, breadth: float = 1.0) -> None:
    """Draw a jet from a point; both are in points."""
    length = float(np.hypot(*jet))
    if length < 0.8:
        return
    across = 5.0 * breadth * np.array([-jet[1], jet[0]]) / length
    for share, width, colour in ((1.0, 1.0, JET), (0.7, 0.5, JET_CORE)):
        end, wide = start + 0.9 * share * jet, width * across
        tip = start + share * jet
        corners = [start - 0.5 * wide, end - wide, tip, end + wide, start + 0.5 * wide]
        panel.shape(np.array(corners), colour, colour)


def thinned(points: Points, most: int = 4000) -> Points:
    """Keep at most `most` of the points and the last; few choices change as points are added."""
    stride = -(-len(points) // most)
    return points if stride == 1 else np.concatenate([points[::stride], points[-1:]])
