"""Figures 3 to 10 of the paper and one of its theorem, from our runs (needs `render`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from usm_baselines.laws.super_twisting import SuperTwistingGains
from usm_baselines.paper.convergence import Start, cascade, disturbance_rate, growth
from usm_baselines.paper.paper_rate import Array, Law, Record, simulate
from usm_baselines.paper.reproduction import AXES, IMPLICIT_STEP, SAMPLE_TIME, at_step
from usm_gym.robot import Robot
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


NAMES = (*CAPTIONS, "theorem1")


def draw(names: Sequence[str], records: Records, folder: Path) -> None:
    """Draw figures into a folder; PNG."""
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
    for name in names:
        if name == "theorem1":
            figure = _theorem(records)
        else:
            caption, row, mode = CAPTIONS[name]
            figure = drawers[name](records[row, mode], row)
            number = int(name[3:])
            figure.suptitle(f"{caption} (our run, to lay beside Fig. {number})", fontsize=11)
        figure.savefig(folder / f"{name}.png", dpi=120, metadata={"Software": None})
        plt.close(figure)


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

    figure, axes = plt.subplots(figsize=(9, 2.4), layout="constrained")
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
        panels[1].plot(record.time, second[:, axis], color=colour, linewidth=0.8, label=name)
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

    size = 8, 2.5 * len(AXES)
    figure, panels = plt.subplots(len(AXES), 1, figsize=size, sharex=True, layout="constrained")
    for axis, name in enumerate(AXES):
        panels[axis].plot(record.time, 1e3 * record.error[:, axis], color=f"C{axis}")
        panels[axis].set(ylabel=f"error in {name} [mm]")
        panels[axis].grid(alpha=0.3)
    panels[-1].set(xlabel="time [s]")
    return figure


def _theorem(records: Records) -> Any:
    from matplotlib import pyplot as plt

    figure, panels = plt.subplots(2, 2, figsize=(11, 8), layout="constrained")
    _observer_region(panels[0, 0])
    _sliding(panels[0, 1])
    _decay(panels[1, 0])
    _disturbances(panels[1, 1], records)
    for panel in panels.flat:
        panel.grid(alpha=0.3)
        panel.legend(fontsize=8)
    figure.suptitle("Theorem 1 with the printed gains (our runs)", fontsize=11)
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
        panel.plot(trace.time[::20], np.abs(trace.sigma[::20]), linewidth=1, label=name)
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
        panel.plot(
            trace.time[::20],
            np.abs(trace.error[::20]),
            linewidth=1,
            label=rf"$|\dot F|$ = {rate:g} L",
        )
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
        rate = disturbance_rate(record)
        panel.plot(record.time[1:], np.maximum(rate, 1e-4), linewidth=0.8, label=name)
    panel.axhline(L, color="k", linestyle=":", label="L")
    panel.set(
        yscale="log",
        xlabel="time [s]",
        ylabel=r"$|\dot F|$ over 1 ms [m/s$^3$]",
        title="what the joints make",
    )
