"""Table 1, figures 3 to 10 and the theorem of the paper, from our runs (needs `render`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from usm_baselines.laws.super_twisting import SuperTwistingGains
from usm_baselines.paper.convergence import Start, cascade, disturbance_rate, growth
from usm_baselines.paper.paper_rate import Array, Law, Record, simulate
from usm_baselines.paper.reproduction import (
    AXES,
    IMPLICIT_STEP,
    PAPER,
    PARTS,
    PRINTED,
    SAMPLE_TIME,
    ReproductionResult,
    at_step,
)
from usm_gym.rendering.look import ERROR_COLOURS
from usm_gym.rendering.plots import plotting, save
from usm_gym.robot import Robot
from usm_gym.support.text import figures
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named

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
NAMES = ("table1", *CAPTIONS, "theorem1")
COLOURS = [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in ERROR_COLOURS]
# A colour of the cycle stands for an axis or a case.
CYCLE = {"axes.prop_cycle": "cycler('color', ['#0072b2', '#d55e00', '#009e73', '#cc79a7'])"}
# A line is drawn through the smallest and largest number in each of so many intervals.
INTERVALS = 300


def draw(names: Sequence[str], result: ReproductionResult, records: Records, folder: Path) -> None:
    """Draw figures into a folder, as PNG and SVG.

    Args:
        names: Some of `NAMES`.
        result: The table.
        records: The runs behind it, by row and mode.
        folder: Where to write.
    """
    drawers: dict[str, Callable[[Record, str, str], Any]] = {
        "fig03": _bodies,
        "fig04": _bodies,
        "fig05": _signals,
        "fig06": _signals,
        "fig07": _errors,
        "fig08": _signals,
        "fig09": _signals,
        "fig10": _errors,
    }
    with plotting(**CYCLE):
        for name in names:
            if name == "table1":
                figure = _table(result)
            elif name == "theorem1":
                figure = _theorem(records)
            else:
                caption, row, mode = CAPTIONS[name]
                figure = drawers[name](records[row, mode], row, mode)
                number = int(name[3:])
                figure.suptitle(f"{caption} (our run, to lay beside Fig. {number})", fontsize=10)
            save(figure, folder / name)


def link_ends(record: Record, sample: int, robot: Robot) -> Array:
    """Positions of the joints and both ends of the body in a sample, m, (links + 1, 2)."""
    theta = record.theta[sample]
    steps = 2 * robot.half_length * np.stack([np.cos(theta), np.sin(theta)], axis=1)
    ends = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    centres = (ends[1:] + ends[:-1]) / 2
    position = record.reference[sample] + record.error[sample]
    return np.asarray(ends - centres.mean(axis=0) + position)


def thinned(time: Array, values: Array) -> tuple[Array, Array]:
    """The extremes of a signal in each of `INTERVALS` intervals, in their order.

    Args:
        time: Times, s, (samples,).
        values: The signal, (samples,).

    Returns:
        Times and values, (at most 2 `INTERVALS` + 2,) each; a peak keeps its height.
    """
    kept = {0, len(values) - 1}
    for part in np.array_split(np.arange(len(values)), INTERVALS):
        if len(part):
            kept |= {part[values[part].argmin()], part[values[part].argmax()]}
    chosen = np.array(sorted(kept))
    return time[chosen], values[chosen]


def _table(result: ReproductionResult) -> Any:
    """Our errors beside the printed ones, a panel for each row of the paper."""
    from matplotlib import pyplot as plt

    places = [(part, axis) for part in PARTS for axis in result.axes]
    size = 6.4, 0.3 * len(places) + 1.2
    figure, panels = plt.subplots(
        1, len(result.paper), figsize=size, sharex=True, sharey=True, layout="constrained"
    )
    for panel, (theirs, printed) in zip(panels, result.paper.items(), strict=True):
        rows = [row for row, other in PRINTED.items() if other == theirs and row in result.rows]
        for row, marker, colour in zip(rows, "o^", COLOURS, strict=False):
            ours = [1e3 * result.rows[row][part][axis] for part, axis in places]
            panel.plot(ours, range(len(places)), marker, color=colour, markersize=5, label=row)
        for place, (part, axis) in enumerate(places):
            ends = 1e3 * printed[part][axis], 1e3 * result.rows[theirs][part][axis]
            panel.plot(ends, (place, place), color="0.75", linewidth=2, zorder=0)
            ratio = f"× {figures(ends[1] / ends[0])}"
            panel.annotate(
                ratio,
                (1, place),
                (-3, 0),
                xycoords=("axes fraction", "data"),
                textcoords="offset points",
                ha="right",
                va="center",
                fontsize=7,
            )
        numbers = [1e3 * printed[part][axis] for part, axis in places]
        panel.plot(numbers, range(len(places)), "D", color="k", fillstyle="none", label="paper")
        panel.set(xscale="log", xlabel="largest position error [mm]")
        panel.xaxis.set_major_formatter(lambda value, place: f"{value:g}")
        panel.legend(fontsize=8, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
        _plain(panel)
    low, high = panels[0].get_xlim()
    panels[0].set(xlim=(low, 8 * high), ylim=(len(places) - 0.5, -0.5))
    panels[0].set_yticks(range(len(places)), [f"{part} {axis}" for part, axis in places])
    return figure


def _bodies(record: Record, row: str, mode: str) -> Any:
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 1.9), layout="constrained")
    position = record.reference + record.error
    path = record.reference[::100]
    axes.plot(*path.T, "--", color="k", linewidth=1, label="reference", zorder=4)
    axes.plot(*position[::100].T, color="0.5", linewidth=2.5, label="centre of mass", zorder=3)
    times = (0.0, 9.0, 15.0, 25.0, 39.0)
    for number, time in enumerate(times):
        sample = int(np.searchsorted(record.time, time))
        ends = link_ends(record, sample, Robot())
        colour = plt.get_cmap("viridis")(number / len(times))
        axes.plot(*ends.T, color=colour, linewidth=3, solid_capstyle="round", label=f"{time:g} s")
        axes.plot(*ends[-1], "o", color=colour, markersize=6)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    _plain(axes)
    figure.legend(fontsize=7, ncols=7, columnspacing=1, loc="outside lower center")
    return figure


def _signals(record: Record, row: str, mode: str) -> Any:
    """Position, its error, for the STA the sliding variable, control input, observer error."""
    from matplotlib import pyplot as plt

    shown = {
        "position [m]": record.reference + record.error,
        "position error [mm]": 1e3 * record.error,
        r"$\hat\sigma$ [mm/s]": 1e3 * record.sigma,
        "control input [N]": record.force,
        "observer error [µm]": 1e6 * record.observer_error,
    }
    if row != "sta":
        del shown[r"$\hat\sigma$ [mm/s]"]
    size = 6.4, 1.5 * len(shown) + 0.6
    figure, panels = plt.subplots(len(shown), figsize=size, sharex=True, layout="constrained")
    for panel, (label, signal) in zip(panels, shown.items(), strict=True):
        for axis, name in enumerate(AXES):
            curve = thinned(record.time, signal[:, axis])
            panel.plot(*curve, color=COLOURS[axis], linewidth=0.8, label=name)
        panel.set(ylabel=label)
        _plain(panel)
    for axis in range(len(AXES)):
        reference = thinned(record.time, record.reference[:, axis])
        panels[0].plot(*reference, "--", color="k", linewidth=0.8, label="reference")
        _printed(panels[1], row, mode, axis, COLOURS[axis])
    figure.legend(*_legend(panels[:2]), fontsize=8, ncols=5, loc="outside lower center")
    panels[-1].set(xlabel="time [s]", xlim=(0, record.time[-1]))
    figure.align_ylabels()
    return figure


def _errors(record: Record, row: str, mode: str) -> Any:
    """The position error, a panel for each axis."""
    from matplotlib import pyplot as plt

    size = 6.4, 1.9 * len(AXES) + 0.4
    figure, panels = plt.subplots(len(AXES), figsize=size, sharex=True, layout="constrained")
    for axis, (name, panel) in enumerate(zip(AXES, panels, strict=True)):
        curve = thinned(record.time, 1e3 * record.error[:, axis])
        panel.plot(*curve, color=COLOURS[axis], linewidth=0.8, label="ours")
        _printed(panel, row, mode, axis, "k")
        panel.set(ylabel=f"error in {name} [mm]")
        _plain(panel)
    figure.legend(*_legend(panels), fontsize=8, ncols=3, loc="outside lower center")
    panels[-1].set(xlabel="time [s]", xlim=(0, record.time[-1]))
    figure.align_ylabels()
    return figure


def _legend(panels: Sequence[Any]) -> tuple[list[Any], list[str]]:
    """What the lines of some panels mean, each meaning once."""
    meanings: dict[str, Any] = {}
    for panel in panels:
        for line, words in zip(*panel.get_legend_handles_labels(), strict=True):
            meanings.setdefault(words, line)
    return list(meanings.values()), list(meanings)


def _printed(panel: Any, row: str, mode: str, axis: int, colour: str) -> None:
    """The largest errors that the paper prints for a run, on both sides of 0, mm."""
    parts = [part for part, other in PARTS.items() if other == mode]
    for part, style in zip(parts, ("--", ":"), strict=False):
        error = 1e3 * PAPER[row][part][AXES[axis]]
        label = "largest, paper" if part == mode else f"{part}, paper"
        for side, words in ((error, label), (-error, "_")):
            panel.axhline(side, color=colour, linestyle=style, linewidth=0.9, label=words)


def _plain(panel: Any) -> None:
    """Draw no more lines than a reader needs."""
    panel.grid(alpha=0.25, linewidth=0.5)
    panel.spines[["top", "right"]].set_visible(False)


def _theorem(records: Records) -> Any:
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(2, 2, figsize=(8.4, 6.8), layout="constrained")
    _observer_region(panels[0, 0])
    _sliding(panels[0, 1])
    _decay(panels[1, 0])
    _disturbances(panels[1, 1], records)
    for panel in panels.flat:
        panel.title.set_fontsize(9)
        panel.legend(fontsize=7)
        _plain(panel)
    figure.suptitle("Theorem 1 with the printed gains (our runs)", fontsize=10)
    return figure


def _observer_region(panel: Any) -> None:
    L = SuperTwistingGains().observer_gain
    rates = np.linspace(0.0, 7.0, 36)
    for exponent, name in ((0.5, "1/2, as printed"), (2 / 3, "2/3")):
        grown = [growth(rate * L, exponent) for rate in rates.tolist()]
        panel.plot(rates, grown, label=f"$k_2 = 11 L^{{p}}$, p = {name}")
    panel.axhline(1.0, color="k", linewidth=0.8)
    panel.axvline(1.0, color="k", linestyle=":", label="L")
    panel.set(
        yscale="log",
        xlabel=r"$|\dot F|\,/\,L$",
        ylabel="observer error after 2.7 s / at the start",
        title="the observer under the worst switching of $\\dot F$",
    )


def _sliding(panel: Any) -> None:
    gains = SuperTwistingGains()
    runs = (
        (1.0, gains, r"$\hat\sigma(0)$ = 1 m/s"),
        (0.1, gains, "0.1 m/s"),
        (0.04, gains, "0.04 m/s, inside $\\alpha_m$"),
        (0.04, gains._replace(dead_zone=0.0), "0.04 m/s with (12) for (14)"),
    )
    for sigma, chosen, name in runs:
        trace = cascade(chosen, Start(sigma=sigma), 3.0)
        panel.plot(*thinned(trace.time, np.abs(trace.sigma)), linewidth=1, label=name)
    panel.set(
        yscale="log",
        ylim=(1e-9, 3.0),
        xlabel="time [s]",
        ylabel=r"$|\hat\sigma|$ [m/s]",
        title=r"the sliding variable, $\alpha(0)$ = 0",
    )


def _decay(panel: Any) -> None:
    gains = SuperTwistingGains()
    for rate in (0.0, 1.0, 4.0):
        trace = cascade(
            gains,
            Start(error=0.1, sigma=0.5, e2=1.0),
            8.0,
            rate * gains.observer_gain,
            (-0.92, 0.39),
        )
        curve = thinned(trace.time, np.abs(trace.error))
        panel.plot(*curve, linewidth=1, label=rf"$|\dot F|$ = {rate:g} L")
    time = np.array([1.0, 8.0])
    panel.plot(time, 0.3 * np.exp(-time), "k--", linewidth=0.8, label=r"$e^{-\lambda t}$")
    panel.set(
        yscale="log",
        xlabel="time [s]",
        ylabel=r"$|\tilde p|$ [m]",
        title=r"the position error, $\hat\sigma(0)$ = 0.5 m/s, $e_2(0)$ = 1 m/s, worst $\dot F$",
    )


def _disturbances(panel: Any, records: Records) -> None:
    L = SuperTwistingGains().observer_gain
    scenario = at_step(named("nominal", "operation", PRESETS["ideal"]), IMPLICIT_STEP)
    filtered = simulate(scenario, Law(implicit=True), round(SAMPLE_TIME / IMPLICIT_STEP))
    shown = (
        (records["sta", "operation"], "stepped joint references (table1)"),
        (filtered, "filtered joint references (nominal)"),
    )
    for record, name in shown:
        curve = thinned(record.time[1:], np.maximum(disturbance_rate(record), 1e-4))
        panel.plot(*curve, linewidth=0.8, label=name)
    panel.axhline(L, color="k", linestyle=":", label="L")
    panel.set(
        yscale="log",
        xlabel="time [s]",
        ylim=(None, 1e7),
        ylabel=r"$|\dot F|$ over 1 ms [m/s$^3$]",
        title="what the joints make",
    )
