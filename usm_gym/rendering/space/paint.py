"""Draws meshes from far to near (needs the extra `render`)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from usm_gym.rendering.look import JET, JET_CORE, Colour, Points
from usm_gym.rendering.panel import Panel
from usm_gym.rendering.space.camera import View
from usm_gym.rendering.space.mesh import Mesh

OUTLINE = 0.9
# Opacity of a jet whose force is next to nothing, and at the limit.
FAINTEST, STRONGEST = 0.45, 0.9
# The core of a jet over the jet.
CORE_LENGTH, CORE_WIDTH = 0.7, 0.5

# Distance of a thing from the camera, m, and what draws it.
Task = tuple[float, Callable[[], None]]


def paint(panel: Panel, view: View, mesh: Mesh, tasks: list[Task]) -> None:
    """Draw a mesh in the global frame and other things, from far to near.

    Args:
        panel: Where.
        view: The view.
        mesh: The mesh.
        tasks: The other things.
    """
    fronts = _fronts(view, mesh)
    fronts[view.depth(mesh.corners).min(axis=(1, 2)) <= view.near] = False
    places, colours = view.see(mesh.corners), mesh.lit()
    lines, owners = _outlines(mesh, places, fronts)
    distances = np.linalg.norm(view.position - mesh.middles, axis=1) + mesh.deeper

    def slice_painter(s: int) -> Callable[[], None]:
        def draw() -> None:
            panel.facets(places[s, fronts[s]], colours[s, fronts[s]])
            red, green, blue = mesh.edges[s].astype(int).tolist()
            panel.segments(lines[owners == s], OUTLINE, (red, green, blue))

        return draw

    seen = np.flatnonzero(fronts.any(axis=1)).tolist()
    everything = tasks + [(float(distances[s]), slice_painter(s)) for s in seen]
    for _, draw in sorted(everything, key=lambda task: -task[0]):
        draw()


def _fronts(view: View, mesh: Mesh) -> NDArray[np.bool_]:
    """Which facets are turned to the camera, (slices, SIDES)."""
    to_camera = view.position - mesh.corners[:, :, 0]
    return np.asarray(np.einsum("sfa,sfa->sf", to_camera, mesh.normals) > 0)


def _outlines(mesh: Mesh, places: Points, fronts: NDArray[np.bool_]) -> tuple[Points, Points]:
    """Lines between facets seen and facets turned away, (k, 2, 2), and their slices, (k,)."""
    after = np.roll(fronts, -1, axis=1)
    along = fronts != after
    lines, owners = [places[along][:, 1:3]], [np.nonzero(along)[0]]
    same = mesh.solids[1:] == mesh.solids[:-1]
    around = (fronts[1:] != fronts[:-1]) & same[:, np.newaxis]
    lines.append(places[:-1][around][:, 2:4])
    first, side = np.nonzero(around)
    owners.append(np.where(fronts[first, side], first, first + 1))
    return np.concatenate(lines), np.concatenate(owners)


def jet_painter(panel: Panel, view: View, jet: Mesh, share: float) -> Task | None:
    """What draws the water of a jet in the global frame, whose force over its limit is a share."""
    if (view.depth(jet.corners) <= view.near).any():
        return None
    start, tip = jet.corners[0, :, 0].mean(axis=0), jet.corners[-1, :, 2].mean(axis=0)
    opacity = FAINTEST + (STRONGEST - FAINTEST) * min(1.0, abs(share))
    along = (jet.corners - start) @ (tip - start) / ((tip - start) @ (tip - start))
    axis = start + along[..., np.newaxis] * (tip - start)
    core = axis + CORE_WIDTH * (jet.corners - axis)
    core = core - (1 - CORE_LENGTH) * (axis - start)

    fronts = _fronts(view, jet)

    def draw() -> None:
        layers: list[tuple[Points, Colour]] = [(jet.corners, JET), (core, JET_CORE)]
        for corners, colour in layers:
            panel.veil(view.see(corners[fronts]), colour, opacity)

    return float(np.linalg.norm(view.position - (start + tip) / 2)), draw
