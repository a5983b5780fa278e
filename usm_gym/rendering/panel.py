"""Draws smooth lines, shapes and words on a frame (needs the extra `render`)."""

from __future__ import annotations

import io
import os
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
import matplotlib
import pygame

from usm_gym.rendering.look import INK, PAPER, Colour, Points

# A panel is drawn larger by this factor and scaled down, which smooths all edges; words are already
# smooth.
OVER = 2
LEFT, MIDDLE, RIGHT = 0.0, 0.5, 1.0


class Panel:
    """A part of a frame; places and widths are in points, which do not depend on its size."""

    def __init__(self, area: pygame.Rect, unit: float, colour: Colour = PAPER) -> None:
        """Prepare to draw on an area, in points of `unit` pixels, over a colour."""
        self._area = area
        self._scale = OVER * unit
        self._pixels = pygame.Rect([round(unit * side) for side in area])
        width, height = self._pixels.size
        self._surface = pygame.Surface((OVER * width, OVER * height))
        self._surface.fill(colour)
        self._background = self._surface.copy()

    def keep(self) -> None:
        """Turn the drawing so far into the background."""
        self._background.blit(self._surface, (0, 0))

    def clear(self) -> None:
        """Erase everything except the background."""
        self._surface.blit(self._background, (0, 0))

    def show(self, frame: pygame.Surface) -> None:
        """Copy the panel to its place on a frame."""
        place = frame.subsurface(self._pixels)
        pygame.transform.smoothscale(self._surface, place.get_size(), place)

    def disc(self, at: Points, radius: float, colour: Colour) -> None:
        """Draw a disc at one or several points."""
        for middle in np.atleast_2d(self._at(at)).tolist():
            pygame.draw.circle(self._surface, colour, middle, radius * self._scale)

    def line(self, points: Points, width: float, colour: Colour) -> None:
        """Draw a line through at least two points."""
        if len(points) > 1:
            corners = self._at(points).tolist()
            pygame.draw.lines(self._surface, colour, False, corners, self._thick(width))

    def segments(self, ends: Points, width: float, colour: Colour) -> None:
        """Draw lines between pairs of points, (k, 2, 2)."""
        thick = self._thick(width)
        for start, stop in self._at(ends).tolist():
            pygame.draw.line(self._surface, colour, start, stop, thick)

    def dashes(self, x: float, top: float, bottom: float, colour: Colour) -> None:
        """Draw a vertical line of dashes."""
        for y in np.arange(top, bottom, 6.0):
            self.line(np.array([[x, y], [x, y + 3]]), 1.0, colour)

    def outline(self, points: Points, width: float, colour: Colour) -> None:
        """Draw the edge of a polygon."""
        corners = self._at(points).tolist()
        pygame.draw.polygon(self._surface, colour, corners, self._thick(width))

    def shape(self, points: Points, colour: Colour, edge: Colour) -> None:
        """Draw a polygon with its edge."""
        corners = self._at(points).tolist()
        pygame.draw.polygon(self._surface, colour, corners)
        pygame.draw.aalines(self._surface, edge, True, corners)

    def facets(self, polygons: Points, colours: Points) -> None:
        """Draw polygons without edges, (k, corners, 2), in colours, (k, 3)."""
        corners = self._at(polygons).tolist()
        for polygon, colour in zip(corners, colours.tolist(), strict=True):
            pygame.draw.polygon(self._surface, colour, polygon)

    def veil(self, polygons: Points, colour: Colour, opacity: float) -> None:
        """Draw polygons, (k, corners, 2), that let the ground through, once where they overlap."""
        corners = self._at(polygons)
        low, high = (edge(corners.reshape(-1, 2), axis=0) for edge in (np.min, np.max))
        area = pygame.Rect(np.floor(low).tolist(), (np.ceil(high - low) + 2).tolist())
        area = area.clip(self._surface.get_rect())
        if not area:
            return
        layer = pygame.Surface(area.size, pygame.SRCALPHA)
        for polygon in (corners - area.topleft).tolist():
            pygame.draw.polygon(layer, (*colour, round(255 * opacity)), polygon)
        self._surface.blit(layer, area)

    def shades(self, colours: Points) -> None:
        """Fill the panel with rows of colours, (rows, 3), from the top."""
        rows = pygame.surfarray.make_surface(np.rint(colours)[np.newaxis].astype(np.uint8))
        pygame.transform.scale(rows, self._surface.get_size(), self._surface)

    def block(self, area: pygame.Rect, colour: Colour) -> None:
        """Fill an upright rectangle."""
        corner = self._at(np.array(area.topleft)).tolist()
        size = (self._scale * area.width, self._scale * area.height)
        pygame.draw.rect(self._surface, colour, pygame.Rect(corner, size))

    def centre_of_mass(self, at: Points) -> None:
        """Draw the usual symbol of a centre of mass, a disc in quarters."""
        radius = 6.0
        self.disc(at, radius + 1.2, INK)
        self.disc(at, radius, PAPER)
        quarters = {"draw_top_right": True, "draw_bottom_left": True}
        centre = self._at(at).tolist()
        pygame.draw.circle(self._surface, INK, centre, radius * self._scale, **quarters)

    def _at(self, points: Points) -> Points:
        return np.asarray((points - self._area.topleft) * self._scale)

    def _thick(self, width: float) -> int:
        return max(1, round(width * self._scale))


def write(
    frame: pygame.Surface,
    unit: float,
    text: str,
    at: tuple[float, float],
    size: int,
    colour: Colour,
    align: float = LEFT,
) -> float:
    """Write words on a frame, in points of `unit` pixels; return where they end."""
    image = _words(text, round(size * unit), colour)
    x = at[0] * unit - align * image.get_width()
    frame.blit(image, (round(x), round(at[1] * unit)))
    return (x + image.get_width()) / unit


@lru_cache(maxsize=128)
def _words(text: str, size: int, colour: Colour) -> pygame.Surface:
    # A font does not survive somebody's `pygame.quit()`, but a surface does, so only that is kept.
    pygame.font.init()
    return pygame.font.Font(io.BytesIO(_typeface()), size).render(text, True, colour)


@cache
def _typeface() -> bytes:
    # Read into memory, because a font would keep its file open.
    return (Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf").read_bytes()
