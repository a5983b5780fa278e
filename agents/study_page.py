"""The study of residual agents as Markdown and as figures (which need the extra `render`)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from agents.study import HOME, TRANSFER, Document, claims
from agents.terminal import figures, mm

LEGEND = """\
Largest position error after settling, mm, over unseen scenarios and all seeds: mean with its 95 %
interval (episodes are resampled within each seed), mean of the middle half, mean of the best and of
the worst seed; thrust variation, N/s, and effort, N; episodes lost.
"""
COLUMNS = (
    "seeds",
    "x, mm",
    "y, mm",
    "middle half x",
    "middle half y",
    "seeds x",
    "seeds y",
    "variation, N/s",
    "thrust, N",
    "lost",
)
SHADE = 0.2


def markdown(found: Document) -> str:
    """All tables."""
    agents = {name: each for name, each in found["rows"].items() if each["agent"]}
    others = {name: each for name, each in found["rows"].items() if not each["agent"]}
    parts = ["# Study of residual agents\n", LEGEND]
    if agents:
        parts += ["## Agents\n", table(agents), "## Classical policies\n", table(found["rivals"])]
        parts += ["## Agents against classical policies\n", AGAINST, against(claims(found))]
        parts += ["## Elsewhere\n", ELSEWHERE, elsewhere({**agents, **found["rivals"]})]
        parts += ["## What the agents do to their bases\n", DISSECTED, taken(found["dissected"])]
    if others:
        parts += ["## Ablations\n", table(others)]
    parts += ["## Commands\n", commands(found)]
    return "\n".join(parts)


AGAINST = """\
Ratio of the means in x / y, and in brackets the share of scenarios in which the agent (seed 0) is
better in both.
"""
ELSEWHERE = """\
Mean errors x / y, mm, under other conditions than those of the training: without noise, lag and
error of the model; rougher water; joints still; coefficients off by up to 40 %. Lost episodes in
brackets.
"""
DISSECTED = """\
Standard deviations of the force that the base commands alone, and with the agent; of the residual;
and of the force that was needed, which is the oracle's in the same episode. The residual is split
by least squares into a share of what the base commands in excess of it, taken back, and a share of
the needed force; "late" is by how much the whole force follows the needed one. x / y.
"""


def table(rows: Mapping[str, Any]) -> str:
    """Scores at home."""
    lines = [_line(("policy", *COLUMNS)), "|---|" + "---:|" * len(COLUMNS)]
    for name, each in rows.items():
        scores = each["scores"][HOME]
        errors = [scores[f"max_error_{axis}"] for axis in "xy"]
        cells = [name, str(len(errors[0]["seeds"]))]
        cells += [f"{mm(e['mean'])} [{mm(e['ci95'][0])}, {mm(e['ci95'][1])}]" for e in errors]
        cells += [mm(e["iqm"]) for e in errors]
        cells += [f"{mm(min(e['seeds']))} to {mm(max(e['seeds']))}" for e in errors]
        cells += [figures(scores[key]["mean"]) for key in ("thrust_variation", "thrust_effort")]
        lines.append(_line([*cells, str(scores["failures"])]))
    return "\n".join(lines) + "\n"


def against(found: Mapping[str, Any]) -> str:
    """Each agent against each classical policy."""
    rivals = list(dict.fromkeys(rival for row in found.values() for rival in row))
    lines = [_line(("agent", *rivals)), "|---|" + "---:|" * len(rivals)]
    for name, row in found.items():
        cells = [name]
        for rival in rivals:
            if rival in row:
                x, y = map(figures, row[rival]["ratio"])
                cells.append(f"{x} / {y} ({row[rival]['better_in_both']:.2f})")
            else:
                cells.append("")
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def elsewhere(rows: Mapping[str, Any]) -> str:
    """Scores under the other conditions."""
    lines = [_line(("policy", HOME, *TRANSFER)), "|---|" + "---:|" * (1 + len(TRANSFER))]
    for name, each in rows.items():
        cells = [name]
        for kind in (HOME, *TRANSFER):
            scores = each["scores"][kind]
            lost = f" ({scores['failures']})" if scores["failures"] else ""
            x, y = (mm(scores[f"max_error_{axis}"]["mean"]) for axis in "xy")
            cells.append(f"{x} / {y}{lost}")
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def taken(found: Mapping[str, Any]) -> str:
    """What each residual is made of."""
    forces = ("base alone, N", "base, N", "residual, N", "needed, N")
    shares = ("excess taken back", "needed added", "explained")
    head = ("agent", *forces, *shares, "late, ms")
    lines = [_line(head), "|---|" + "---:|" * (len(head) - 1)]
    for name, each in found.items():
        axes = [each["x"], each["y"]]
        cells = [
            " / ".join(figures(axis["deviation"][force]) for axis in axes)
            for force in ("base alone", "base", "residual", "needed")
        ]
        cells += [
            " / ".join(f"{axis[key]:.2f}" for axis in axes)
            for key in ("excess_taken_back", "needed_added", "explained")
        ]
        late = " / ".join(f"{1e3 * axis['lateness']:.0f}" for axis in axes)
        lines.append(_line([name, *cells, late]))
    return "\n".join(lines) + "\n"


def commands(found: Document) -> str:
    """How each training is repeated, as its seed 0."""
    return "\n".join(f"    {each['command']}" for each in found["rows"].values()) + "\n"


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
        len(kinds), 2, figsize=(10, 4.2 * len(kinds)), squeeze=False, layout="constrained"
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
                colour = f"C{number % 10}"
                panel.plot(steps, errors.mean(axis=0), color=colour, label=name)
                low, high = errors.min(axis=0), errors.max(axis=0)
                panel.fill_between(steps, low, high, color=colour, alpha=SHADE, linewidth=0)
            panel.set(yscale="log", xlabel="million steps", ylabel=f"error in {axis} [mm]")
            panel.grid(alpha=0.3)
        panels[0].set_title(f"{title}: mean over seeds, and from the best seed to the worst")
        panels[1].legend(fontsize=8)
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


def _line(cells: Any) -> str:
    return "| " + " | ".join(cells) + " |"
