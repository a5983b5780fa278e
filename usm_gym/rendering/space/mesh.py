"""Solids of revolution as flat facets, and how they are lit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.rendering.look import Colour

Array = NDArray[np.float64]

# Facets around a solid.
SIDES = 24
# From above, a little from the side of the default camera.
LIGHT = np.array([-0.25, 0.25, 0.94])
# Share of its colour that a facet has when it faces away from the light, and when it faces it.
DARKEST, BRIGHTEST = 0.50, 1.10


@dataclass(frozen=True)
class Mesh:
    """Slices of solids, each a ring of facets.

    Attributes:
        corners: Corners of the facets, m, (slices, SIDES, 4, 3): those of a ring, in its order,
            then those of the next ring in the opposite order.
        normals: Unit vectors out of the facets, (slices, SIDES, 3).
        colours: Colours in full light, (slices, SIDES, 3).
        edges: Colours of the outlines, (slices, 3).
        links: The link that carries a slice, counted from 0, (slices,).
        solids: Number of the solid to which a slice belongs, (slices,).
        deeper: How much further off than it is a slice counts when nearer ones hide it, m,
            (slices,).
    """

    corners: Array
    normals: Array
    colours: Array
    edges: Array
    links: NDArray[np.int64]
    solids: NDArray[np.int64]
    deeper: Array

    @property
    def middles(self) -> Array:
        """Middles of the slices, m, (slices, 3)."""
        return np.asarray(self.corners.mean(axis=(1, 2)))

    def posed(self, rotations: Array, centres: Array) -> Mesh:
        """The mesh in the global frame, with links turned, (links, 3, 3), and moved, (links, 3)."""
        turns, moves = rotations[self.links], centres[self.links]
        corners = np.einsum("sab,sfcb->sfca", turns, self.corners) + moves[:, None, None]
        normals = np.einsum("sab,sfb->sfa", turns, self.normals)
        return replace(self, corners=corners, normals=normals)

    def lit(self) -> Array:
        """Colours of the facets in the light, (slices, SIDES, 3)."""
        facing = (1 + self.normals @ LIGHT / np.linalg.norm(LIGHT)) / 2
        shade = DARKEST + (BRIGHTEST - DARKEST) * facing[..., np.newaxis]
        return np.asarray(np.clip(self.colours * shade, 0, 255))


@dataclass(frozen=True)
class Solid:
    """A solid of revolution that a link carries.

    Attributes:
        profile: Places along the axis, in ascending order, and radii there, m, (slices + 1, 2).
        colours: Colours of the slices, (slices,).
        edge: Colour of the outline.
        link: The link that carries it, counted from 0.
        at: Where place 0 is, in link axes, m.
        axis: Direction of its axis in link axes.
        stripe: The first slice with a stripe of the edge's colour along the top, and the one after
            the last.
        deeper: See `Mesh`, m.
    """

    profile: Array
    colours: Sequence[Colour]
    edge: Colour
    link: int
    at: ArrayLike = (0.0, 0.0, 0.0)
    axis: ArrayLike = (1.0, 0.0, 0.0)
    stripe: tuple[int, int] = (0, 0)
    deeper: float = 0.0

    def mesh(self) -> Mesh:
        """Its facets."""
        first = self.colours[0]
        mesh = revolved(self.profile, first, self.edge, self.link, self.at, self.axis)
        mesh.colours[:] = np.array(self.colours)[:, np.newaxis]
        mesh.colours[slice(*self.stripe), 0] = self.edge
        return replace(mesh, deeper=np.full(len(mesh.deeper), self.deeper))


def revolved(
    profile: ArrayLike,
    colour: Colour,
    edge: Colour,
    link: int = 0,
    at: ArrayLike = (0.0, 0.0, 0.0),
    axis: ArrayLike = (1.0, 0.0, 0.0),
) -> Mesh:
    """A solid of revolution.

    Args:
        profile: Places along the axis, in ascending order, and radii there, m, (slices + 1, 2).
        colour: Its colour.
        edge: The colour of its outline.
        link: The link that carries it, counted from 0.
        at: Where place 0 is, in link axes, m.
        axis: Direction of its axis in link axes.
    """
    profile = np.asarray(profile, np.float64)
    frame = _frame(np.asarray(axis, np.float64))
    # A facet faces its direction, so the first one is at the top of a link.
    turns = 2 * np.pi * (np.arange(SIDES) - 0.5) / SIDES
    circle = np.stack([np.zeros(SIDES), np.sin(turns), np.cos(turns)], axis=1)
    along = np.array([1.0, 0.0, 0.0])
    rings = profile[:, None, :1] * along + profile[:, None, 1:] * circle
    after = np.roll(rings, -1, axis=1)
    corners = np.stack([rings[:-1], after[:-1], after[1:], rings[1:]], axis=2)
    step, rise = np.diff(profile, axis=0).T
    outwards = 2 * np.pi * np.arange(SIDES) / SIDES
    facing = np.stack([np.zeros(SIDES), np.sin(outwards), np.cos(outwards)], axis=1)
    normals = step[:, None, None] * facing - rise[:, None, None] * along
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    slices = len(step)
    return Mesh(
        corners=corners @ frame.T + np.asarray(at, np.float64),
        normals=normals @ frame.T,
        colours=np.broadcast_to(np.array(colour, np.float64), (slices, SIDES, 3)).copy(),
        edges=np.broadcast_to(np.array(edge, np.float64), (slices, 3)).copy(),
        links=np.full(slices, link),
        solids=np.zeros(slices, np.int64),
        deeper=np.zeros(slices),
    )


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several solids as one mesh."""
    names = ("corners", "normals", "colours", "edges", "links", "deeper")
    parts = {name: np.concatenate([getattr(mesh, name) for mesh in meshes]) for name in names}
    counts = [len(mesh.corners) for mesh in meshes]
    return Mesh(**parts, solids=np.repeat(np.arange(len(meshes)), counts))


def _frame(axis: Array) -> Array:
    """A rotation that turns x into an axis, and leaves z in the plane of z and that axis."""
    along = axis / np.linalg.norm(axis)
    upright = np.array([0.0, 0.0, 1.0]) if abs(along[2]) < 0.99 else np.array([1.0, 0.0, 0.0])
    left = np.cross(upright, along)
    left /= np.linalg.norm(left)
    return np.stack([along, left, np.cross(along, left)], axis=1)
