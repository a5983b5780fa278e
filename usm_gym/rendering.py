"""Draws pictures of the robot, and shows them in a window (needs the extra `render`)."""

from __future__ import annotations

import io
import os
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from usm_gym.metrics import LOST_ERROR
from usm_gym.picture import Picture, Posture
from usm_gym.scenario import Scenario

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import matplotlib
import pygame

Frame = NDArray[np.uint8]
Points = NDArray[np.float64]
Colour = tuple[int, int, int]
Word = tuple[pygame.Surface, tuple[int, int]]

# Okabe and Ito's colours, which the colour-blind tell apart, and tints of them.
INK, GREY, FAINT, RULE = (38, 50, 56), (96, 110, 118), (222, 230, 235), (200, 210, 217)
PAPER, WATER = (255, 255, 255), (243, 248, 251)
ERROR_COLOURS = ((0, 114, 178), (213, 94, 0))
BODY, BODY_EDGE = (203, 215, 224), (84, 104, 120)
HEAD, HEAD_EDGE = (240, 178, 60), (140, 92, 0)
TAIL = (150, 168, 182)
JET, JET_CORE = (176, 218, 243), (86, 180, 233)
CURRENT = (70, 130, 160)
REFERENCE = (196, 120, 164)
TRAIL = (0, 140, 105)
ALARM = (176, 36, 24)

# Everything is laid out on 640 x 480 points, drawn OVER times as large and scaled down, which
# smooths all edges; text is smooth by itself.
WIDTH, HEIGHT = 640, 480
OVER = 2
SCENE = pygame.Rect(14, 52, 612, 262)
LEGEND = 328
CAPTIONS = 348
LENS, LENS_RADIUS, LENS_REACH = (66.0, 416.0), 50.0, 42.0
CHART = pygame.Rect(196, 368, 420, 88)
METRE = 220.0
GRID = 0.5
ARROW = np.array([615.0, 40.0])
# Length of a jet at the thruster's limit, m.
JET_LENGTH = 0.36
# How much of the past is seen in the lens, s.
LENS_PAST = 2.0
SCALES = tuple(digit * 10.0**power for power in (-4, -3, -2, -1, 0) for digit in (1, 2, 5))
LEFT, MIDDLE, RIGHT = 0.0, 0.5, 1.0
# Superellipses, tail to head: the outline of a link over its half length and half width.
_TURN = np.linspace(0.0, 2 * np.pi, 28, endpoint=False)
_COS, _SIN = np.cos(_TURN), np.sin(_TURN)
LINK = np.stack([_COS, _SIN], axis=1)
LINK = np.sign(LINK) * np.abs(LINK) ** (0.45, 0.6)
HEAD_LINK = np.where(_COS[:, np.newaxis] > 0, np.stack([1.35 * _COS, _SIN], axis=1), LINK)


def error_scale(errors: Points) -> float:
    """The round number, m, up to which charts of these errors, m, reach."""
    largest = 1.02 * float(np.abs(errors).max(initial=0.0))
    return next((scale for scale in SCALES if scale >= largest), SCALES[-1])


class Canvas:
    """Draws pictures of one size."""

    def __init__(self, width: int = WIDTH) -> None:
        """Prepare to draw frames `width` pixels wide and three quarters of that high."""
        self._unit = width / WIDTH
        self.size = (width, round(HEIGHT * self._unit))
        self._large = pygame.Surface((OVER * self.size[0], OVER * self.size[1]))
        self._frame = pygame.Surface(self.size)
        self._path: Points | None = None
        self._dots = np.empty((0, 2))
        self._words: list[Word] = []
        self._still: tuple[Scenario, float, pygame.Surface, tuple[Word, ...]] | None = None

    def draw(self, picture: Picture, title: str, scale: float | None = None) -> Frame:
        """Draw a picture.

        Args:
            picture: What is to be seen.
            title: What is written above it.
            scale: Up to which error lens and chart reach, m; None fits the errors so far.

        Returns:
            Red, green and blue, (height, width, 3).
        """
        scale = scale or error_scale(picture.errors)
        self._still_parts(picture.scenario, scale)
        self._headline(picture, title)
        self._scene(picture)
        self._error_in_lens(picture, scale)
        self._curves(picture, scale)
        pygame.transform.smoothscale(self._large, self.size, self._frame)
        self._frame.blits(self._words)
        pixels = bytearray(pygame.image.tobytes(self._frame, "RGB"))
        return np.frombuffer(pixels, np.uint8).reshape(self.size[1], self.size[0], 3)

    def _still_parts(self, scenario: Scenario, scale: float) -> None:
        """What all frames of an episode share, kept as long as it is the same."""
        if self._still is None or self._still[:2] != (scenario, scale):
            self._words.clear()
            self._large.fill(PAPER)
            pygame.draw.rect(self._large, WATER, self._rect(SCENE))
            self._legend(scenario)
            self._lens(scale)
            self._chart(scenario, scale)
            self._still = (scenario, scale, self._large.copy(), tuple(self._words))
        _, _, drawn, words = self._still
        self._large.blit(drawn, (0, 0))
        self._words[:] = words

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

    def _scene(self, picture: Picture) -> None:
        self._large.set_clip(self._rect(SCENE))
        self._centre = picture.path[picture.instants[-1]]
        self._grid()
        self._outline(picture, picture.reference, REFERENCE)
        self._jets(picture)
        self._body(picture)
        for dot in self._in_scene(self._path_dots(picture.path)):
            self._disc(dot, 1.3, INK)
        trail = picture.path[picture.instants] + picture.errors
        self._line(self._in_scene(_thinned(trail, 500)), 2.2, TRAIL)
        self._centre_of_mass(self._in_scene(trail[-1:])[0])
        self._large.set_clip(None)
        right, bottom = SCENE.right - 14.0, SCENE.bottom - 8.0
        bar = np.array([[right - GRID * METRE, bottom], [right, bottom]])
        self._line(self._at(bar), 1.5, GREY)
        self._text(f"{GRID:g} m", (bar[:, 0].mean(), bottom - 15), 10, GREY, MIDDLE)

    def _grid(self) -> None:
        half = np.array(SCENE.size) / (2 * METRE)
        for axis in (0, 1):
            first = np.ceil((self._centre[axis] - half[axis]) / GRID) * GRID
            for value in np.arange(first, self._centre[axis] + half[axis], GRID):
                ends = np.stack([self._centre - half, self._centre + half])
                ends[:, axis] = value
                self._line(self._in_scene(ends), 0.8, FAINT)

    def _outline(self, picture: Picture, posture: Posture, colour: Colour) -> None:
        for points in self._in_scene(_links(picture, posture)):
            pygame.draw.polygon(self._large, colour, points, self._thick(1.5))

    def _body(self, picture: Picture) -> None:
        links = self._in_scene(_links(picture, picture.body))
        centres = self._in_scene(picture.body.centres)
        for before, after in pairwise(centres):
            self._disc((before + after) / 2, 6.0, BODY_EDGE)
        for points in links:
            self._shape(points, BODY, BODY_EDGE)
        self._shape(links[0], TAIL, BODY_EDGE)
        self._shape(links[-1], HEAD, HEAD_EDGE)
        self._disc(centres[-1] + 0.45 * (centres[-1] - centres[-2]), 3.0, HEAD_EDGE)

    def _jets(self, picture: Picture) -> None:
        """Water leaves a thruster against its force, beside the body."""
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
                self._jet(self._in_scene(start), flow * (1, -1), 1.0 if normal else 0.6)

    def _jet(self, start: Points, flow: Points, breadth: float = 1.0) -> None:
        """A jet from a point of the canvas; a flow of length one is that at the limit."""
        strength = np.hypot(*flow)
        if strength < 0.01:
            return
        ahead = self._at(JET_LENGTH * METRE * flow)
        across = self._at(5.0 * breadth * np.array([-flow[1], flow[0]]) / strength)
        for share, width, colour in ((1.0, 1.0, JET), (0.7, 0.5, JET_CORE)):
            end, wide = start + 0.9 * share * ahead, width * across
            tip = start + share * ahead
            corners = [start - 0.5 * wide, end - wide, tip, end + wide, start + 0.5 * wide]
            self._shape(np.array(corners), colour, colour)

    def _centre_of_mass(self, at: Points) -> None:
        """The usual sign: a disc in quarters."""
        radius = 6.0
        self._disc(at, radius + 1.2, INK)
        self._disc(at, radius, PAPER)
        quarters = {"draw_top_right": True, "draw_bottom_left": True}
        scale = OVER * self._unit
        pygame.draw.circle(self._large, INK, at.tolist(), radius * scale, **quarters)

    def _current(self, current: Points) -> None:
        speed = float(np.hypot(*current))
        if speed == 0.0:
            self._text("still water", (626, 31), 12, GREY, RIGHT)
            return
        self._text(f"current {100 * speed:.1f} cm/s", (600, 31), 12, GREY, RIGHT)
        ahead = current * (1, -1) / speed
        across = np.array([-ahead[1], ahead[0]])
        tip, neck = ARROW + 10 * ahead, ARROW + ahead
        self._line(self._at(np.stack([ARROW - 10 * ahead, neck])), 2.0, CURRENT)
        head = np.stack([tip, neck + 4.5 * across, neck - 4.5 * across])
        self._shape(self._at(head), CURRENT, CURRENT)

    def _lens(self, scale: float) -> None:
        magnification = float(f"{LENS_REACH / scale / METRE:.2g}")
        self._text(f"error, {magnification:g} times as large", (14, CAPTIONS), 10, GREY)
        self._text(_limit(scale), (LENS[0] + LENS_RADIUS + 4, LENS[1] - 7), 10, GREY)
        middle = self._at(np.array(LENS))
        self._disc(middle, LENS_RADIUS + 1.2, RULE)
        self._disc(middle, LENS_RADIUS, WATER)
        for share in (1.0, 0.5):
            self._disc(middle, share * LENS_REACH + 0.5, RULE)
            self._disc(middle, share * LENS_REACH - 0.5, WATER)
        for arm in ((LENS_REACH, 0.0), (0.0, LENS_REACH)):
            ends = np.stack([np.subtract(LENS, arm), np.add(LENS, arm)])
            self._line(self._at(ends), 0.8, RULE)

    def _error_in_lens(self, picture: Picture, scale: float) -> None:
        """The error of the centre of mass, magnified; the reference is in the middle."""
        past = round(LENS_PAST / picture.scenario.conditions.control_period)
        marks = picture.errors[-past:] / scale
        marks /= np.maximum(np.hypot(*marks.T), 1.0)[:, np.newaxis]
        points = self._at(np.array(LENS) + LENS_REACH * marks * (1, -1))
        self._line(_thinned(points), 1.2, TRAIL)
        self._disc(self._at(np.array(LENS)), 2.5, REFERENCE)
        self._centre_of_mass(points[-1])

    def _chart(self, scenario: Scenario, scale: float) -> None:
        x = self._text("error of the centre of mass:", (CHART.left, CAPTIONS), 10, GREY)
        for axis, colour in enumerate(ERROR_COLOURS):
            x = self._text("xy"[axis], (x + 8, CAPTIONS), 10, colour)
        for share, sign in ((-1.0, "+"), (0.85, "−")):
            y = CHART.centery + share * CHART.height / 2 - 6
            self._text(sign + _limit(scale), (CHART.left - 5, y), 10, GREY, RIGHT)
        for mark in np.linspace(0.0, scenario.duration, 5):
            x = CHART.left + CHART.width * mark / scenario.duration
            self._text(f"{mark:g} s", (x, CHART.bottom + 4), 10, GREY, MIDDLE)
        width = CHART.width / scenario.duration
        settling = pygame.Rect(CHART.topleft, (round(scenario.settle_time * width), CHART.height))
        pygame.draw.rect(self._large, WATER, self._rect(settling))
        for share in (-1.0, 0.0, 1.0):
            y = CHART.centery + share * CHART.height / 2
            ends = np.array([[CHART.left, y], [CHART.right, y]])
            self._line(self._at(ends), 0.8, RULE)
        for shift in scenario.shifts:
            self._dashes(CHART.left + shift * width, CHART.top, CHART.bottom)

    def _curves(self, picture: Picture, scale: float) -> None:
        scenario = picture.scenario
        time = picture.instants * scenario.conditions.control_period
        heights = np.clip(picture.errors / scale, -1.0, 1.0) * CHART.height / 2
        for axis, colour in enumerate(ERROR_COLOURS):
            across = CHART.left + CHART.width * time / scenario.duration
            curve = np.stack([across, CHART.centery - heights[:, axis]], axis=1)
            self._line(self._at(_thinned(curve)), 1.5, colour)
            self._disc(self._at(curve[-1]), 2.2, colour)

    def _legend(self, scenario: Scenario) -> None:
        """What the signs mean; each sign is drawn left of its name."""
        limit = scenario.conditions.thruster_limit
        jet = 0.5 * JET_LENGTH * METRE
        signs = [("head", 16.0), ("centre of mass", 13.0), ("path", 20.0), ("track", 18.0)]
        signs += [("reference posture", 20.0), (f"thrust of {limit / 2:g} N", jet)]
        signs += [("joints bend", 6.0)] if scenario.shifts else []
        x, y = 14.0, LEGEND
        for k, (name, width) in enumerate(signs):
            ends = self._at(np.array([[x, y], [x + width, y]]))
            if k == 0:
                link = self._at((x + 0.43 * width, y) + HEAD_LINK * (0.43 * width, 4.5))
                self._shape(link, HEAD, HEAD_EDGE)
            elif k == 1:
                self._centre_of_mass(self._at(np.array([x + width / 2, y])))
            elif k == 2:
                for share in (0.1, 0.5, 0.9):
                    self._disc(ends[0] + share * (ends[1] - ends[0]), 1.3, INK)
            elif k == 3:
                self._line(ends, 2.2, TRAIL)
            elif k == 4:
                link = self._at((x + width / 2, y) + LINK * (0.5 * width, 5.0))
                pygame.draw.polygon(self._large, REFERENCE, link, self._thick(1.5))
            elif k == 5:
                self._jet(ends[0], np.array([0.5, 0.0]))
            else:
                self._dashes(x + width / 2, y - 7, y + 7)
            x = self._text(name, (x + width + 4, y - 7), 10, GREY) + 11

    def _dashes(self, x: float, top: float, bottom: float) -> None:
        for y in np.arange(top, bottom, 6.0):
            self._line(self._at(np.array([[x, y], [x, y + 3]])), 1.0, HEAD)

    def _path_dots(self, path: Points) -> Points:
        """Points on a path every 4 cm, kept as long as the path is the same."""
        if path is not self._path:
            self._path = path
            length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
            places = np.arange(0.0, length[-1], 0.04)
            self._dots = np.stack([np.interp(places, length, path[:, k]) for k in (0, 1)], axis=1)
        seen = np.abs(self._dots - self._centre).max(axis=1, initial=0.0) < WIDTH / (2 * METRE)
        return np.asarray(self._dots[seen])

    def _in_scene(self, points: Points) -> Points:
        return self._at(SCENE.center + (points - self._centre) * (METRE, -METRE))

    def _at(self, points: Points) -> Points:
        return np.asarray(points * (OVER * self._unit))

    def _rect(self, rect: pygame.Rect) -> pygame.Rect:
        left, top, width, height = (round(OVER * self._unit * each) for each in rect)
        return pygame.Rect(left, top, width, height)

    def _disc(self, at: Points, radius: float, colour: Colour) -> None:
        pygame.draw.circle(self._large, colour, at.tolist(), radius * OVER * self._unit)

    def _line(self, points: Points, width: float, colour: Colour) -> None:
        if len(points) > 1:
            pygame.draw.lines(self._large, colour, False, points.tolist(), self._thick(width))

    def _thick(self, width: float) -> int:
        return max(1, round(width * OVER * self._unit))

    def _shape(self, points: Points, colour: Colour, edge: Colour) -> None:
        corners = points.tolist()
        pygame.draw.polygon(self._large, colour, corners)
        pygame.draw.aalines(self._large, edge, True, corners)

    def _text(
        self, text: str, at: tuple[float, float], size: int, colour: Colour, align: float = LEFT
    ) -> float:
        """Write once the frame has its size; tells where the text ends, in points."""
        image = _font(round(size * self._unit)).render(text, True, colour)
        x = at[0] * self._unit - align * image.get_width()
        self._words.append((image, (round(x), round(at[1] * self._unit))))
        return (x + image.get_width()) / self._unit


class Window:
    """A window that shows frames; closing it by hand makes `show` do nothing from then on."""

    def __init__(self, size: tuple[int, int], title: str) -> None:
        """Open it."""
        if not pygame.display.get_init():
            pygame.display.init()
        self._window = pygame.Window(title, size)
        self._clock = pygame.time.Clock()
        _windows.add(self._window)

    @property
    def closed(self) -> bool:
        """Whether it is gone."""
        return self._window not in _windows

    def show(self, frame: Frame, fps: float) -> None:
        """Show a frame, no earlier than 1 / fps seconds after the one before."""
        for event in pygame.event.get():
            if event.type == pygame.WINDOWCLOSE or (
                event.type == pygame.KEYDOWN and event.key in (pygame.K_ESCAPE, pygame.K_q)
            ):
                _close(event.window)
        if self.closed:
            return
        image = pygame.image.frombuffer(frame.tobytes(), frame.shape[1::-1], "RGB")
        self._window.get_surface().blit(image, (0, 0))
        self._window.flip()
        self._clock.tick(fps)

    def close(self) -> None:
        """Close it, and with the last one the connection to the display."""
        _close(self._window)


_windows: set[pygame.Window] = set()


def has_display() -> bool:
    """Whether a window could be seen; elsewhere they are drawn into memory."""
    pygame.display.init()
    try:
        return pygame.display.get_driver() != "offscreen"
    finally:
        if not _windows:
            pygame.display.quit()


def _close(window: pygame.Window | None) -> None:
    if window not in _windows:
        return
    _windows.remove(window)
    window.destroy()
    if not _windows:
        pygame.display.quit()


@cache
def _font(size: int) -> pygame.font.Font:
    # From memory, for a font keeps its file open.
    file = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    pygame.font.init()
    return pygame.font.Font(io.BytesIO(file.read_bytes()), size)


def _links(picture: Picture, posture: Posture) -> Points:
    """Outlines of the links, m, (links, corners, 2)."""
    robot = picture.robot
    outlines = np.repeat(LINK[np.newaxis], robot.links, axis=0)
    outlines[-1] = HEAD_LINK
    outlines = outlines * (0.97 * robot.half_length, robot.half_width)
    along = np.stack([np.cos(posture.angles), np.sin(posture.angles)], axis=1)[:, np.newaxis]
    left = along[..., ::-1] * (-1, 1)
    turned = outlines[..., :1] * along + outlines[..., 1:] * left
    return np.asarray(posture.centres[:, np.newaxis] + turned)


def _thinned(points: Points, most: int = 4000) -> Points:
    """At most so many of the points, and the last; which ones hardly changes as they grow."""
    stride = -(-len(points) // most)
    return points if stride == 1 else np.concatenate([points[::stride], points[-1:]])


def _limit(metres: float) -> str:
    return f"{1e3 * metres:g} mm"


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.{1 if metres >= 0.01 else 2}f} mm"
