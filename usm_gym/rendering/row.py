"""One of several policies, one above the other (needs the extra `render`)."""

from __future__ import annotations

import numpy as np
import pygame

from usm_gym.rendering.look import GREY, WATER, Colour
from usm_gym.rendering.panel import MIDDLE, write
from usm_gym.rendering.picture import Picture
from usm_gym.rendering.scene import GRID, Lens, Scene, latest

METRE = 140.0
# Places in a row, points from its upper left corner.
MIDDLE_OF_SCENE, LENS, LENS_RADIUS, WORDS = (164.0, 60.0), (399.0, 51.0), 46.0, 101
SMALL = 13


class Row:
    """Draws a robot in the water from above, and its error under a lens."""

    def __init__(
        self,
        area: pygame.Rect,
        unit: float,
        ring: float,
        barred: bool,
        metre: float = METRE,
    ) -> None:
        """Prepare to draw.

        Args:
            area: Where, points.
            unit: Pixels in a point.
            ring: The error at the outer ring of the lens, m.
            barred: Whether a bar shows a length.
            metre: Points in a metre of the scene.
        """
        self._unit, self._ring, self._metre = unit, ring, metre
        middle, self._middle = np.add([MIDDLE_OF_SCENE, LENS], area.topleft)
        self._scene = Scene(area, unit, metre, middle)
        self._lens = Lens(self._middle, LENS_RADIUS, unit, WATER)
        bar = np.add(area.bottomleft, (10 + GRID * metre, -6.0))
        self._bar = bar if barred else None
        self._words = area.top + WORDS

    def draw(self, frame: pygame.Surface, picture: Picture, colour: Colour) -> None:
        """Draw a picture on a frame, the track in a colour."""
        self._scene.draw(frame, picture, colour, self._bar)
        if self._bar is not None:
            x, y = self._bar
            write(frame, self._unit, f"{GRID:g} m", (x + 5, y - 12), SMALL, GREY)
        self._lens.draw(frame, picture.follower, latest(picture), self._ring, colour)
        at = (self._middle[0], self._words)
        magnified(frame, self._unit, at, self._lens, self._ring, self._metre)


def magnified(
    frame: pygame.Surface,
    unit: float,
    at: tuple[float, float],
    lens: Lens,
    ring: float,
    metre: float,
) -> None:
    """Write below a lens, with an error, m, at its outer ring, how much larger it shows things."""
    times = float(f"{lens.reach / ring / metre:.2g}")
    write(frame, unit, f"error × {times:g}", at, SMALL, GREY, MIDDLE)
