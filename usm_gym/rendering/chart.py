"""Draws errors over time (needs the extra `render`)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pygame

from usm_gym.rendering.look import GREY, HEAD, RULE, WATER, Colour, Points
from usm_gym.rendering.panel import MIDDLE, RIGHT, Panel, write
from usm_gym.rendering.picture import Follower
from usm_gym.rendering.scene import thinned

SCALES = tuple(digit * 10.0**power for power in (-4, -3, -2, -1, 0) for digit in (1, 2, 5))


def error_scale(errors: Points) -> float:
    """The round number, m, that limits charts of these errors, m."""
    largest = 1.02 * float(np.abs(errors).max(initial=0.0))
    return next((scale for scale in SCALES if scale >= largest), SCALES[-1])


class Chart:
    """The error of what follows the path along some axes, over an episode."""

    def __init__(
        self, area: pygame.Rect, caption: float, unit: float, axes: str, colours: Sequence[Colour]
    ) -> None:
        """Prepare a chart.

        Args:
            area: Where it is, in points.
            caption: Where its caption is, in points.
            unit: Pixels in a point.
            axes: Letters of the axes.
            colours: Their colours.
        """
        self._area, self._caption, self._unit = area, caption, unit
        self._axes, self._colours = axes, colours

    def prepare(
        self,
        frame: pygame.Surface,
        follower: Follower,
        duration: float,
        settle_time: float,
        shifts: Sequence[float],
        scale: float,
    ) -> None:
        """Draw on a frame what all pictures of an episode share.

        Args:
            frame: The frame.
            follower: What follows the path.
            duration: Duration of the episode, s.
            settle_time: When its scored part begins, s.
            shifts: When the joints start to move, s.
            scale: The largest error shown, m.
        """
        area, self._duration, self._scale = self._area, duration, scale
        self._words(frame, follower)
        panel = self._panel = Panel(area.inflate(8, 8), self._unit)
        width = area.width / duration
        settling = pygame.Rect(area.topleft, (round(settle_time * width), area.height))
        panel.block(settling, WATER)
        for share in (-1.0, 0.0, 1.0):
            y = area.centery + share * area.height / 2
            panel.line(np.array([[area.left, y], [area.right, y]]), 0.8, RULE)
        for shift in shifts:
            panel.dashes(area.left + shift * width, area.top, area.bottom, HEAD)
        panel.keep()

    def draw(self, frame: pygame.Surface, time: Points, errors: Points) -> None:
        """Draw errors, m, (n, axes), at times, s, (n,), on a frame."""
        area = self._area
        heights = np.clip(errors / self._scale, -1.0, 1.0) * area.height / 2
        self._panel.clear()
        for axis, colour in enumerate(self._colours):
            across = area.left + area.width * time / self._duration
            curve = np.stack([across, area.centery - heights[:, axis]], axis=1)
            self._panel.line(thinned(curve), 1.5, colour)
            self._panel.disc(curve[-1], 2.2, colour)
        self._panel.show(frame)

    def _words(self, frame: pygame.Surface, follower: Follower) -> None:
        area, unit = self._area, self._unit
        caption = f"error of the {follower}:"
        x = write(frame, unit, caption, (area.left, self._caption), 10, GREY)
        for letter, colour in zip(self._axes, self._colours, strict=True):
            x = write(frame, unit, letter, (x + 8, self._caption), 10, colour)
        for share, sign in ((-1.0, "+"), (0.85, "−")):
            at = area.left - 5, area.centery + share * area.height / 2 - 6
            write(frame, unit, sign + in_mm(self._scale), at, 10, GREY, RIGHT)
        for mark in np.linspace(0.0, self._duration, 5):
            at = area.left + area.width * mark / self._duration, area.bottom + 4
            write(frame, unit, f"{mark:g} s", at, 10, GREY, MIDDLE)


def in_mm(metres: float) -> str:
    """A round length, for reading."""
    return f"{1e3 * metres:g} mm"


def measured(metres: float) -> str:
    """A measured length, for reading."""
    return f"{1e3 * metres:.{1 if metres >= 0.01 else 2}f} mm"
