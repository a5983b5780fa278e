"""The study of residual agents as figures, which need the extra `render`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from usm_agents.study.plans import HOME
from usm_agents.study.scores import Document

SHADE = 0.2


def draw_all(found: Document, folder: Path) -> None:
    """Draw learning curves, error against thrust variation, and spectra into a folder; PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    drawn = {"curves": _curves(found), "front": _front(found)}
    if found["dissected"]:
        drawn["spectra"] = _spectra(found["dissected"])
    for name, figure in drawn.items():
        figure.savefig(folder / f"{name}.png", dpi=120, metadata={"Software": None})
        plt.close(figure)


def _curves(found: Document) -> Any:
    from matplotlib import pyplot as plt

    kinds = [
        (title, [name for name, each in found["rows"].items() if each["agent"] is agent])
        for title, agent in (("agents", True), ("ablations", False))
    ]
    kinds = [(title, names) for title, names in kinds if names]
    figure, grid = plt.subplots(
        len(kinds), 2, figsize=(11.5, 4.2 * len(kinds)), squeeze=False, layout="constrained"
    )
    for panels, (title, names) in zip(grid, kinds, strict=True):
        for panel, axis in zip(panels, "xy", strict=True):
            for number, name in enumerate(names):
                curves = list(found["rows"][name]["curves"].values())
                length = min(map(len, curves))
                steps = [point["steps"] / 1e6 for point in curves[0][:length]]
                errors = 1e3 * np.array(
                    [[point[f"max_error_{axis}"] for point in curve[:length]] for curve in curves]
                )
                colour, style = f"C{number % 10}", "-" if number < 10 else "--"
                panel.plot(steps, errors.mean(axis=0), style, color=colour, label=name)
                low, high = errors.min(axis=0), errors.max(axis=0)
                panel.fill_between(steps, low, high, color=colour, alpha=SHADE, linewidth=0)
            panel.set(yscale="log", xlabel="million steps", ylabel=f"error in {axis} [mm]")
            panel.grid(alpha=0.3)
        panels[0].set_title(f"{title}: mean over seeds, and from the best seed to the worst")
        panels[1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.02, 1.0))
    return figure


def _front(found: Document) -> Any:
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(1, 2, figsize=(10, 4.8), layout="constrained")
    rows = [(name, each, "o") for name, each in found["rows"].items() if each["agent"]]
    rows += [(name, each, "s") for name, each in found["rivals"].items()]
    rows = [each for each in rows if each[1]["mode"] == "operation"]
    for panel, axis in zip(panels, "xy", strict=True):
        for number, (name, each, marker) in enumerate(rows):
            scores = each["scores"][HOME]
            place = scores["thrust_variation"]["mean"], 1e3 * scores[f"max_error_{axis}"]["mean"]
            fill = f"C{number % 10}" if marker == "o" else "none"
            panel.plot(*place, marker, color=f"C{number % 10}", markerfacecolor=fill, label=name)
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


def _spectra(found: Mapping[str, Any]) -> Any:
    from matplotlib import pyplot as plt

    figure, grid = plt.subplots(
        len(found),
        2,
        figsize=(10, 2.8 * len(found)),
        squeeze=False,
        sharex=True,
        layout="constrained",
    )
    for panels, (name, each) in zip(grid, found.items(), strict=True):
        frequency = each["frequency"][1:]
        for panel, axis in zip(panels, "xy", strict=True):
            for force, density in each[axis]["spectrum"].items():
                panel.plot(frequency, density[1:], label=force)
            panel.set(xscale="log", yscale="log", ylabel=f"{name}, {axis} [N²/Hz]")
            panel.grid(alpha=0.3)
    for panel in grid[-1]:
        panel.set_xlabel("frequency [Hz]")
    grid[0, 0].legend(fontsize=8)
    return figure
