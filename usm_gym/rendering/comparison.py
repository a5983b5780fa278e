"""Draws several policies in the same episode, one above the other (needs the extra `render`).

Its lettering is large enough for a phone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pygame

from usm_gym.rendering.chart import error_scale
from usm_gym.rendering.depiction import depiction_of
from usm_gym.rendering.look import (
    ALARM,
    CURRENT,
    ERROR_COLOURS,
    GREY,
    INK,
    LINK,
    PAPER,
    RULE,
    TRAIL,
    WATER,
    Colour,
    Frame,
    Points,
)
from usm_gym.rendering.panel import LEFT, MIDDLE, RIGHT, Panel, write
from usm_gym.rendering.picture import AnyPicture, Follower
from usm_gym.rendering.scene import OUTLINE, arrow, cross_hair, draw_follower, draw_jet, thinned
from usm_gym.task.conditions import Conditions
from usm_gym.world import Episode

# Everything is laid out on 480 points across.
WIDTH, MARGIN = 480, 14
HEAD, STRIP, WATERS, GAP, FOOT = 76, 42, 122, 8, 116
ROW = STRIP + WATERS + GAP
CHART = pygame.Rect(42, 24, 424, 66)
# Of the policies, from the top.
COLOURS = (*ERROR_COLOURS, TRAIL)
# The outer ring of a lens holds this share of each policy's errors; the rare others are at its rim.
USUAL = 0.95
SMALL, NORMAL, LARGE = 13, 17, 25
Sign = Literal["centre of mass", "head", "goal", "outline", "jet", "current"]
# By what follows the path: what makes it difficult, and the signs with their names.
MEANWHILE: dict[Follower, str] = {
    "centre of mass": "while the body bends",
    "head": "with thrusters and joints",
}
LEGENDS: dict[Follower, dict[Sign, str]] = {
    "centre of mass": {
        "centre of mass": "centre of mass",
        "goal": "goal",
        "outline": "planned shape",
        "jet": "thrust",
        "current": "current",
    },
    "head": {
        "head": "head",
        "goal": "goal",
        "centre of mass": "centre of mass",
        "jet": "thrust",
        "current": "current",
    },
}
WIDTHS: dict[Sign, int] = {
    "centre of mass": 15,
    "head": 15,
    "goal": 18,
    "outline": 18,
    "jet": 20,
    "current": 18,
}


@dataclass(frozen=True)
class Caption:
    """The words above a policy.

    Attributes:
        name: Its name.
        told: What it is told besides the measured position and the reference; empty if unknown.
    """

    name: str
    told: str = ""


class Comparison:
    """Draws the pictures of up to three policies at the same instant.

    Attributes:
        size: Width and height of a frame.
    """

    def __init__(
        self,
        width: int,
        captions: Sequence[Caption],
        scenario: Episode,
        last: Sequence[AnyPicture],
        speed: float,
    ) -> None:
        """Prepare frames.

        Args:
            width: Of a frame.
            captions: Of the policies, from the top.
            scenario: Their scenario.
            last: Their last pictures, whose errors the scale fits.
            speed: Of the film, times real time.
        """
        self._unit = width / WIDTH
        rows = len(captions)
        self._foot = HEAD + rows * ROW
        self.size = (width, 2 * round((self._foot + FOOT) * self._unit / 2))
        self._frame = pygame.Surface(self.size)
        scored = [scored_distances(each) for each in last]
        self._scale = error_scale(np.concatenate(scored))
        ring = error_scale(np.array([np.quantile(each, USUAL) for each in scored]))
        tops = [HEAD + row * ROW + STRIP for row in range(rows)]
        self._tops = tops
        areas = [pygame.Rect(MARGIN, top, WIDTH - 2 * MARGIN, WATERS) for top in tops]
        self._rows = depiction_of(scenario.body).rows(areas, self._unit, ring)
        self._frame.fill(PAPER)
        self._heading(last[0].follower, scenario.conditions, speed)
        for row, caption in enumerate(captions):
            self._caption(caption, tops[row] - STRIP, COLOURS[row])
        self._empty_chart(scenario)
        self._still = self._frame.copy()

    def draw(self, pictures: Sequence[AnyPicture]) -> Frame:
        """Draw pictures of the policies: red, green and blue, (height, width, 3)."""
        self._frame.blit(self._still, (0, 0))
        time = max(picture.time for picture in pictures)
        self._text(f"{time:.0f} s", (WIDTH - MARGIN, 9), NORMAL, INK, RIGHT)
        for row, picture in enumerate(pictures):
            self._rows[row].draw(self._frame, picture, COLOURS[row])
            self._readout(picture, self._tops[row] - STRIP - 1, COLOURS[row])
        self._curves(pictures)
        pixels = np.empty((self.size[1], self.size[0], 3), np.uint8)
        pygame.image.frombuffer(pixels.data, self.size, "RGB").blit(self._frame, (0, 0))
        return pixels

    def _heading(self, follower: Follower, conditions: Conditions, speed: float) -> None:
        """Say what the goal is, and what the signs mean."""
        x = self._text("Hold", (MARGIN, 9), NORMAL, INK)
        x = self._sign(follower, x + 7, 20)
        x = self._text("on", (x + 6, 9), NORMAL, INK)
        x = self._sign("goal", x + 7, 20)
        self._text(MEANWHILE[follower], (x + 6, 9), NORMAL, INK)
        x = MARGIN
        for kind, words in LEGENDS[follower].items():
            x = self._sign(kind, x, 43)
            x = self._text(words, (x + 4, 35), SMALL, GREY) + 8
        words = f"{measured(conditions)}; {speed:g} times real time"
        self._text(words, (MARGIN, 53), SMALL, GREY)

    def _sign(self, kind: Sign, x: float, y: float) -> float:
        """Draw a sign from x on, around the height y, and return where it ends."""
        wide = WIDTHS[kind]
        x = round(x)
        sign = Panel(pygame.Rect(x, round(y) - 10, wide, 20), self._unit)
        middle, end = np.array([x + wide / 2, y]), np.array([x + wide - 1.0, y])
        if kind == "goal":
            cross_hair(sign, middle, 0.6)
        elif kind == "outline":
            sign.outline(middle + LINK * (0.42 * wide, 5.5), 1.5, OUTLINE)
        elif kind == "jet":
            draw_jet(sign, np.array([x + 1.0, y]), np.array([wide - 2.0, 0.0]))
        elif kind == "current":
            arrow(sign, np.array([x + 1.0, y]), end, 1.6, CURRENT)
        else:
            draw_follower(sign, kind, middle, INK)
        sign.show(self._frame)
        return float(x + wide)

    def _caption(self, caption: Caption, top: int, colour: Colour) -> None:
        tag = Panel(pygame.Rect(MARGIN, top + 4, 5, STRIP - 8), self._unit, colour)
        tag.show(self._frame)
        self._text(caption.name, (MARGIN + 12, top + 1), NORMAL, INK)
        if caption.told:
            self._text(f"told: {caption.told}", (MARGIN + 12, top + 23), SMALL, GREY)

    def _readout(self, picture: AnyPicture, top: int, colour: Colour) -> None:
        """Write how far what follows the path is, or was at most, from its goal."""
        if picture.lost:
            self._text("lost", (WIDTH - MARGIN, top), LARGE, ALARM, RIGHT)
            return
        scored = picture.time >= picture.settle_time
        distance = float(scored_distances(picture).max() if scored else distances(picture)[-1])
        words = _mm(distance)
        shade = colour if scored else GREY
        self._text(words, (WIDTH - MARGIN, top), LARGE, shade, RIGHT)
        kind = "worst" if scored else "now"
        self._text(kind, (WIDTH - MARGIN - 104, top + 11), SMALL, GREY, RIGHT)

    def _empty_chart(self, scenario: Episode) -> None:
        area = CHART.move(0, self._foot)
        words = "distance from the goal, mm (shaded: not scored)"
        self._text(words, (MARGIN, self._foot + 1), SMALL, GREY)
        self._text(f"{1e3 * self._scale:g}", (area.left - 5, area.top - 5), SMALL, GREY, RIGHT)
        self._text("0", (area.left - 5, area.bottom - 10), SMALL, GREY, RIGHT)
        for mark in np.linspace(0.0, scenario.duration, 5):
            x = area.left + area.width * mark / scenario.duration
            align = MIDDLE if mark < scenario.duration else RIGHT
            self._text(f"{mark:g} s", (x, area.bottom + 4), SMALL, GREY, align)
        self._duration = scenario.duration
        chart = self._chart = Panel(area.inflate(8, 8), self._unit)
        settled = round(area.width * min(1.0, scenario.settle_time / scenario.duration))
        chart.block(pygame.Rect(area.topleft, (settled, area.height)), WATER)
        for y in (area.top, area.bottom):
            chart.line(np.array([[area.left, y], [area.right, y]]), 0.8, RULE)
        chart.keep()

    def _curves(self, pictures: Sequence[AnyPicture]) -> None:
        area = CHART.move(0, self._foot)
        self._chart.clear()
        for picture, colour in zip(pictures, COLOURS, strict=False):
            heights = np.minimum(distances(picture) / self._scale, 1.0) * area.height
            across = area.left + area.width * picture.times / self._duration
            curve = np.stack([across, area.bottom - heights], axis=1)
            self._chart.line(thinned(curve), 1.5, colour)
            self._chart.disc(curve[-1], 2.5, colour)
        self._chart.show(self._frame)

    def _text(
        self, text: str, at: tuple[float, float], size: int, colour: Colour, align: float = LEFT
    ) -> float:
        return write(self._frame, self._unit, text, at, size, colour, align)


def distances(picture: AnyPicture) -> Points:
    """Distances of what follows the path from its goal so far, m, (k,)."""
    return np.asarray(np.linalg.norm(picture.errors, axis=1))


def scored_distances(picture: AnyPicture) -> Points:
    """Those that count, m, or all if there are none yet."""
    late = picture.times >= picture.settle_time
    return distances(picture)[late] if late.any() else distances(picture)


def measured(conditions: Conditions) -> str:
    """How the position is measured, in a few words."""
    period = conditions.control_period
    words = f"position every {period * conditions.position_period:.3g} s"
    if conditions.position_delay:
        words += f", {1e3 * period * conditions.position_delay:.3g} ms late"
    return words


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.{0 if metres >= 0.01 else 1}f} mm"
