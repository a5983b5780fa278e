"""Draws pictures of the robot (needs the extra `render`)."""

from __future__ import annotations

import numpy as np
import pygame
from numpy.typing import NDArray

from usm_gym.rendering.look import (
    ALARM,
    CURRENT,
    ERROR_COLOURS,
    GREY,
    HEAD,
    HEAD_EDGE,
    HEAD_LINK,
    INK,
    LINK,
    PAPER,
    RULE,
    TRAIL,
    WATER,
    Colour,
    Points,
)
from usm_gym.rendering.panel import LEFT, MIDDLE, RIGHT, Panel, write
from usm_gym.rendering.picture import Picture
from usm_gym.rendering.scene import (
    GRID,
    JET_LENGTH,
    OUTLINE,
    Lens,
    Scene,
    arrow,
    cross_hair,
    draw_jet,
    thinned,
)
from usm_gym.task.loss import LOST_ERROR
from usm_gym.task.scenario import Scenario

Frame = NDArray[np.uint8]

# Everything is laid out on 640 x 480 points.
WIDTH, HEIGHT = 640, 480
SCENE = pygame.Rect(14, 52, 612, 262)
LEGEND = 328
CAPTIONS = 348
LENS, LENS_RADIUS = (66.0, 416.0), 50.0
CHART = pygame.Rect(196, 368, 420, 88)
CHART_AREA = CHART.inflate(8, 8)
METRE = 220.0
ARROW, ARROW_AREA = np.array([615.0, 40.0]), pygame.Rect(602, 28, 26, 24)
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
        self._scene = Scene(SCENE, self._unit, METRE, np.array(SCENE.center))
        self._lens = Lens(np.array(LENS), LENS_RADIUS, self._unit)
        self._arrow = Panel(ARROW_AREA, self._unit)
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
        self._lens.draw(self._frame, picture, scale)
        self._curves(picture, scale)
        pixels = np.empty((self.size[1], self.size[0], 3), np.uint8)
        pygame.image.frombuffer(pixels.data, self.size, "RGB").blit(self._frame, (0, 0))
        return pixels

    def _draw_still_parts(self, scenario: Scenario, scale: float) -> None:
        """Draw what all frames of an episode share."""
        self._frame.fill(PAPER)
        self._legend(scenario)
        self._lens_words(scale)
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
        ahead = 10 * current * (1, -1) / speed
        self._arrow.clear()
        arrow(self._arrow, ARROW - ahead, ARROW + ahead, 2.2, CURRENT)
        self._arrow.show(self._frame)

    def _swimming(self, picture: Picture) -> None:
        """Draw the robot and its path."""
        bar = np.array([SCENE.right - 14.0, SCENE.bottom - 8.0])
        self._scene.draw(self._frame, picture, bar=bar)
        middle = bar[0] - GRID * METRE / 2
        self._text(f"{GRID:g} m", (middle, bar[1] - 15), 10, GREY, MIDDLE)

    def _lens_words(self, scale: float) -> None:
        magnification = float(f"{self._lens.reach / scale / METRE:.2g}")
        self._text(f"error, {magnification:g} times as large", (14, CAPTIONS), 10, GREY)
        self._text(_limit(scale), (LENS[0] + LENS_RADIUS + 4, LENS[1] - 7), 10, GREY)

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
            self._chart.line(thinned(curve), 1.5, colour)
            self._chart.disc(curve[-1], 2.2, colour)
        self._chart.show(self._frame)

    def _legend(self, scenario: Scenario) -> None:
        """Draw the symbols, with their names to the right of them."""
        limit = scenario.conditions.thruster_limit
        jet = 0.5 * JET_LENGTH * METRE
        signs = [
            ("head", 16),
            ("centre of mass", 14),
            ("its goal", 18),
            ("path", 20),
            ("track", 18),
        ]
        signs += [("reference", 20), (f"thrust of {limit / 2:g} N", round(jet))]
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
                cross_hair(sign, middle, 0.6)
            elif k == 3:
                sign.disc(np.linspace(ends[0], ends[1], 7)[1::2], 1.3, INK)
            elif k == 4:
                sign.line(ends, 2.2, TRAIL)
            elif k == 5:
                sign.outline(middle + LINK * (0.5 * width, 5.0), 1.5, OUTLINE)
            elif k == 6:
                draw_jet(sign, ends[0], np.array([jet, 0.0]))
            else:
                sign.dashes(middle[0], y - 7, y + 7, HEAD)
            sign.show(self._frame)
            x = self._text(name, (x + width + 4, y - 7), 10, GREY) + 11

    def _text(
        self, text: str, at: tuple[float, float], size: int, colour: Colour, align: float = LEFT
    ) -> float:
        return write(self._frame, self._unit, text, at, size, colour, align)


def _limit(metres: float) -> str:
    return f"{1e3 * metres:g} mm"


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.{1 if metres >= 0.01 else 2}f} mm"
