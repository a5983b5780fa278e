"""The page of figures of the sensitivity study (needs the extra `render`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from usm_baselines.paper.reproduction import PAPER
from usm_baselines.paper.sensitivity import PERIODS, ROWS, SENSORS_AND_THRUSTERS, STARTS, variations

COLUMNS = [
    (row, part, axis)
    for row in ROWS
    for part in ("torpedo", "operation", "settled")
    for axis in ("x", "y")
]
Results = dict[tuple[str, str, str, str], Any]


def draw_study(runs: list[dict[str, Any]], path: Path) -> None:
    """Draw the page.

    Args:
        runs: What `sensitivity.study` returns.
        path: Where to write the PNG.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    results = {(run["item"], run["value"], run["row"], run["mode"]): run["result"] for run in runs}
    figure = plt.figure(figsize=(20, 13), layout="constrained")
    grid = figure.add_gridspec(2, 4, width_ratios=(1.25, 1.25, 1, 1))
    _numbers(figure.add_subplot(grid[:, :2]), results)
    _oscillation(figure.add_subplot(grid[0, 2]), results)
    _peaks(figure.add_subplot(grid[0, 3]), results)
    _readings(figure.add_subplot(grid[1, 2]), results)
    _rates(figure.add_subplot(grid[1, 3]), results)
    figure.suptitle("What the open items of the paper do to its Table 1 (our runs)", fontsize=14)
    figure.savefig(path, dpi=110, metadata={"Software": None})
    plt.close(figure)


def error(results: Results, run: tuple[str, str, str], part: str, axis: str) -> float:
    """The largest error of a run (item, value, row) in a part of the table, m; NaN if lost."""
    result = results[*run, "torpedo" if part == "torpedo" else "operation"]
    return float("nan") if result is None else float(result["errors"][part][axis])


def _numbers(panel: Any, results: Results) -> None:
    table = [(item, value) for item, values in variations().items() for value in values]
    numbers = np.array(
        [
            [error(results, (item, value, row), part, axis) for row, part, axis in COLUMNS]
            for item, value in table
        ]
    )
    ratio = np.log10(numbers / numbers[0])
    panel.imshow(ratio, cmap="RdBu_r", vmin=-2.0, vmax=2.0, aspect="auto")
    for i, row in enumerate(numbers):
        for j, number in enumerate(row):
            text = "lost" if np.isnan(number) else _short(1e3 * number)
            dark = abs(ratio[i, j]) > 1.3
            panel.text(j, i, text, ha="center", va="center", fontsize=8, color="w" if dark else "k")
    panel.set_xticks(range(len(COLUMNS)), [f"{part}\n{axis}" for _, part, axis in COLUMNS])
    panel.set_yticks(range(len(table)), [f"{item}: {value}".strip(": ") for item, value in table])
    panel.tick_params(labelsize=8, top=True, labeltop=True, bottom=False, labelbottom=False)
    panel.axvline(5.5, color="k", linewidth=1.5)
    panel.set_title(
        "largest position error [mm]: STA (left half), PD (right half);\n"
        "red: larger than as declared, blue: smaller, full colour at a factor of 100"
    )


def _short(number: float) -> str:
    return f"{number:.3g}" if number >= 1e-3 else f"{number:.0e}"


def _oscillation(panel: Any, results: Results) -> None:
    for index, axis in enumerate("xy"):
        errors = [
            error(results, ("oscillation", f"{start:g}", "sta"), "torpedo", axis)
            for start in STARTS
        ]
        panel.loglog(
            1e3 * np.array(STARTS), 1e3 * np.array(errors), "ox"[index], label=f"ours, {axis}"
        )
        printed = 1e3 * PAPER["sta"]["torpedo"][axis]
        panel.axhline(printed, color=f"C{index}", linestyle=":", label=f"paper, {axis}")
    panel.set(
        xlabel=r"$|\hat\sigma(0)|$ [mm/s]",
        ylabel="settled error of the STA [mm]",
        title=r"a. the oscillation that $\alpha(0)$ = 0 leaves",
    )
    _finish(panel)


def _peaks(panel: Any, results: Results) -> None:
    filters = list(variations()["joint references"])
    keys = [("as declared", ""), *(("joint references", value) for value in filters)]
    names = ["stepped", *(value.replace("filter, ", "") for value in filters)]
    for row, marker in zip(ROWS, "os", strict=True):
        for index, axis in enumerate("xy"):
            peaks = [error(results, (*each, row), "operation", axis) for each in keys]
            panel.plot(
                1e3 * np.array(peaks),
                marker=marker,
                color=f"C{index}",
                linestyle="-" if row == "sta" else "--",
                label=f"{row} {axis}",
            )
            printed = 1e3 * PAPER[row]["operation"][axis]
            panel.plot([-0.25], [printed], marker=marker, color=f"C{index}", fillstyle="none")
    panel.set_xticks(range(len(names)), names)
    panel.set(
        yscale="log",
        xlabel="joint references: filter",
        ylabel="peak in operation mode [mm]",
        title="b. peaks at the shifts (hollow: the paper's)",
    )
    _finish(panel)


def _readings(panel: Any, results: Results) -> None:
    shown = [
        ("STA", "as declared", "", "sta"),
        ("STA, velocity\nmeasured", "velocity", "measured, (9)", "sta"),
        ("PD in N", "as declared", "", "pd"),
        ("PD in 1/s²", "PD", "in 1/s^2", "pd"),
        ("PD in (19)", "PD", "in (19)", "pd"),
    ]
    names = [name for name, *_ in shown]
    keys = [(item, value, row) for _, item, value, row in shown]
    place = np.arange(len(shown))
    for index, axis in enumerate("xy"):
        errors = [error(results, each, "operation", axis) for each in keys]
        panel.bar(place + 0.25 * index - 0.25, 1e3 * np.array(errors), 0.25, label=f"peak, {axis}")
    effort = [results[*each, "operation"]["thrust_effort"] for each in keys]
    panel.bar(place + 0.25, effort, 0.25, color="0.6", label="mean |thrust| [N]")
    panel.set_xticks(place, names)
    panel.tick_params(axis="x", labelsize=8)
    panel.set(yscale="log", ylabel="[mm], [N]", title="c. readings of the PD, operation mode")
    _finish(panel)


def _rates(panel: Any, results: Results) -> None:
    for number, name in enumerate(SENSORS_AND_THRUSTERS):
        for law in ("explicit", "implicit"):
            lead = [_lead(results, f"{law}, {name}, {period:g}") for period in PERIODS]
            panel.loglog(
                1e3 * np.array(PERIODS),
                lead,
                "o-" if law == "implicit" else "x--",
                color=f"C{number}",
                label=f"{name}, {law}",
            )
    panel.axhline(1.0, color="k", linewidth=0.8)
    panel.set(
        xlabel="control period [ms]",
        ylabel="settled error, STA over PD",
        title="d. the STA's lead (no mark: lost)",
    )
    _finish(panel)


def _lead(results: Results, value: str) -> float:
    sta, pd = (
        np.array([error(results, ("rate", value, row), "settled", axis) for axis in "xy"])
        for row in ROWS
    )
    return float(np.mean(sta / pd))


def _finish(panel: Any) -> None:
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8)
