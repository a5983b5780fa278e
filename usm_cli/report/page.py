"""Puts chapters into the page's templates (needs the extra `report`)."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import jinja2

from usm_cli.report.blocks import Chapter, Replay
from usm_cli.report.stage import stage_of
from usm_cli.report.words import glossary
from usm_gym.manipulator import Manipulator, bare
from usm_gym.robots import AnyRobot, name_of

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
        robots=drawings(chapters),
        styles=_text(STYLES),
        scripts=_text((*SCRIPTS, *(SPATIAL_SCRIPTS if "space" in views else ()), LAST_SCRIPT)),
    )


def drawings(chapters: Sequence[Chapter]) -> list[dict[str, str]]:
    """Of every robot the view, what follows a path, the drawing, what it shows, and its name.

    Where there are several, the last says also in what each of them swims.
    """
    places: dict[AnyRobot | Manipulator, list[str]] = {}
    for chapter in chapters:
        for place, robot in chapter.robots.items():
            places.setdefault(robot, []).append(place)
    drawn = []
    for robot, found in places.items():
        stage, name = stage_of(robot), name_of(bare(robot))
        svg, words = stage.drawing()
        caption = name if isinstance(name, str) else "a robot of its own"
        if len(places) > 1:
            caption += f": {'; '.join(dict.fromkeys(found))}"
        data = base64.b64encode(svg.encode()).decode()
        task = {"view": stage.view, "follower": stage.follower}
        drawn.append({**task, "data": data, "words": words, "caption": caption})
    return drawn


def _text(names: Sequence[str]) -> str:
    return "\n".join(ASSETS.joinpath(name).read_text(encoding="utf-8") for name in names)
