"""Draws pictures of a spatial robot (needs the extra `render`)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pygame

from usm_gym.rendering import legend
from usm_gym.rendering.canvas import ARROW, ARROW_AREA
from usm_gym.rendering.chart import Chart, error_scale, measured
from usm_gym.rendering.look import (
    ALARM,
    AXIS_COLOURS,
    CURRENT,
    GREY,
    HEIGHT,
    INK,
    PAPER,
    WIDTH,
    Colour,
    Frame,
)
from usm_gym.rendering.panel import LEFT, RIGHT, Panel, write
from usm_gym.rendering.scene import arrow
from usm_gym.rendering.space.camera import Camera, View, following
from usm_gym.rendering.space.picture import SpatialPicture
from usm_gym.rendering.space.scene import SpatialScene

# Places, points.
SCENE = pygame.Rect(14, 52, 612, 280)
LEGEND = 346
CAPTIONS = 362
CHART = pygame.Rect(196, 381, 420, 76)
# The attitude's numbers: where they end, and how far apart they are.
NUMBERS, LINE = 112.0, 25.0


class SpatialCanvas:
    """Draws pictures of one size."""

    def __init__(self, width: int = WIDTH) -> None:
        """Prepare to draw frames `width` pixels wide and three quarters of that high."""
        self._unit = width / WIDTH
        self.size = (width, round(HEIGHT * self._unit))
        self._frame = pygame.Surface(self.size)
        self._scene = SpatialScene(SCENE, self._unit)
        self._chart = Chart(CHART, CAPTIONS, self._unit, "xyz", AXIS_COLOURS)
        self._arrow = Panel(ARROW_AREA, self._unit)
        self._episode: tuple[Any, ...] | None = None

    def draw(
        self,
        picture: SpatialPicture,
        title: str,
        scale: float | None = None,
        camera: Camera | None = None,
    ) -> Frame:
        """Draw a picture.

        Args:
            picture: The picture.
            title: The words above it.
            scale: The largest error in the chart, m; None fits the errors so far.
            camera: Where it is seen from; None moves along with the middle of the picture.

        Returns:
            Red, green and blue, (height, width, 3).
        """
        scale = scale or error_scale(picture.errors)
        shared = (picture.duration, picture.settle_time, picture.shifts)
        if self._episode != (*shared, picture.limit, scale):
            self._episode = (*shared, picture.limit, scale)
            self._frame.fill(PAPER)
            self._legend(picture)
            self._chart.prepare(self._frame, picture.follower, *shared, scale)
            self._still = self._frame.copy()
        self._frame.blit(self._still, (0, 0))
        view = self._scene.draw(self._frame, picture, camera or following(picture))
        self._headline(picture, title, view)
        self._attitude(picture)
        self._chart.draw(self._frame, picture.times, picture.errors)
        pixels = np.empty((self.size[1], self.size[0], 3), np.uint8)
        pygame.image.frombuffer(pixels.data, self.size, "RGB").blit(self._frame, (0, 0))
        return pixels

    def _headline(self, picture: SpatialPicture, title: str, view: View) -> None:
        settle_time = picture.settle_time
        self._text(title, (14, 7), 17, INK)
        self._text(f"{picture.time:.1f} s", (626, 7), 17, INK, RIGHT)
        if picture.lost:
            self._text("robot lost", (14, 31), 12, ALARM)
        elif picture.time < settle_time:
            self._text(f"settling; scored from {settle_time:g} s on", (14, 31), 12, GREY)
        else:
            x = self._text(f"largest error since {settle_time:g} s:", (14, 31), 12, GREY)
            for k, colour in enumerate(AXIS_COLOURS):
                value = f"{'xyz'[k]} {measured(picture.max_error[k])}"
                x = self._text(value, (x + 10, 31), 12, colour)
        speed = float(np.linalg.norm(picture.current))
        if speed == 0.0:
            self._text("still water", (626, 31), 12, GREY, RIGHT)
            return
        self._text(f"current {100 * speed:.1f} cm/s", (600, 31), 12, GREY, RIGHT)
        ahead = 10 * view.turned(picture.current / speed)
        self._arrow.clear()
        arrow(self._arrow, ARROW - ahead, ARROW + ahead, 2.2, CURRENT)
        self._arrow.show(self._frame)

    def _attitude(self, picture: SpatialPicture) -> None:
        """Write roll, pitch and yaw of the root."""
        root = len(picture.robot.links) // 2 + 1
        self._text(f"attitude of link {root}", (14, CAPTIONS), 10, GREY)
        for k, name in enumerate(("roll", "pitch", "yaw")):
            y = CHART.top + 2 + LINE * k
            self._text(name, (14, y), 13, GREY)
            degrees = f"{np.degrees(picture.attitude[k]).round(1) + 0.0:.1f}°".replace("-", "−")
            self._text(degrees, (NUMBERS, y), 13, INK, RIGHT)

    def _legend(self, picture: SpatialPicture) -> None:
        """Draw the symbols, with their names to the right of them."""
        signs: list[legend.Sign] = [
            ("head", 16, legend.head),
            ("centre of mass", 14, legend.mass),
            (legend.GOALS[picture.follower], 18, legend.goal),
            ("path", 20, legend.path),
            ("track", 18, legend.track),
        ]
        signs += [("reference", 20, legend.wanted)] if picture.wanted else []
        signs.append((f"thrust, up to {picture.limit:g} N", 20, legend.thrust))
        signs += [("joints bend", 6, legend.shift)] if picture.shifts else []
        legend.legend(self._frame, self._unit, (14.0, LEGEND), signs)

    def _text(
        self, text: str, at: tuple[float, float], size: int, colour: Colour, align: float = LEFT
    ) -> float:
        return write(self._frame, self._unit, text, at, size, colour, align)
