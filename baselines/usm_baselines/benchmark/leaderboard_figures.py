"""Figures of the leaderboard (need the extra `render`)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from usm_baselines.benchmark.leaderboard import LeaderboardResult, Standing, best_of_laws
from usm_baselines.benchmark.results import axes_in
from usm_gym.statistics import performance_profile
from usm_gym.task.metrics import MAX_ERROR

# Colour and line style, or colour and marker, tell thirty policies apart.
COLOURS = 10
STYLES = ("-", "--", ":")
MARKERS = ("o", "s", "^")
SHADE = 0.15
# Width of a panel, inches.
PANEL = 5.5


def draw_all(result: LeaderboardResult, folder: Path) -> None:
    """Draw errors, performance profiles and error against thrust variation into a folder; PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    drawn = {
        "errors": _errors(result),
        "profiles": _profiles(result.main),
        "variation": _variation(result),
    }
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", dpi=120, metadata={"Software": None})
        plt.close(figure)


def _errors(result: LeaderboardResult) -> Any:
    """Mean error of every law on every suite, with its interval."""
    from matplotlib import pyplot as plt

    best, axes = {suite: best_of_laws(rows) for suite, rows in result.suites.items()}, result.axes
    heights = [0.25 * len(rows) + 1.2 for rows in best.values()]
    figure, panels = plt.subplots(
        *(len(best), len(axes)),
        figsize=(4.5 * len(axes), sum(heights)),
        height_ratios=heights,
        squeeze=False,
        sharex=True,
        layout="constrained",
    )
    for line, (suite, rows) in zip(panels, best.items(), strict=True):
        names = list(rows)
        for panel, axis in zip(line, axes, strict=True):
            for place, row in enumerate(rows.values()):
                error = row.errors[axis]
                low, high = error.ci95
                panel.plot([1e3 * low, 1e3 * high], [place, place], color="C0")
                panel.plot(1e3 * error.mean, place, "o", color="C0", markersize=4)
            panel.set(xscale="log", xlabel=f"error in {axis} [mm]", ylim=(len(names) - 0.5, -0.5))
            panel.set_yticks(range(len(names)), names if axis == axes[0] else [""] * len(names))
            panel.set_title(suite, fontsize=10)
            panel.grid(alpha=0.3)
    return figure


def _profiles(rows: Mapping[str, Standing]) -> Any:
    """Share of episodes with an error up to a threshold."""
    rows = best_of_laws(rows)
    figure, panels = _panels(rows, 5, sharey=True)
    for axis, panel in panels.items():
        errors = {
            name: 1e3 * np.array(row.per_episode[MAX_ERROR + axis]) for name, row in rows.items()
        }
        every = np.concatenate(list(errors.values()))
        thresholds = np.geomspace(max(every.min(), 1e-3), every.max(), 200)
        for number, (name, values) in enumerate(errors.items()):
            share, (low, high) = performance_profile(values, thresholds)
            style = _style(number)
            panel.plot(thresholds, share, label=name, linewidth=1.2, **style)
            panel.fill_between(
                thresholds, low, high, color=style["color"], alpha=SHADE, linewidth=0
            )
        panel.set(xscale="log", xlabel=f"error in {axis} [mm]")
        panel.grid(alpha=0.3)
    first = next(iter(panels.values()))
    first.set(ylabel="share of episodes with at most this error")
    _name(figure, first)
    return figure


def _variation(result: LeaderboardResult) -> Any:
    """Error against thrust variation, and the fronts of the tuned laws."""
    rows = best_of_laws(result.main)
    figure, panels = _panels(rows, 6)
    for axis, panel in panels.items():
        for number, (name, row) in enumerate(rows.items()):
            variation = row.metrics["thrust_variation"].mean
            if variation > 0:
                error = 1e3 * row.errors[axis].mean
                marker = MARKERS[number // COLOURS % len(MARKERS)]
                color = _style(number)["color"]
                panel.plot(variation, error, marker, color=color, linestyle="none", label=name)
        for name, points in result.front.items():
            panel.plot(
                [point.thrust_variation for point in points],
                [1e3 * point.errors[axis] for point in points],
                ".-",
                color="0.5",
                linewidth=1,
                zorder=0,
                label=f"{name}, other weights",
            )
        panel.set(
            xscale="log",
            yscale="log",
            xlabel="thrust variation [N/s]",
            ylabel=f"error in {axis} [mm]",
        )
        panel.grid(alpha=0.3)
    _name(figure, next(iter(panels.values())))
    return figure


def _panels(rows: Mapping[str, Standing], height: float, **options: Any) -> tuple[Any, Any]:
    """A figure, and its panels by axis."""
    from matplotlib import pyplot as plt

    axes = axes_in(rows.values())
    size = PANEL * len(axes), height
    figure, (panels,) = plt.subplots(
        1, len(axes), figsize=size, squeeze=False, layout="constrained", **options
    )
    return figure, dict(zip(axes, panels, strict=True))


def _name(figure: Any, panel: Any) -> None:
    """Name what a panel shows, below the figure."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, fontsize=8, ncols=6, loc="outside lower center")


def _style(number: int) -> dict[str, Any]:
    return {"color": f"C{number % COLOURS}", "linestyle": STYLES[number // COLOURS % len(STYLES)]}
