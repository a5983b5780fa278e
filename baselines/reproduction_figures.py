"""Figures 3 to 10 of the paper, drawn from our runs (needs the extra `render`)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from baselines.paper_rate import Array, Record
from usm_gym.robot import Robot

AXES = ("x", "y")
Records = dict[tuple[str, Any], Record]

# Figure: (caption, row, mode).
CAPTIONS = {
    "fig03": ("Torpedo mode", "sta", "torpedo"),
    "fig04": ("Operation mode", "sta", "operation"),
    "fig05": ("Torpedo mode: STA with state observer", "sta", "torpedo"),
    "fig06": ("Operation mode: STA with state observer", "sta", "operation"),
    "fig07": ("Operation mode: position error of the STA", "sta", "operation"),
    "fig08": ("Torpedo mode: PD controller", "pd", "torpedo"),
    "fig09": ("Operation mode: PD controller", "pd", "operation"),
    "fig10": ("Operation mode: position error of the PD controller", "pd", "operation"),
}


def draw_all(records: Records, folder: Path) -> list[Path]:
    """Draw every figure into a folder; PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    drawers: dict[str, Callable[[Record, str], Any]] = {
        "fig03": _bodies,
        "fig04": _bodies,
        "fig05": _signals,
        "fig06": _signals,
        "fig07": _errors,
        "fig08": _signals,
        "fig09": _signals,
        "fig10": _errors,
    }
    paths = []
    for name, (caption, row, mode) in CAPTIONS.items():
        figure = drawers[name](records[row, mode], row)
        number = int(name[3:])
        figure.suptitle(f"{caption} (our run, to lay beside Fig. {number})", fontsize=11)
        path = folder / f"{name}.png"
        figure.savefig(path, dpi=120, metadata={"Software": None})
        plt.close(figure)
        paths.append(path)
    return paths


def link_ends(record: Record, sample: int, robot: Robot) -> Array:
    """Positions of the joints and both ends of the body in a sample, m, (links + 1, 2)."""
    theta = record.theta[sample]
    steps = 2 * robot.half_length * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    ends = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    centres = (ends[1:] + ends[:-1]) / 2
    position = record.reference[sample] + record.error[sample]
    return np.asarray(ends - centres.mean(axis=0) + position)


def _bodies(record: Record, row: str) -> Any:
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 3.2), layout="constrained")
    position = record.reference + record.error
    axes.plot(
        *record.reference.T, "--", color="k", linewidth=1, label="reference of the CM", zorder=4
    )
    axes.plot(*position.T, color="C3", linewidth=1.5, label="CM", zorder=3)
    times = (0.0, 9.0, 15.0, 25.0, 39.0)
    for number, time in enumerate(times):
        sample = int(np.searchsorted(record.time, time))
        ends = link_ends(record, sample, Robot())
        colour = plt.get_cmap("viridis")(number / len(times))
        axes.plot(*ends.T, color=colour, linewidth=3, solid_capstyle="round", label=f"{time:g} s")
        axes.plot(*ends[-1], "o", color=colour, markersize=6)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    figure.legend(fontsize=8, ncols=7, loc="outside lower center")
    return figure


def _signals(record: Record, row: str) -> Any:
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(4, 1, figsize=(8, 9), sharex=True, layout="constrained")
    position = record.reference + record.error
    for axis, name in enumerate(AXES):
        colour = f"C{axis}"
        panels[0].plot(record.time, position[:, axis], color=colour, label=f"$p_{name}$")
        panels[0].plot(
            record.time,
            record.reference[:, axis],
            "--",
            color="k",
            linewidth=0.8,
            label=f"$p_{{{name},ref}}$",
        )
        second = record.sigma if row == "sta" else 1e3 * record.error
        panels[1].plot(record.time, second[:, axis], color=colour, label=name)
        panels[2].plot(record.time, record.force[:, axis], color=colour, label=name)
        panels[3].plot(record.time, record.observer_error[:, axis], color=colour, label=name)
    panels[0].set(ylabel="position [m]")
    if row == "sta":
        panels[1].set(ylabel=r"$\hat\sigma$ [m/s]")
    else:
        panels[1].set(ylabel="position error [mm]")
    panels[2].set(ylabel="control input $F_{CM}$ [N]")
    panels[3].set(ylabel="observer error $e_1$ [m]", xlabel="time [s]")
    for panel in panels:
        panel.grid(alpha=0.3)
        panel.legend(fontsize=8, ncols=4, loc="upper left")
    return figure


def _errors(record: Record, row: str) -> Any:
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(2, 1, figsize=(8, 5), sharex=True, layout="constrained")
    for axis, name in enumerate(AXES):
        panels[axis].plot(record.time, 1e3 * record.error[:, axis], color=f"C{axis}")
        panels[axis].set(ylabel=f"error in {name} [mm]")
        panels[axis].grid(alpha=0.3)
    panels[1].set(xlabel="time [s]")
    return figure
