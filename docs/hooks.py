"""What the site takes from elsewhere: pages and figures of the repository, formulas, speed."""

import importlib
import inspect
import json
import re
from html import unescape
from pathlib import Path

import griffe
from latex2mathml.converter import convert
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File

from agents.commands.bench import MEANINGS
from agents.terminal import figures
from usm_gym import __version__

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "results" / __version__
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)
SPEED = "<!-- bench.json -->"


def on_files(files, config):
    """Add the pages and figures that lie outside `docs`."""
    outside = {name: ROOT / name for name in ("CONTRIBUTING.md", "CHANGELOG.md")}
    for path in sorted(RESULTS.iterdir()):
        if path.suffix in {".md", ".png"}:
            outside[f"results/{path.name}"] = path
    for place, path in outside.items():
        files.append(File.generated(config, place, abs_src_path=str(path)))
    return files


def on_page_markdown(markdown, **_):
    """Put the measured speed in its place."""
    return markdown.replace(SPEED, speed(RESULTS / "bench.json")) if SPEED in markdown else markdown


def on_page_content(html, **_):
    """Turn formulas into MathML, which browsers draw without a script."""
    return FORMULA.sub(lambda found: formula(unescape(found[2]), found[1] == "div"), html)


def formula(latex, block):
    """A formula as MathML."""
    rows = latex.replace(
        r"\cr", r"\\"
    )  # GitHub takes only the former, latex2mathml only the latter
    drawn = convert(rows, display="block" if block else "inline")
    if "\\" in drawn:
        raise PluginError(f"formula is {latex}; allowed: what latex2mathml knows")
    return drawn


def speed(path):
    """The figures of `usm bench` as a table."""
    if not path.exists():
        return "No measurement has been published with this version."
    found = json.loads(path.read_text(encoding="utf-8"))
    machine = found["machine"]
    rows = ["| what | median | smallest | largest |", "|---|---:|---:|---:|"]
    for name, meaning in MEANINGS.items():
        if name in found["spread"]:
            spread = found["spread"][name]
            numbers = " | ".join(figures(spread[key]) for key in ("median", "low", "high"))
            rows.append(f"| {meaning} | {numbers} |")
    where = f"{machine['processor']}, {machine['cores']} cores, {machine['system']}"
    return "\n".join([f"Measured on {where}.", "", *rows])


class RuntimeDocstrings(griffe.Extension):
    """Docstrings with a table that is put in when the module is imported."""

    def on_class(self, *, cls, **_):
        """Take such a docstring from the class itself."""
        if cls.docstring and "OBSERVATION_TABLE" in cls.docstring.value:
            found = getattr(importlib.import_module(cls.module.path), cls.name)
            cls.docstring.value = inspect.getdoc(found)
