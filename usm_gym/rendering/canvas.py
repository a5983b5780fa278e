"""Draws pictures of the robot (needs the extra `render`)."""

from __future__ import annotations

from functools import partial

import numpy as np
import pygame

from usm_gym.rendering import legend
from usm_gym.rendering.chart import Chart, error_scale, in_mm, measured
from usm_gym.rendering.look import (
    ALARM,
    CURRENT,
    ERROR_COLOURS,
    GREY,
    HEIGHT,
    INK,
    PAPER,
    WIDTH,
    Colour,
    Frame,
    Points,
)
from usm_gym.rendering.panel import LEFT, MIDDLE, RIGHT, Panel, write
from usm_gym.rendering.picture import Picture
from usm_gym.rendering.scene import (
    GRID,
    JET_LENGTH,
    Lens,
    Scene,
    arrow,
    latest,
)
from usm_gym.task.loss import LOST_ERROR
from usm_gym.task.scenario import Scenario

# Places, points.
SCENE = pygame.Rect(14, 52, 612, 262)
LEGEND = 328
CAPTIONS = 348
LENS, LENS_RADIUS = (66.0, 416.0), 50.0
CHART = pygame.Rect(196, 368, 420, 88)
METRE = 220.0
ARROW, ARROW_AREA = np.array([615.0, 40.0]), pygame.Rect(602, 28, 26, 24)


class Canvas:
    """Draws pictures of one size."""

    def __init__(self, width: int = WIDTH, metre: float = METRE) -> None:
        """Prepare to draw frames `width` pixels wide and three quarters of that high.

        Args:
            width: Pixels.
            metre: Points in a metre of the scene.
        """
        self._unit, self._metre = width / WIDTH, metre
        self.size = (width, round(HEIGHT * self._unit))
        self._frame = pygame.Surface(self.size)
        self._scene = Scene(SCENE, self._unit, metre, np.array(SCENE.center))
        self._lens = Lens(np.array(LENS), LENS_RADIUS, self._unit)
        self._chart = Chart(CHART, CAPTIONS, self._unit, "xy", ERROR_COLOURS)
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
            self._draw_still_parts(picture, scale)
        self._frame.blit(self._still, (0, 0))
        self._headline(picture, title)
        self._swimming(picture)
        self._lens.draw(self._frame, picture.follower, latest(picture), scale)
        self._chart.draw(self._frame, picture.times, picture.errors)
        pixels = np.empty((self.size[1], self.size[0], 3), np.uint8)
        pygame.image.frombuffer(pixels.data, self.size, "RGB").blit(self._frame, (0, 0))
        return pixels

    def _draw_still_parts(self, picture: Picture, scale: float) -> None:
        """Draw what all frames of an episode share."""
        scenario = picture.scenario
        self._frame.fill(PAPER)
        self._legend(picture)
        self._lens_words(scale)
        shared = (scenario.duration, scenario.settle_time, scenario.shifts)
        self._chart.prepare(self._frame, picture.follower, *shared, scale)
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
                value = f"{'xy'[axis]} {measured(picture.max_error[axis])}"
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
        middle = bar[0] - GRID * self._metre / 2
        self._text(f"{GRID:g} m", (middle, bar[1] - 15), 10, GREY, MIDDLE)

    def _lens_words(self, scale: float) -> None:
        magnification = float(f"{self._lens.reach / scale / self._metre:.2g}")
        self._text(f"error, {magnification:g} times as large", (14, CAPTIONS), 10, GREY)
        self._text(in_mm(scale), (LENS[0] + LENS_RADIUS + 4, LENS[1] - 7), 10, GREY)

    def _legend(self, picture: Picture) -> None:
        """Draw the symbols, with their names to the right of them."""
        limit = picture.scenario.conditions.thruster_limit
        jet = 0.5 * JET_LENGTH * self._metre
        thrust = partial(legend.thrust, length=jet)
        signs: list[legend.Sign] = [
            ("head", 16, legend.head),
            ("centre of mass", 14, legend.mass),
            (legend.GOALS[picture.follower], 18, legend.goal),
            ("path", 20, legend.path),
            ("track", 18, legend.track),
        ]
        signs += [("reference", 20, legend.reference)] if picture.reference else []
        signs.append((f"thrust of {limit / 2:g} N", round(jet), thrust))
        signs += [("joints bend", 6, legend.shift)] if picture.scenario.shifts else []
        legend.legend(self._frame, self._unit, (14.0, LEGEND), signs)

    def _text(
        self, text: str, at: tuple[float, float], size: int, colour: Colour, align: float = LEFT
    ) -> float:
        return write(self._frame, self._unit, text, at, size, colour, align)
