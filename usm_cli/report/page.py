"""Puts chapters into the page's templates (needs the extra `report`)."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import jinja2

from usm_cli.report.blocks import Chapter
from usm_cli.report.words import glossary
from usm_gym.rendering.figure import robot_drawing
from usm_gym.robot import Robot

ASSETS = files(__package__)
STYLES = ("uplot/uPlot.min.css", "page/page.css")
SCRIPTS = (
    "uplot/uPlot.iife.min.js",
    "page/tables.js",
    "page/charts.js",
    "page/plots.js",
    "page/drawing.js",
    "page/replay.js",
    "page/page.js",
)


def html(chapters: Sequence[Chapter], made: Mapping[str, Any]) -> str:
    """Write one self-contained page with all chapters.

    Args:
        chapters: The chapters.
        made: The provenance of the page, from `usm_gym.support.provenance`.
    """
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
        robot=base64.b64encode(robot_drawing(Robot()).encode()).decode(),
        styles=_text(STYLES),
        scripts=_text(SCRIPTS),
    )


def _text(names: Sequence[str]) -> str:
    return "\n".join(ASSETS.joinpath(name).read_text(encoding="utf-8") for name in names)
