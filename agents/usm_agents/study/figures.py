"""The study of learned agents as figures, which need the extra `render`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from usm_baselines.benchmark.results import shifts_in

from usm_agents.study.results import HomeResult, Scored, StudyResult, Trained
from usm_gym.rendering.plots import plotting, save
from usm_gym.statistics import performance_profile
from usm_gym.task.metrics import MAX_ERROR

SHADE = 0.15
# Size of a panel, inches, and how many thresholds a profile has.
WIDTH, HEIGHT = 5.0, 4.2
THRESHOLDS = 100


def draw_all(study: StudyResult, folder: Path) -> None:
    """Draw the figures of every home into a folder, as PNG and SVG.

    They are learning curves, error against thrust variation, performance profiles, errors by shift
    and spectra of the forces, the last two where there are some.
    """
    with plotting():
        for name, home in study.homes.items():
            drawn = {"curves": _curves(home), "front": _front(home), "profiles": _profiles(home)}
            if shifts_in(row.home for row in home.competing.values()):
                drawn["shifts"] = _shifts(home)
            if home.dissected:
                drawn["spectra"] = _spectra(home)
            for kind, figure in drawn.items():
                save(figure, folder / f"{name}-{kind}")


def _curves(home: HomeResult) -> Any:
    kinds = {"agents": home.agents, "ablations": home.ablations}
    kinds = {title: rows for title, rows in kinds.items() if rows}
    figure, grid = _grid(home, len(kinds), room=1.5)
    for panels, (title, rows) in zip(grid, kinds.items(), strict=True):
        for panel, axis in zip(panels, home.axes, strict=True):
            for number, (name, row) in enumerate(rows.items()):
                colour, style = f"C{number % 10}", "-" if number < 10 else "--"
                steps, errors = _learned(row, axis)
                panel.plot(steps, errors.mean(axis=0), style, color=colour, label=name)
                low, high = errors.min(axis=0), errors.max(axis=0)
                panel.fill_between(steps, low, high, color=colour, alpha=SHADE, linewidth=0)
            panel.set(yscale="log", xlabel="million steps", ylabel=f"error in {axis} [mm]")
            _read_log(panel.yaxis)
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


def _front(home: HomeResult) -> Any:
    """Error against thrust variation, with intervals; a policy without thrust has no place here."""
    figure, (panels,) = _grid(home)
    for panel, axis in zip(panels, home.axes, strict=True):
        for name, style in _styles(home).items():
            scores = home.competing[name].home
            error, variation = scores.errors[axis], scores.metrics["thrust_variation"]
            if variation.mean > 0.0:
                panel.errorbar(
                    variation.mean,
                    1e3 * error.mean,
                    _bars(error.mean, error.ci95, 1e3),
                    _bars(variation.mean, variation.ci95),
                    color=style["color"],
                    marker="o" if name in home.agents else "s",
                    markerfacecolor=style["color"] if name in home.agents else "none",
                    linestyle="none",
                    label=home.rows[name].label(name),
                )
        panel.set(xscale="log", yscale="log")
        panel.set(xlabel="thrust variation [N/s]", ylabel=f"error in {axis} [mm]")
        _read_log(panel.xaxis)
        _read_log(panel.yaxis)
        panel.grid(alpha=0.3)
    _name(figure, panels[0])
    return figure


def _profiles(home: HomeResult) -> Any:
    """Share of episodes, over all seeds, with an error up to a threshold."""
    figure, (panels,) = _grid(home)
    for panel, axis in zip(panels, home.axes, strict=True):
        tables = {
            name: 1e3 * row.home.table(MAX_ERROR + axis) for name, row in home.competing.items()
        }
        every = np.concatenate([table.ravel() for table in tables.values()])
        thresholds = np.geomspace(max(every.min(), 1e-3), every.max(), THRESHOLDS)
        for name, style in _styles(home).items():
            shares, (low, high) = performance_profile(tables[name], thresholds)
            panel.plot(
                thresholds, shares, label=home.rows[name].label(name), linewidth=1.4, **style
            )
            panel.fill_between(
                thresholds, low, high, color=style["color"], alpha=SHADE, linewidth=0
            )
        panel.set(xscale="log", xlabel=f"error in {axis} [mm]")
        _read_log(panel.xaxis)
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("share of episodes with at most this error")
    _name(figure, panels[0])
    return figure


def _shifts(home: HomeResult) -> Any:
    """Mean error after the shifts of scans, with intervals."""
    shifts = shifts_in(row.home for row in home.competing.values())
    figure, (panels,) = _grid(home)
    for panel, axis in zip(panels, home.axes, strict=True):
        for number, (name, style) in enumerate(_styles(home).items()):
            row = home.competing[name]
            errors = [row.home.by_shift[shift][axis] for shift in shifts]
            bars = [_bars(error.mean, error.ci95, 1e3) for error in errors]
            places = np.arange(len(shifts)) + 0.02 * (number - len(home.competing) / 2)
            means = [1e3 * error.mean for error in errors]
            panel.errorbar(
                places, means, np.hstack(bars), label=row.label(name), capsize=2, **style
            )
        panel.set_xticks(range(len(shifts)), shifts)
        panel.set(yscale="log", xlabel="shift", ylabel=f"error in {axis} [mm]")
        _read_log(panel.yaxis)
        panel.grid(alpha=0.3)
    _name(figure, panels[0])
    return figure


def _spectra(home: HomeResult) -> Any:
    figure, grid = _grid(home, len(home.dissected), height=2.8, sharex=True)
    for panels, (name, dissection) in zip(grid, home.dissected.items(), strict=True):
        for panel, (axis, shares) in zip(panels, dissection.axes.items(), strict=True):
            for force, density in shares.spectrum.items():
                panel.plot(dissection.frequency[1:], density[1:], label=force)
            panel.set(xscale="log", yscale="log", ylabel=f"force in {axis} [N²/Hz]")
            panel.grid(alpha=0.3)
        panels[0].set_title(name, fontsize=10)
    for panel in grid[-1]:
        panel.set_xlabel("frequency [Hz]")
    _name(figure, grid[0, 0])
    return figure


def _grid(
    home: HomeResult, rows: int = 1, height: float = HEIGHT, room: float = 0.0, **options: Any
) -> tuple[Any, Any]:
    """Rows of panels with one for each axis, and so much room beside each, inches."""
    from matplotlib import pyplot as plt

    columns = len(home.axes)
    size = (WIDTH + room) * columns, height * rows
    return plt.subplots(
        *(rows, columns), figsize=size, squeeze=False, layout="constrained", **options
    )


def _styles(home: HomeResult) -> dict[str, dict[str, str]]:
    """Colours and lines of agents and rivals, the lines of which are dashed."""
    rows: Mapping[str, Scored] = home.competing
    lines = {name: "-" if name in home.agents else "--" for name in rows}
    return {
        name: {"color": f"C{number % 10}", "linestyle": ":" if number >= 10 else lines[name]}
        for number, name in enumerate(rows)
    }


def _read_log(axis: Any) -> None:
    """Write plain numbers on a logarithmic axis, a few however little it covers."""
    from matplotlib import ticker

    low, high = axis.get_view_interval()
    narrow = high < 6.0 * low
    axis.set_major_locator(ticker.MaxNLocator(5) if narrow else ticker.LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(ticker.NullFormatter())


def _bars(mean: float, interval: tuple[float, float], scale: float = 1.0) -> Any:
    """The lengths of the bars of an interval, (2, 1)."""
    low, high = interval
    return scale * np.array([[max(mean - low, 0.0)], [max(high - mean, 0.0)]])


def _name(figure: Any, panel: Any) -> None:
    handles, names = panel.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside right upper", fontsize=8)
