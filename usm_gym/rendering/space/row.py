"""One of several policies in space, one above the other (needs the extra `render`)."""

from __future__ import annotations

import numpy as np
import pygame

from usm_gym.rendering.look import Colour
from usm_gym.rendering.row import LENS, LENS_RADIUS, WORDS, magnified
from usm_gym.rendering.scene import Lens, latest
from usm_gym.rendering.space.camera import following
from usm_gym.rendering.space.picture import SpatialPicture
from usm_gym.rendering.space.scene import SpatialScene

# Width of the lens and the gap before it, points.
BESIDE = 108


class SpatialRow:
    """Draws a robot in the water in perspective, and its error under a lens, as the camera sees it.

    The lens leaves out the part of the error that leads away from the camera.
    """

    def __init__(self, area: pygame.Rect, unit: float, ring: float) -> None:
        """Prepare to draw.

        Args:
            area: Where, points.
            unit: Pixels in a point.
            ring: The error at the outer ring of the lens, m.
        """
        self._unit, self._ring = unit, ring
        left = pygame.Rect(area.topleft, (area.width - BESIDE, area.height))
        self._scene = SpatialScene(left, unit, measured=False)
        self._middle = np.add(LENS, area.topleft)
        self._lens = Lens(self._middle, LENS_RADIUS, unit)
        self._words = area.top + WORDS

    def draw(self, frame: pygame.Surface, picture: SpatialPicture, colour: Colour) -> None:
        """Draw a picture on a frame, the track in a colour."""
        view = self._scene.draw(frame, picture, following(picture), colour)
        errors = view.turned(latest(picture)) * (1, -1)
        self._lens.draw(frame, picture.follower, errors, self._ring, colour)
        at, metre = (self._middle[0], self._words), view.metre(picture.middle)
        magnified(frame, self._unit, at, self._lens, self._ring, metre)
