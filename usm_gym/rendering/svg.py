"""Marks of drawings in SVG, as text: lines, arrows, turns and lettering, for light and dark pages.

Places are in units of the drawing, y downwards. Elements say what they show by their class, which
is a name of `COLOURS` (filled) or such a name with `-line` (drawn).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape

import numpy as np
from numpy.typing import ArrayLike

from usm_gym.rendering import look

# On light and on dark pages. Thrust, error and current are those of the films, darker where the
# films' would be too faint for lettering.
COLOURS = {
    "panel": (look.WATER, (23, 34, 39)),
    "card": (look.PAPER, (32, 46, 53)),
    "rule": (look.RULE, (66, 84, 95)),
    "ink": (look.INK, (230, 237, 240)),
    "quiet": (look.GREY, (163, 179, 187)),
    "body": (look.BODY, (96, 115, 128)),
    "edge": (look.BODY_EDGE, (190, 204, 213)),
    "number": (look.INK, (240, 245, 247)),
    "head": (look.HEAD, (178, 124, 22)),
    "head-edge": (look.HEAD_EDGE, (255, 226, 160)),
    "thrust": ((0, 96, 143), (108, 196, 245)),
    "current": (look.CURRENT, (127, 182, 209)),
    "error": ((194, 84, 0), (255, 154, 77)),
    "reference": (look.REFERENCE, (226, 156, 196)),
}
SIZES = {"words": 15.0, "small": 14.0, "title": 16.5}
FONTS = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", sans-serif'
SYMBOLS = '"STIX Two Text", "Cambria", Georgia, "Times New Roman", "DejaVu Serif", serif'
# `*x*` is a symbol, `_i` and `_{...}` are below the line.
MARKUP = re.compile(r"\*(?P<symbol>.+?)\*|_\{(?P<group>.+?)\}|_(?P<low>\w)|(?P<plain>[^*_]+)")
DROP = 0.24


def document(size: tuple[float, float], title: str, description: str, marks: Sequence[str]) -> str:
    """A drawing on a panel of its own.

    Args:
        size: Width and height.
        title: What it shows.
        description: The same for those who cannot see it.
        marks: Its elements, from the back to the front.
    """
    width, height = map(_number, size)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}" role="img" aria-labelledby="title description">'
    )
    panel = f'<rect class="panel" width="{width}" height="{height}" rx="12"/>'
    texts = [
        f'<title id="title">{escape(title)}</title>',
        f'<desc id="description">{escape(description)}</desc>',
        f"<style>{_style()}</style>",
    ]
    return "\n".join([head, *texts, panel, *marks, "</svg>", ""])


def group(name: str, *marks: str) -> str:
    """Marks that belong together, under a name."""
    return "\n".join([f'<g id="{name}">', *marks, "</g>"])


def line(
    name: str, points: ArrayLike, width: float = 1.5, dashes: str = "", cap: str = "round"
) -> str:
    """A line through points, (k, 2)."""
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
    return (
        f'<path class="{name}-line" d="{_route(points)}" fill="none" '
        f'stroke-width="{_number(width)}" stroke-linejoin="round" stroke-linecap="{cap}"{dashed}/>'
    )


def shape(name: str, points: ArrayLike) -> str:
    """A polygon, (k, 2)."""
    return f'<path class="{name}" d="{_route(points)}Z"/>'


def stamp(name: str, points: ArrayLike) -> str:
    """A polygon, (k, 2), for `stamped` to put into places."""
    return f'<defs><path id="{name}" d="{_route(points)}Z" stroke-width="1.2"/></defs>'


def stamped(stamp: str, name: str, edge: str, at: ArrayLike, angle: float) -> str:
    """A stamp at a place, turned by an angle, rad, anticlockwise."""
    x, y = _place(at)
    turned = f"translate({x} {y}) rotate({_number(-np.degrees(angle))})"
    return f'<use href="#{stamp}" class="{name} {edge}-line" transform="{turned}"/>'


def disc(name: str, at: ArrayLike, radius: float) -> str:
    """A disc."""
    x, y = _place(at)
    return f'<circle class="{name}" cx="{x}" cy="{y}" r="{_number(radius)}"/>'


def centre_of_mass(at: ArrayLike, radius: float = 6.0) -> list[str]:
    """The usual symbol of a centre of mass, a disc in quarters."""
    marks = [disc("ink", at, radius + 1.2), disc("panel", at, radius)]
    for first in (0.0, np.pi):
        angles = np.linspace(first, first + np.pi / 2, 9)
        rim = np.asarray(at) + radius * np.stack([np.cos(angles), -np.sin(angles)], axis=1)
        marks.append(shape("ink", [np.asarray(at), *rim]))
    return marks


def box(name: str, at: ArrayLike, size: ArrayLike, edge: str, dashes: str = "") -> str:
    """A rectangle with rounded corners, by its upper left corner."""
    (x, y), (width, height) = _place(at), _place(size)
    dashed = f' stroke-dasharray="{dashes}"' if dashes else ""
    return (
        f'<rect class="{name} {edge}-line" x="{x}" y="{y}" width="{width}" height="{height}" '
        f'rx="8" stroke-width="1.2"{dashed}/>'
    )


def arrow(name: str, start: ArrayLike, tip: ArrayLike, width: float = 2.4) -> str:
    """A straight arrow."""
    start, tip = np.asarray(start, float), np.asarray(tip, float)
    ahead = (tip - start) / np.linalg.norm(tip - start)
    neck = tip - 3.6 * width * ahead
    return line(name, [start, neck], width, cap="butt") + _point(name, tip, ahead, width)


def turn(
    name: str, centre: ArrayLike, radius: float, first: float, last: float, width: float = 1.6
) -> str:
    """An arrow along a circle, from an angle to another, rad, anticlockwise from the right."""
    head = 3.0 * width / radius * np.sign(last - first)
    angles = np.linspace(first, last - head, 24)
    arc = np.asarray(centre) + radius * np.stack([np.cos(angles), -np.sin(angles)], axis=1)
    tip = np.asarray(centre) + radius * np.array([np.cos(last), -np.sin(last)])
    ahead = (tip - arc[-1]) / np.linalg.norm(tip - arc[-1])
    return line(name, arc, width, cap="butt") + _point(name, tip, ahead, width)


def text(
    words: str,
    at: ArrayLike,
    away: tuple[float, float] = (0.0, 0.0),
    size: str = "words",
    name: str = "ink",
    anchor: str = "start",
    halo: str = "panel",
) -> str:
    """Lettering, in the markup of `MARKUP`, with its baseline as far away from a place as said.

    A halo of the colour of the ground keeps it legible on other marks.
    """
    x, y = _place(np.add(at, away))
    parts, drop = [], DROP * SIZES[size]
    was_low = False
    for match in MARKUP.finditer(words):
        kind = match.lastgroup or "plain"
        content = escape(match[kind], quote=False)
        low = kind in ("low", "group")
        shift = f' dy="{_number(drop if low else -drop)}"' if low != was_low else ""
        content = re.sub(r"\*(.+?)\*", r'<tspan class="symbol">\1</tspan>', content)
        style = {"symbol": "symbol", "low": "low symbol", "group": "low"}.get(kind, "")
        if style or shift:
            named = f' class="{style}"' if style else ""
            content = f"<tspan{named}{shift}>{content}</tspan>"
        parts.append(content)
        was_low = low
    behind = f" {halo}-line" if halo else ""
    return (
        f'<text class="{size} {name}{behind}" x="{x}" y="{y}" text-anchor="{anchor}">'
        f"{''.join(parts)}</text>"
    )


def _point(name: str, tip: ArrayLike, ahead: ArrayLike, width: float) -> str:
    tip, ahead = np.asarray(tip), np.asarray(ahead)
    across = np.array([-ahead[1], ahead[0]])
    back = tip - 4.2 * width * ahead
    corners = [back + 1.7 * width * across, tip, back - 1.7 * width * across]
    corners.append(tip - 3.4 * width * ahead)
    return f'<path class="{name}" d="{_route(corners)}Z"/>'


def _style() -> str:
    light, dark = (
        "".join(
            f".{name}{{fill:{_hex(both[k])}}}.{name}-line{{stroke:{_hex(both[k])}}}"
            for name, both in COLOURS.items()
        )
        for k in (0, 1)
    )
    sizes = "".join(f".{name}{{font-size:{_number(size)}px}}" for name, size in SIZES.items())
    return (
        f"text{{font-family:{FONTS};paint-order:stroke;stroke-width:4;stroke-linejoin:round}}"
        f".symbol{{font-family:{SYMBOLS};font-style:italic}}.low{{font-size:.76em}}"
        f".title{{font-weight:600}}{sizes}{light}"
        f"@media (prefers-color-scheme:dark){{{dark}}}"
    )


def _hex(colour: look.Colour) -> str:
    return "#" + "".join(f"{part:02x}" for part in colour)


def _route(points: ArrayLike) -> str:
    return "M" + "L".join(" ".join(_place(point)) for point in np.asarray(points, float))


def _place(at: ArrayLike) -> tuple[str, str]:
    x, y = np.asarray(at, float)
    return _number(x), _number(y)


def _number(value: float) -> str:
    return f"{round(float(value), 1) + 0.0:g}"
