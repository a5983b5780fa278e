"""Figures of the leaderboard (need the extra `render`)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from usm_baselines.benchmark.leaderboard import LeaderboardResult, Standing, best_of_laws
from usm_baselines.benchmark.results import axes_in
from usm_baselines.benchmark.verdict import REASONS, TIERS, choices, front
from usm_gym.rendering.plots import COLOURS, plotting, save
from usm_gym.statistics import performance_profile
from usm_gym.support.text import figures
from usm_gym.task.metrics import MAX_ERROR

# There is a colour for each reason to be in focus; the others are grey.
GREY, LIGHT, INK = "0.72", "0.85", "0.25"
# Errors beyond so many times the largest one in focus are off the figure.
ROOM = 2.0
# The height of a line of labels, points.
LINE = 9.5
LABEL: dict[str, Any] = {"fontsize": 8, "color": INK}


def draw_all(result: LeaderboardResult, folder: Path) -> None:
    """Draw error against thrust variation, profiles and errors into a folder, as PNG and SVG."""
    with plotting():
        drawn = {"verdict": _verdict(result), "profiles": _profiles(result.main)}
        drawn |= {f"errors-{slug(name)}": _errors(rows) for name, rows in result.suites.items()}
        for name, figure in drawn.items():
            save(figure, folder / name)


def slug(suite: str) -> str:
    """The name of a suite as a part of a file's name."""
    return re.sub(r"\W+", "-", suite)


def _verdict(result: LeaderboardResult) -> Any:
    """Error against thrust variation, a panel per tier: what precision costs."""
    from matplotlib import pyplot as plt

    tiers = result.tiers
    size = 4.2 * len(tiers), 4.4
    figure, panels = plt.subplots(1, len(tiers), figsize=size, squeeze=False, layout="constrained")
    for panel, (tier, rows) in zip(panels[0], tiers.items(), strict=True):
        panel.set_title(tier, fontweight="bold", loc="left")
        panel.set_title(TIERS[tier], fontsize=8, color=INK, loc="right")
        panel.set(xscale="log", yscale="log", xlabel="thrust variation [N/s]")
        _pareto(panel, rows)
    axes = " + ".join(result.axes)
    panels[0, 0].set_ylabel(f"largest error after settling, {axes} [mm]")
    figure.draw_without_rendering()  # so that labels know where the points are
    for panel, rows in zip(panels[0], tiers.values(), strict=True):
        low, high = panel.get_ylim()
        named = dict.fromkeys([*focus(rows), *front(rows)])
        places = _places(rows, (id for id in named if rows[id].competitor))
        _label(panel, {id: at for id, at in places.items() if at[0] > 0.0 and low < at[1] < high})
    return figure


def _pareto(panel: Any, rows: Mapping[str, Standing]) -> None:
    """The policies of a tier: the front and those in focus in colour, all others grey."""
    colours, places = focus(rows), _places(rows, rows)
    errors = [places[id][1] for id in colours]
    low, high = min(errors) / ROOM, max(errors) * ROOM
    seen = {id: at for id, at in places.items() if at[0] > 0.0 and low < at[1] < high}
    for id, at in seen.items():
        if id in colours and rows[id].competitor:
            panel.plot(*at, "o", color=colours[id], markersize=7, zorder=2)
        elif rows[id].competitor:
            panel.plot(*at, "o", color=GREY, markersize=3.5, zorder=1)
        elif id in colours:
            panel.axhline(at[1], color=INK, linewidth=0.8, linestyle=":", zorder=0)
            panel.annotate(
                id,
                (1.0, at[1]),
                (-2, -3),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                **LABEL,
                ha="right",
                va="top",
            )
    variations = [x for x, _ in seen.values()] or [1.0]
    left, right = min(variations) / ROOM, max(variations) * ROOM
    # Nobody is below and to the left of this line.
    if best := [seen[id] for id in front(rows) if id in seen]:
        steps = np.array([(best[0][0], high), *best, (right, best[-1][1])])
        panel.step(*steps.T, where="post", color=LIGHT, linewidth=2.0, zorder=0)
    panel.set(xlim=(left, right), ylim=(low, high))
    _plain(panel)


def focus(rows: Mapping[str, Standing]) -> dict[str, str]:
    """The policies that are named, with their colours."""
    colours = dict(zip(REASONS, COLOURS, strict=True))
    return {id: colours.get(reasons[0], INK) for id, reasons in choices(rows).items()}


def _places(rows: Mapping[str, Standing], names: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Thrust variation, N/s, and combined error, mm, by policy."""
    return {
        id: (rows[id].metrics["thrust_variation"].mean, 1e3 * rows[id].combined[0]) for id in names
    }


def _label(panel: Any, places: Mapping[str, tuple[float, float]]) -> None:
    """Name points beside them, on the side with more room, without names on one another."""
    from matplotlib import patheffects

    halo = [patheffects.withStroke(linewidth=2.5, foreground="white")]
    middle = panel.get_window_extent().get_points()[:, 0].mean()
    seen = {id: panel.transData.transform(at) for id, at in places.items()}
    taken: list[tuple[bool, float]] = []
    pixels = panel.figure.dpi / 72
    for id, (x, y) in sorted(seen.items(), key=lambda pair: pair[1][1]):
        right, height = bool(x > middle), y + 0.4 * LINE * pixels
        while any(side == right and abs(height - at) < LINE * pixels for side, at in taken):
            height += 1.0
        taken.append((right, height))
        panel.annotate(
            id,
            places[id],
            (-7 if right else 7, (height - y) / pixels),
            textcoords="offset points",
            **LABEL,
            ha="right" if right else "left",
            va="center",
            path_effects=halo,
        )


def _profiles(rows: Mapping[str, Standing]) -> Any:
    """Share of episodes with an error up to a threshold."""
    from matplotlib import pyplot as plt

    axes, colours = axes_in(rows.values()), focus(rows)
    size = 5.0 * len(axes), 4.4
    figure, (panels,) = plt.subplots(
        1, len(axes), figsize=size, squeeze=False, layout="constrained", sharey=True
    )
    for axis, panel in zip(axes, panels, strict=True):
        shown = {**best_of_laws(rows), **{id: rows[id] for id in colours}}
        errors = {
            id: 1e3 * np.array(row.per_episode[MAX_ERROR + axis]) for id, row in shown.items()
        }
        every = np.concatenate([errors[id] for id in colours])
        thresholds = np.geomspace(every.min() / ROOM, every.max() * ROOM, 200)
        for id, values in errors.items():
            share, (low, high) = performance_profile(values, thresholds)
            if id not in colours:
                panel.plot(thresholds, share, color=LIGHT, linewidth=0.8, zorder=0)
                continue
            style = ":" if not rows[id].competitor else "-"
            panel.plot(thresholds, share, style, color=colours[id], label=id, linewidth=1.6)
            panel.fill_between(thresholds, low, high, color=colours[id], alpha=0.12, linewidth=0)
        panel.set(xscale="log", xlabel=f"error in {axis} [mm]")
        panel.set_xlim(thresholds[0], thresholds[-1])
        _plain(panel)
    panels[0].set(ylabel="share of episodes with at most this error")
    panels[-1].legend(fontsize=8, frameon=False, loc="lower right")
    return figure


def _errors(rows: Mapping[str, Standing]) -> Any:
    """The error of every law, best first, with its interval."""
    from matplotlib import pyplot as plt

    shown, colours = {**best_of_laws(rows)}, focus(rows)
    shown = {id: row for id, row in rows.items() if id in shown or id in colours}
    figure, panel = plt.subplots(figsize=(7.0, 0.2 * len(shown) + 1.0), layout="constrained")
    for place, (id, row) in enumerate(shown.items()):
        mean, half = (1e3 * each for each in row.combined)
        colour = colours.get(id, GREY)
        panel.errorbar(mean, place, xerr=half, fmt="o", color=colour, markersize=4, linewidth=1.2)
        panel.annotate(
            figures(mean),
            (mean + half, place),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=7,
            color=INK,
        )
    panel.set(xscale="log", ylim=(len(shown) - 0.4, -0.6))
    panel.set_xlabel(f"largest error after settling, {' + '.join(axes_in(rows.values()))} [mm]")
    panel.set_yticks(range(len(shown)), list(shown), fontsize=8)
    _plain(panel)
    return figure


def _plain(panel: Any) -> None:
    """Draw no more lines than a reader needs, and numbers as they are spoken."""
    from matplotlib.ticker import LogFormatterSciNotation

    class Spoken(LogFormatterSciNotation):
        def __call__(self, value: float, place: Any = None) -> str:
            return f"{value:g}" if super().__call__(value, place) else ""

    panel.grid(alpha=0.25, linewidth=0.5)
    for side in ("top", "right"):
        panel.spines[side].set_visible(False)
    for axis in (panel.xaxis, panel.yaxis):
        if axis.get_scale() == "log":
            axis.set_major_formatter(lambda value, place: f"{value:g}")
            axis.set_minor_formatter(Spoken())
