"""The line that names the symbols of a picture (needs the extra `render`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pygame

from usm_gym.rendering.look import (
    GREY,
    HEAD,
    HEAD_EDGE,
    HEAD_LINK,
    INK,
    LINK,
    REFERENCE,
    TRAIL,
    WANTED,
    Points,
    faded,
)
from usm_gym.rendering.panel import Panel, write
from usm_gym.rendering.picture import Follower
from usm_gym.rendering.scene import OUTLINE, cross_hair, draw_jet

# A name, the width of the symbol, points, and what draws it between two places, (2, 2).
Sign = tuple[str, int, Callable[[Panel, Points], None]]
# The goal of what follows the path, by that.
GOALS: dict[Follower, str] = {"centre of mass": "its goal", "head": "the head's goal"}


def legend(
    frame: pygame.Surface, unit: float, at: tuple[float, float], signs: Sequence[Sign]
) -> None:
    """Draw symbols, with their names to the right of them, from a place in points on."""
    x, y = at
    for name, width, draw in signs:
        x = round(x)
        panel = Panel(pygame.Rect(x - 1, y - 10, width + 2, 20), unit)
        draw(panel, np.array([[x, y], [x + width, y]]))
        panel.show(frame)
        x = write(frame, unit, name, (x + width + 4, y - 7), 10, GREY) + 11


def head(panel: Panel, ends: Points) -> None:
    """Draw a head."""
    half = 0.43 * (ends[1, 0] - ends[0, 0])
    panel.shape(ends[0] + (half, 0.0) + HEAD_LINK * (half, 4.5), HEAD, HEAD_EDGE)


def mass(panel: Panel, ends: Points) -> None:
    """Draw a centre of mass."""
    panel.centre_of_mass(ends.mean(axis=0))


def goal(panel: Panel, ends: Points) -> None:
    """Draw the goal of what follows the path."""
    cross_hair(panel, ends.mean(axis=0), 0.6)


def path(panel: Panel, ends: Points) -> None:
    """Draw a path."""
    panel.disc(np.linspace(ends[0], ends[1], 7)[1::2], 1.3, INK)


def track(panel: Panel, ends: Points) -> None:
    """Draw a track."""
    panel.line(ends, 2.2, TRAIL)


def reference(panel: Panel, ends: Points) -> None:
    """Draw the outline of a reference."""
    size = (0.5 * (ends[1, 0] - ends[0, 0]), 5.0)
    panel.outline(ends.mean(axis=0) + LINK * size, 1.5, OUTLINE)


def wanted(panel: Panel, ends: Points) -> None:
    """Draw a pose that is asked for."""
    size = (0.5 * (ends[1, 0] - ends[0, 0]), 4.5)
    colour = faded(REFERENCE, WANTED)
    panel.shape(ends.mean(axis=0) + LINK * size, colour, colour)


def thrust(panel: Panel, ends: Points, length: float | None = None) -> None:
    """Draw a jet, of a length or as long as there is room."""
    width = ends[1, 0] - ends[0, 0]
    draw_jet(panel, ends[0], np.array([width if length is None else length, 0.0]))


def shift(panel: Panel, ends: Points) -> None:
    """Draw an instant at which joints start to move."""
    x, y = ends.mean(axis=0)
    panel.dashes(x, y - 7, y + 7, HEAD)
