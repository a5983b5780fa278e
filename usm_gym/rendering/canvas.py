"""Draws pictures of the robot (needs the extra `render`)."""

from __future__ import annotations

import numpy as np
import pygame
from numpy.typing import NDArray

from usm_gym.rendering.look import (
    ALARM,
    BODY,
    BODY_EDGE,
    CURRENT,
    ERROR_COLOURS,
    FAINT,
    GREY,
    HEAD,
    HEAD_EDGE,
    HEAD_LINK,
    INK,
    JET,
    JET_CORE,
    LINK,
    PAPER,
    REFERENCE,
    RULE,
    TAIL,
    TRAIL,
    WATER,
    Colour,
    Points,
    outlines,
)
from usm_gym.rendering.panel import LEFT, MIDDLE, RIGHT, Panel, write
from usm_gym.rendering.picture import Picture
from usm_gym.task.loss import LOST_ERROR
from usm_gym.task.scenario import Scenario

Frame = NDArray[np.uint8]

# Everything is laid out on 640 x 480 points.
WIDTH, HEIGHT = 640, 480
SCENE = pygame.Rect(14, 52, 612, 262)
LEGEND = 328
CAPTIONS = 348
LENS, LENS_RADIUS, LENS_REACH = (66.0, 416.0), 50.0, 42.0
LENS_AREA = pygame.Rect(14, 364, 104, 104)
CHART = pygame.Rect(196, 368, 420, 88)
CHART_AREA = CHART.inflate(8, 8)
METRE = 220.0
GRID = 0.5
ARROW, ARROW_AREA = np.array([615.0, 40.0]), pygame.Rect(602, 28, 26, 24)
# Length of a jet at the thruster's limit, m.
JET_LENGTH = 0.36
# How much of the past the lens shows, s.
LENS_PAST = 2.0
SCALES = tuple(digit * 10.0**power for power in (-4, -3, -2, -1, 0) for digit in (1, 2, 5))


def error_scale(errors: Points) -> float:
    """The round number, m, that limits charts of these errors, m."""
    largest = 1.02 * float(np.abs(errors).max(initial=0.0))
    return next((scale for scale in SCALES if scale >= largest), SCALES[-1])


class Canvas:
    """Draws pictures of one size."""

    def __init__(self, width: int = WIDTH) -> None:
        """Prepare to draw frames `width` pixels wide and three quarters of that high."""
        self._unit = width / WIDTH
        self.size = (width, round(HEIGHT * self._unit))
        self._frame = pygame.Surface(self.size)
        self._scene = Panel(SCENE, self._unit, WATER)
        self._arrow = Panel(ARROW_AREA, self._unit)
        self._path: Points | None = None
        self._dots = np.empty((0, 2))
        self._episode: tuple[Scenario, float] | None = None

    def draw(self, picture: Picture, title: str, scale: float | None = None) -> Frame:
        """Draw a picture.

        Args:
            picture: The picture.
            title: The words above it.
            scale: The largest error in lens and chart, m; None fits the errors so far.

        Returns:
            Red, green and blue, (height, width, 3).
        """
        scale = scale or error_scale(picture.errors)
        if self._episode != (picture.scenario, scale):
            self._episode = (picture.scenario, scale)
            self._draw_still_parts(picture.scenario, scale)
        self._frame.blit(self._still, (0, 0))
        self._headline(picture, title)
        self._swimming(picture)
        self._error_in_lens(picture, scale)
        self._curves(picture, scale)
        pixels = np.empty((self.size[1], self.size[0], 3), np.uint8)
        pygame.image.frombuffer(pixels.data, self.size, "RGB").blit(self._frame, (0, 0))
        return pixels

    def _draw_still_parts(self, scenario: Scenario, scale: float) -> None:
        """Draw what all frames of an episode share."""
        self._frame.fill(PAPER)
        self._legend(scenario)
        self._empty_lens(scale)
        self._empty_chart(scenario, scale)
        self._still = self._frame.copy()

    def _headline(self, picture: Picture, title: str) -> None:
        settle_time = picture.scenario.settle_time
        self._text(title, (14, 7), 17, INK)
        self._text(f"{picture.time:.1f} s", (626, 7), 17, INK, RIGHT)
        if picture.lost:
            self._text(f"robot lost: more than {LOST_ERROR:g} m away", (14, 31), 12, ALARM)
        elif picture.time < settle_time:
            self._text(f"settling; scored from {settle_time:g} s on", (14, 31), 12, GREY)
        else:
            x = self._text(f"largest error since {settle_time:g} s:", (14, 31), 12, GREY)
            for axis, colour in enumerate(ERROR_COLOURS):
                value = f"{'xy'[axis]} {_mm(picture.max_error[axis])}"
                x = self._text(value, (x + 10, 31), 12, colour)
        self._current(picture.current)

    def _current(self, current: Points) -> None:
        speed = float(np.hypot(*current))
        if speed == 0.0:
            self._text("still water", (626, 31), 12, GREY, RIGHT)
            return
        self._text(f"current {100 * speed:.1f} cm/s", (600, 31), 12, GREY, RIGHT)
        ahead = current * (1, -1) / speed
        across = np.array([-ahead[1], ahead[0]])
        tip, neck = ARROW + 10 * ahead, ARROW + ahead
        self._arrow.clear()
        self._arrow.line(np.stack([ARROW - 10 * ahead, neck]), 2.0, CURRENT)
        head = np.stack([tip, neck + 4.5 * across, neck - 4.5 * across])
        self._arrow.shape(head, CURRENT, CURRENT)
        self._arrow.show(self._frame)

    def _swimming(self, picture: Picture) -> None:
        """Draw the robot and its path."""
        scene = self._scene
        scene.clear()
        self._centre = picture.path[picture.instants[-1]]
        self._grid()
        for points in self._in_scene(outlines(picture.robot, picture.reference)):
            scene.outline(points, 1.5, REFERENCE)
        self._jets(picture)
        self._body(picture)
        scene.disc(self._in_scene(self._path_dots(picture.path)), 1.3, INK)
        trail = picture.path[picture.instants] + picture.errors
        scene.line(self._in_scene(_thinned(trail, 500)), 2.2, TRAIL)
        scene.centre_of_mass(self._in_scene(trail[-1]))
        right, bottom = SCENE.right - 14.0, SCENE.bottom - 8.0
        bar = np.array([[right - GRID * METRE, bottom], [right, bottom]])
        scene.line(bar, 1.5, GREY)
        scene.show(self._frame)
        self._text(f"{GRID:g} m", (bar[:, 0].mean(), bottom - 15), 10, GREY, MIDDLE)

    def _grid(self) -> None:
        half = np.array(SCENE.size) / (2 * METRE)
        low, high = self._centre - half, self._centre + half
        for axis in (0, 1):
            marks = np.arange(np.ceil(low[axis] / GRID) * GRID, high[axis], GRID)
            lines = np.tile(np.stack([low, high]), (len(marks), 1, 1))
            lines[..., axis] = marks[:, np.newaxis]
            for ends in self._in_scene(lines):
                self._scene.line(ends, 0.8, FAINT)

    def _body(self, picture: Picture) -> None:
        links = self._in_scene(outlines(picture.robot, picture.body))
        centres = self._in_scene(picture.body.centres)
        self._scene.disc((centres[:-1] + centres[1:]) / 2, 6.0, BODY_EDGE)
        for points in links:
            self._scene.shape(points, BODY, BODY_EDGE)
        self._scene.shape(links[0], TAIL, BODY_EDGE)
        self._scene.shape(links[-1], HEAD, HEAD_EDGE)
        self._scene.disc(centres[-1] + 0.45 * (centres[-1] - centres[-2]), 3.0, HEAD_EDGE)

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
                breadth = 1.0 if normal else 0.6
                _draw_jet(self._scene, self._in_scene(start), flow * (1, -1), breadth)

    def _path_dots(self, path: Points) -> Points:
        """Points on a path every 4 cm, computed again only for another path."""
        if path is not self._path:
            self._path = path
            length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
            places = np.arange(0.0, length[-1], 0.04)
            self._dots = np.stack([np.interp(places, length, path[:, k]) for k in (0, 1)], axis=1)
        seen = np.abs(self._dots - self._centre).max(axis=1, initial=0.0) < WIDTH / (2 * METRE)
        return np.asarray(self._dots[seen])

    def _in_scene(self, points: Points) -> Points:
        return np.asarray(SCENE.center + (points - self._centre) * (METRE, -METRE))

    def _empty_lens(self, scale: float) -> None:
        magnification = float(f"{LENS_REACH / scale / METRE:.2g}")
        self._text(f"error, {magnification:g} times as large", (14, CAPTIONS), 10, GREY)
        self._text(_limit(scale), (LENS[0] + LENS_RADIUS + 4, LENS[1] - 7), 10, GREY)
        middle = np.array(LENS)
        lens = self._lens = Panel(LENS_AREA, self._unit)
        lens.disc(middle, LENS_RADIUS + 1.2, RULE)
        lens.disc(middle, LENS_RADIUS, WATER)
        for share in (1.0, 0.5):
            lens.disc(middle, share * LENS_REACH + 0.5, RULE)
            lens.disc(middle, share * LENS_REACH - 0.5, WATER)
        for arm in ((LENS_REACH, 0.0), (0.0, LENS_REACH)):
            lens.line(np.stack([middle - arm, middle + arm]), 0.8, RULE)
        lens.keep()

    def _error_in_lens(self, picture: Picture, scale: float) -> None:
        """The error of the centre of mass, magnified; the reference is in the middle."""
        past = round(LENS_PAST / picture.scenario.conditions.control_period)
        marks = picture.errors[-past:] / scale
        marks /= np.maximum(np.hypot(*marks.T), 1.0)[:, np.newaxis]
        points = np.array(LENS) + LENS_REACH * marks * (1, -1)
        self._lens.clear()
        self._lens.line(_thinned(points), 1.2, TRAIL)
        self._lens.disc(np.array(LENS), 2.5, REFERENCE)
        self._lens.centre_of_mass(points[-1])
        self._lens.show(self._frame)

    def _empty_chart(self, scenario: Scenario, scale: float) -> None:
        x = self._text("error of the centre of mass:", (CHART.left, CAPTIONS), 10, GREY)
        for axis, colour in enumerate(ERROR_COLOURS):
            x = self._text("xy"[axis], (x + 8, CAPTIONS), 10, colour)
        for share, sign in ((-1.0, "+"), (0.85, "−")):
            y = CHART.centery + share * CHART.height / 2 - 6
            self._text(sign + _limit(scale), (CHART.left - 5, y), 10, GREY, RIGHT)
        for mark in np.linspace(0.0, scenario.duration, 5):
            x = CHART.left + CHART.width * mark / scenario.duration
            self._text(f"{mark:g} s", (x, CHART.bottom + 4), 10, GREY, MIDDLE)
        chart = self._chart = Panel(CHART_AREA, self._unit)
        width = CHART.width / scenario.duration
        settling = pygame.Rect(CHART.topleft, (round(scenario.settle_time * width), CHART.height))
        chart.block(settling, WATER)
        for share in (-1.0, 0.0, 1.0):
            y = CHART.centery + share * CHART.height / 2
            chart.line(np.array([[CHART.left, y], [CHART.right, y]]), 0.8, RULE)
        for shift in scenario.shifts:
            chart.dashes(CHART.left + shift * width, CHART.top, CHART.bottom, HEAD)
        chart.keep()

    def _curves(self, picture: Picture, scale: float) -> None:
        scenario = picture.scenario
        time = picture.instants * scenario.conditions.control_period
        heights = np.clip(picture.errors / scale, -1.0, 1.0) * CHART.height / 2
        self._chart.clear()
        for axis, colour in enumerate(ERROR_COLOURS):
            across = CHART.left + CHART.width * time / scenario.duration
            curve = np.stack([across, CHART.centery - heights[:, axis]], axis=1)
            self._chart.line(_thinned(curve), 1.5, colour)
            self._chart.disc(curve[-1], 2.2, colour)
        self._chart.show(self._frame)

    def _legend(self, scenario: Scenario) -> None:
        """Draw the symbols, with their names to the right of them."""
        limit = scenario.conditions.thruster_limit
        jet = 0.5 * JET_LENGTH * METRE
        signs = [("head", 16), ("centre of mass", 14), ("path", 20), ("track", 18)]
        signs += [("reference posture", 20), (f"thrust of {limit / 2:g} N", round(jet))]
        signs += [("joints bend", 6)] if scenario.shifts else []
        x, y = 14.0, LEGEND
        for k, (name, width) in enumerate(signs):
            x = round(x)
            sign = Panel(pygame.Rect(x - 1, y - 10, width + 2, 20), self._unit)
            ends = np.array([[x, y], [x + width, y]])
            middle = ends.mean(axis=0)
            if k == 0:
                sign.shape((x + 0.43 * width, y) + HEAD_LINK * (0.43 * width, 4.5), HEAD, HEAD_EDGE)
            elif k == 1:
                sign.centre_of_mass(middle)
            elif k == 2:
                sign.disc(np.linspace(ends[0], ends[1], 7)[1::2], 1.3, INK)
            elif k == 3:
                sign.line(ends, 2.2, TRAIL)
            elif k == 4:
                sign.outline(middle + LINK * (0.5 * width, 5.0), 1.5, REFERENCE)
            elif k == 5:
                _draw_jet(sign, ends[0], np.array([0.5, 0.0]))
            else:
                sign.dashes(middle[0], y - 7, y + 7, HEAD)
            sign.show(self._frame)
            x = self._text(name, (x + width + 4, y - 7), 10, GREY) + 11

    def _text(
        self, text: str, at: tuple[float, float], size: int, colour: Colour, align: float = LEFT
    ) -> float:
        return write(self._frame, self._unit, text, at, size, colour, align)


def _draw_jet(panel: Panel, start: Points, flow: Points, breadth: float = 1.0) -> None:
    """Draw a jet from a point of the canvas; a flow of length one is that at the limit."""
    strength = np.hypot(*flow)
    if strength < 0.01:
        return
    ahead = JET_LENGTH * METRE * flow
    across = 5.0 * breadth * np.array([-flow[1], flow[0]]) / strength
    for share, width, colour in ((1.0, 1.0, JET), (0.7, 0.5, JET_CORE)):
        end, wide = start + 0.9 * share * ahead, width * across
        tip = start + share * ahead
        corners = [start - 0.5 * wide, end - wide, tip, end + wide, start + 0.5 * wide]
        panel.shape(np.array(corners), colour, colour)


def _thinned(points: Points, most: int = 4000) -> Points:
    """Keep at most `most` of the points and the last; few choices change as points are added."""
    stride = -(-len(points) // most)
    return points if stride == 1 else np.concatenate([points[::stride], points[-1:]])


def _limit(metres: float) -> str:
    return f"{1e3 * metres:g} mm"


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.{1 if metres >= 0.01 else 2}f} mm"
