"""Figures of the leaderboard (need the extra `render`)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from usm_baselines.benchmark.leaderboard import MAIN, Document
from usm_gym.statistics import performance_profile

# Colour and line style, or colour and marker, tell thirty policies apart.
COLOURS = 10
STYLES = ("-", "--", ":")
MARKERS = ("o", "s", "^")
SHADE = 0.15


def draw_all(found: Document, folder: Path) -> None:
    """Draw errors, performance profiles and error against thrust variation into a folder; PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    rows = found["suites"][MAIN]
    drawn = {
        "errors": _errors(found["suites"]),
        "profiles": _profiles(rows),
        "variation": _variation(rows, found["front"]),
    }
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", dpi=120, metadata={"Software": None})
        plt.close(figure)


def _errors(suites: Mapping[str, Any]) -> Any:
    """Mean error of each policy on each suite, with its interval."""
    from matplotlib import pyplot as plt

    names = list(suites[MAIN])
    height = 0.25 * len(names) + 1.2
    figure, panels = plt.subplots(
        *(len(suites), 2),
        figsize=(9, height * len(suites)),
        squeeze=False,
        sharex=True,
        layout="constrained",
    )
    for line, (suite, rows) in zip(panels, suites.items(), strict=True):
        for panel, axis in zip(line, "xy", strict=True):
            for place, name in enumerate(names):
                if name in rows:
                    score = rows[name][f"max_error_{axis}"]
                    low, high = score["ci95"]
                    panel.plot([1e3 * low, 1e3 * high], [place, place], color="C0")
                    panel.plot(1e3 * score["mean"], place, "o", color="C0", markersize=4)
            panel.set(xscale="log", xlabel=f"error in {axis} [mm]", ylim=(len(names) - 0.5, -0.5))
            panel.set_yticks(range(len(names)), names if axis == "x" else [""] * len(names))
            panel.set_title(suite, fontsize=10)
            panel.grid(alpha=0.3)
    return figure


def _profiles(rows: Mapping[str, Any]) -> Any:
    """Share of episodes with an error up to a threshold."""
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(11, 5), sharey=True, layout="constrained")
    for panel, axis in zip(panels, "xy", strict=True):
        errors = {
            name: 1e3 * np.array(row["per_episode"][f"max_error_{axis}"])
            for name, row in rows.items()
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
    panels[0].set(ylabel="share of episodes with at most this error")
    figure.legend(
        *panels[0].get_legend_handles_labels(), fontsize=8, ncols=6, loc="outside lower center"
    )
    return figure


def _variation(rows: Mapping[str, Any], front: Mapping[str, Any]) -> Any:
    """Error against thrust variation, and the fronts of the tuned laws."""
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(11, 6), layout="constrained")
    for panel, axis in zip(panels, "xy", strict=True):
        for number, (name, row) in enumerate(rows.items()):
            variation = row["thrust_variation"]["mean"]
            if variation > 0:
                error = 1e3 * row[f"max_error_{axis}"]["mean"]
                marker = MARKERS[number // COLOURS % len(MARKERS)]
                color = _style(number)["color"]
                panel.plot(variation, error, marker, color=color, linestyle="none", label=name)
        for name, points in front.items():
            panel.plot(
                [each["thrust_variation"] for each in points],
                [1e3 * each[f"max_error_{axis}"] for each in points],
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
    figure.legend(
        *panels[0].get_legend_handles_labels(), fontsize=8, ncols=6, loc="outside lower center"
    )
    return figure


def _style(number: int) -> dict[str, Any]:
    return {"color": f"C{number % COLOURS}", "linestyle": STYLES[number // COLOURS % len(STYLES)]}
