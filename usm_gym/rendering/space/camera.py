"""Perspective: where a camera sees points in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.rendering.space.picture import SpatialPicture

Array = NDArray[np.float64]

# Over the robot's length: how far off the camera is, how far below the middle it aims, and what
# is too near to be seen.
DISTANCE, LOWERED, NEAR = 1.38, 0.035, 0.03
# The camera stands behind the robot, to its right and above it: its direction from the robot.
AZIMUTH, ELEVATION = np.radians(-116.0), np.radians(17.0)
WIDE = float(np.radians(46.0))
# Nothing is drawn further from the middle of the view than this many of its widths.
FAR_OFF = 20.0


@dataclass(frozen=True)
class Camera:
    """A camera that stands upright.

    Attributes:
        position: Where it is, m, (3,).
        target: What it looks at, in the middle of its view, m, (3,).
        field_of_view: Angle between the left and the right side of its view, rad, below pi.
    """

    position: Array
    target: Array
    field_of_view: float = WIDE


def orbiting(
    target: ArrayLike,
    distance: float,
    azimuth: float = AZIMUTH,
    elevation: float = ELEVATION,
    field_of_view: float = WIDE,
) -> Camera:
    """A camera around a target.

    Args:
        target: What it looks at, m, (3,).
        distance: How far it is from there, m.
        azimuth: Its direction from there about z, from x towards y, rad.
        elevation: Angle of that direction above the horizon, rad.
        field_of_view: Angle between the left and the right side of its view, rad.
    """
    target = np.asarray(target, np.float64)
    level = np.cos(elevation)
    direction = [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)]
    return Camera(target + distance * np.array(direction), target, field_of_view)


def following(picture: SpatialPicture) -> Camera:
    """The camera that moves along with the middle of a picture, and so as smoothly as that."""
    length = float(picture.robot.lengths.sum())
    return orbiting(picture.middle - (0.0, 0.0, LOWERED * length), DISTANCE * length)


class View:
    """What a camera sees, on an area of a drawing; places there have y downwards."""

    def __init__(self, camera: Camera, middle: ArrayLike, width: float, near: float) -> None:
        """Look through a camera.

        Args:
            camera: The camera.
            middle: Middle of the area, points.
            width: Its width, points.
            near: What is nearer than this is not seen, m.
        """
        self.position = np.asarray(camera.position, np.float64)
        self.near, self._middle, self._width = near, np.asarray(middle, np.float64), width
        self._focus = width / 2 / np.tan(camera.field_of_view / 2)
        ahead = np.asarray(camera.target, np.float64) - self.position
        distance = float(np.linalg.norm(ahead))
        ahead = ahead / distance if distance > 1e-9 else np.array([1.0, 0.0, 0.0])
        right = np.array([ahead[1], -ahead[0], 0.0])
        level = float(np.linalg.norm(right))
        # Straight up or down, north is where the x axis is.
        right = right / level if level > 1e-9 else np.array([0.0, -1.0, 0.0])
        self._axes = np.stack([right, np.cross(right, ahead), ahead])

    def depth(self, points: Array) -> Array:
        """How far points, (..., 3), are ahead of the camera, m, (...,)."""
        return np.asarray((points - self.position) @ self._axes[2])

    def see(self, points: Array) -> Array:
        """Places, (..., 2), of points, (..., 3); those too near are seen as if further off."""
        right, up, depth = np.moveaxis((points - self.position) @ self._axes.T, -1, 0)
        ahead = np.maximum(depth, self.near)
        places = self._focus / ahead[..., np.newaxis] * np.stack([right, -up], axis=-1)
        far = FAR_OFF * self._width
        return np.asarray(self._middle + np.clip(places, -far, far))

    def turned(self, directions: Array) -> Array:
        """Directions on the area, (..., 2), of directions in space, (..., 3), without perspective.

        One that leads across the view keeps its length.
        """
        right, up, _ = np.moveaxis(directions @ self._axes.T, -1, 0)
        return np.stack([right, -up], axis=-1)

    def see_line(self, points: Array) -> list[Array]:
        """Places of a line through points, (k, 3): its parts that are not too near."""
        inside = self.depth(points) > self.near
        parts: list[list[Array]] = []
        for k in range(len(points) - 1):
            if not (inside[k] or inside[k + 1]):
                continue
            ends = self._cut(points[k : k + 2])
            if not parts or not inside[k]:
                parts.append([ends[0]])
            parts[-1].append(ends[1])
        return [self.see(np.array(part)) for part in parts]

    def metre(self, point: Array) -> float:
        """How many points of the drawing a metre across the view takes at a point, (3,)."""
        return float(self._focus / max(float(self.depth(point)), self.near))

    def slopes(self, heights: Array) -> Array:
        """Angles above the horizon, rad, of what is seen at heights in the area's middle column."""
        rays = (self._middle[1] - heights)[:, np.newaxis] * self._axes[1] / self._focus
        rays = rays + self._axes[2]
        return np.asarray(np.arcsin(rays[:, 2] / np.linalg.norm(rays, axis=1)))

    def _cut(self, ends: Array) -> Array:
        """The part of a segment, (2, 3), that is not too near; one end of it is not."""
        depths = self.depth(ends)
        low = int(depths.argmin())
        if depths[low] < self.near:
            share = (self.near - depths[low]) / (depths[1 - low] - depths[low])
            ends = ends.copy()
            ends[low] += share * (ends[1 - low] - ends[low])
        return ends
