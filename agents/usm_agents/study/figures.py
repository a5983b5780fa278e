"""The study of residual agents as figures, which need the extra `render`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from usm_agents.study.results import MAIN_MODE, Rival, StudyResult, Trained

SHADE = 0.2


def draw_all(study: StudyResult, folder: Path) -> None:
    """Draw learning curves, error against thrust variation, and spectra into a folder; PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    drawn = {"curves": _curves(study), "front": _front(study)}
    if study.dissected:
        drawn["spectra"] = _spectra(study)
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", dpi=120, metadata={"Software": None})
        plt.close(figure)


def _curves(study: StudyResult) -> Any:
    from matplotlib import pyplot as plt

    kinds = {"agents": study.agents, "ablations": study.ablations}
    kinds = {title: rows for title, rows in kinds.items() if rows}
    figure, grid = plt.subplots(
        *(len(kinds), len(study.axes)),
        figsize=(5.75 * len(study.axes), 4.2 * len(kinds)),
        squeeze=False,
        layout="constrained",
    )
    for panels, (title, rows) in zip(grid, kinds.items(), strict=True):
        for panel, axis in zip(panels, study.axes, strict=True):
            for number, (name, row) in enumerate(rows.items()):
                colour, style = f"C{number % 10}", "-" if number < 10 else "--"
                steps, errors = _learned(row, axis)
                panel.plot(steps, errors.mean(axis=0), style, color=colour, label=name)
                low, high = errors.min(axis=0), errors.max(axis=0)
                panel.fill_between(steps, low, high, color=colour, alpha=SHADE, linewidth=0)
            panel.set(yscale="log", xlabel="million steps", ylabel=f"error in {axis} [mm]")
            panel.grid(alpha=0.3)
        panels[0].set_title(f"{title}: mean over seeds, and from the best seed to the worst")
        panels[-1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return figure


def _learned(row: Trained, axis: str) -> tuple[list[float], Any]:
    """Millions of steps, and the errors of all seeds after them, mm, (seeds, points)."""
    curves = list(row.curves.values())
    length = min(map(len, curves))
    steps = [point.steps / 1e6 for point in curves[0][:length]]
    return steps, 1e3 * np.array([[point.errors[axis] for point in c[:length]] for c in curves])


def _front(study: StudyResult) -> Any:
    from matplotlib import pyplot as plt

    figure, (panels,) = plt.subplots(
        *(1, len(study.axes)),
        figsize=(5 * len(study.axes), 4.8),
        squeeze=False,
        layout="constrained",
    )
    rows: Mapping[str, Trained | Rival] = {**study.agents, **study.rivals}
    rows = {name: row for name, row in rows.items() if row.mode == MAIN_MODE}
    for panel, axis in zip(panels, study.axes, strict=True):
        for number, (name, row) in enumerate(rows.items()):
            scores = row.scores[study.home]
            place = scores.metrics["thrust_variation"].mean, 1e3 * scores.errors[axis].mean
            colour = f"C{number % 10}"
            marker, fill = ("o", colour) if name in study.agents else ("s", "none")
            panel.plot(*place, marker, color=colour, markerfacecolor=fill, label=name)
        panel.set(
            xscale="log",
            yscale="log",
            xlabel="thrust variation [N/s]",
            ylabel=f"error in {axis} [mm]",
        )
        panel.grid(alpha=0.3, which="both")
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside right upper", fontsize=8)
    return figure


def _spectra(study: StudyResult) -> Any:
    from matplotlib import pyplot as plt

    count = len(study.dissected)
    figure, grid = plt.subplots(
        *(count, len(study.axes)),
        figsize=(5 * len(study.axes), 2.8 * count),
        squeeze=False,
        sharex=True,
        layout="constrained",
    )
    for panels, (name, dissection) in zip(grid, study.dissected.items(), strict=True):
        for panel, (axis, shares) in zip(panels, dissection.axes.items(), strict=True):
            for force, density in shares.spectrum.items():
                panel.plot(dissection.frequency[1:], density[1:], label=force)
            panel.set(xscale="log", yscale="log", ylabel=f"{name}, {axis} [N²/Hz]")
            panel.grid(alpha=0.3)
    for panel in grid[-1]:
        panel.set_xlabel("frequency [Hz]")
    grid[0, 0].legend(fontsize=8)
    return figure
