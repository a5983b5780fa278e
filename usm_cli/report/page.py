"""Puts chapters into the page's templates (needs the extra `report`)."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import jinja2

from usm_cli.report.blocks import Chapter, Replay
from usm_cli.report.words import glossary
from usm_gym.rendering.figure import robot_drawing
from usm_gym.rendering.space.figure import spatial_robot_drawing
from usm_gym.robot import Robot
from usm_gym.spatial_robot import EELY

ASSETS = files(__package__)
STYLES = ("uplot/uPlot.min.css", "page/page.css")
SCRIPTS = (
    "uplot/uPlot.iife.min.js",
    "page/tables.js",
    "page/charts.js",
    "page/plots.js",
    "page/drawing.js",
    "page/replay.js",
    "page/plane.js",
)
# What only replays in space need, which is larger than all else.
SPATIAL_SCRIPTS = (
    "three/three.iife.min.js",
    "page/camera.js",
    "page/posture.js",
    "page/solids.js",
    "page/solid_scene.js",
    "page/space.js",
)
PLANAR_WORDS = (
    "The robot from above: links 1 to 16 from tail to head, positive thruster forces, the error "
    "from the path to the centre of mass, and the signs of all angles"
)
SPATIAL_WORDS = (
    "The robot in space from above, from its right and from behind: links 1 to 9 from tail to "
    "head, joints that turn it to the side and up, and positive thruster forces"
)
# Begins when all is there.
LAST_SCRIPT = "page/page.js"


def html(chapters: Sequence[Chapter], made: Mapping[str, Any]) -> str:
    """Write one self-contained page with all chapters.

    Args:
        chapters: The chapters.
        made: The provenance of the page, from `usm_gym.support.provenance`.
    """
    blocks = [block for chapter in chapters for block in chapter.blocks]
    views = {block.data["view"] for block in blocks if isinstance(block, Replay)}
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("usm_cli.report", "page"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template("page.html").render(
        chapters=chapters,
        glossary=glossary(id for chapter in chapters for id in chapter.policies),
        motion=next((chapter.motion for chapter in chapters if chapter.motion), ""),
        verdict=next((chapter.verdict for chapter in chapters if chapter.verdict), ""),
        made=made,
        robots={view: drawn for view, drawn in drawings().items() if view in (views or {"plane"})},
        styles=_text(STYLES),
        scripts=_text((*SCRIPTS, *(SPATIAL_SCRIPTS if "space" in views else ()), LAST_SCRIPT)),
    )


def drawings() -> dict[str, dict[str, Any]]:
    """The drawing of the robot of every view: its data and words."""
    shown = {
        "plane": (robot_drawing(Robot()), PLANAR_WORDS),
        "space": (spatial_robot_drawing(EELY), SPATIAL_WORDS),
    }
    return {
        view: {"data": base64.b64encode(text.encode()).decode(), "words": words}
        for view, (text, words) in shown.items()
    }


def _text(names: Sequence[str]) -> str:
    return "\n".join(ASSETS.joinpath(name).read_text(encoding="utf-8") for name in names)
