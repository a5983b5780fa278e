"""The page of figures of the sensitivity study (needs the extra `render`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from usm_baselines.paper.reproduction import PAPER, PARTS
from usm_baselines.paper.reproduction_figures import CYCLE
from usm_baselines.paper.sensitivity import (
    PERIODS,
    ROWS,
    SENSORS_AND_THRUSTERS,
    STARTS,
    variations,
)
from usm_baselines.paper.sensitivity_result import Outcome, SensitivityResult
from usm_gym.rendering.plots import plotting, save

MARKERS = "oxs^"


def draw_study(study: SensitivityResult, path: Path) -> None:
    """Draw the page.

    Args:
        study: The study.
        path: Where to write PNG and SVG; it lacks the ending.
    """
    from matplotlib import pyplot as plt

    sheet = Sheet(study)
    with plotting(**CYCLE):
        figure = plt.figure(figsize=(20, 13), layout="constrained")
        grid = figure.add_gridspec(2, 4, width_ratios=(1.25, 1.25, 1, 1))
        sheet.numbers(figure.add_subplot(grid[:, :2]))
        sheet.oscillation(figure.add_subplot(grid[0, 2]))
        sheet.peaks(figure.add_subplot(grid[0, 3]))
        sheet.readings(figure.add_subplot(grid[1, 2]))
        sheet.rates(figure.add_subplot(grid[1, 3]))
        figure.suptitle(
            "What the open items of the paper do to its Table 1 (our runs)", fontsize=14
        )
        save(figure, path)


class Sheet:
    """The panels of the page, drawn into axes of matplotlib."""

    def __init__(self, study: SensitivityResult) -> None:
        """Draw a study."""
        self._axes = study.axes
        self._outcomes: dict[tuple[str, str, str, str], Outcome | None] = {
            (run.item, run.value, run.row, run.mode): run.result for run in study.runs
        }

    def error(self, run: tuple[str, str, str], part: str, axis: str) -> float:
        """The largest error of a run (item, value, row) in a part of the table, m; NaN if lost."""
        outcome = self._outcomes[*run, PARTS[part]]
        return float("nan") if outcome is None else outcome.errors[part][axis]

    def numbers(self, panel: Any) -> None:
        """All numbers of the table under all variations."""
        columns = [(row, part, axis) for row in ROWS for part in PARTS for axis in self._axes]
        table = [(item, value) for item, values in variations().items() for value in values]
        numbers = np.array(
            [
                [self.error((item, value, row), part, axis) for row, part, axis in columns]
                for item, value in table
            ]
        )
        ratio = np.log10(numbers / numbers[0])
        panel.imshow(ratio, cmap="RdBu_r", vmin=-2.0, vmax=2.0, aspect="auto")
        for (i, j), number in np.ndenumerate(numbers):
            text = "lost" if np.isnan(number) else _short(1e3 * number)
            color = "w" if abs(ratio[i, j]) > 1.3 else "k"
            panel.text(j, i, text, ha="center", va="center", fontsize=8, color=color)
        panel.set_xticks(range(len(columns)), [f"{part}\n{axis}" for _, part, axis in columns])
        names = [f"{item}: {value}".strip(": ") for item, value in table]
        panel.set_yticks(range(len(table)), names)
        panel.tick_params(labelsize=8, top=True, labeltop=True, bottom=False, labelbottom=False)
        panel.axvline(len(columns) / len(ROWS) - 0.5, color="k", linewidth=1.5)
        panel.set_title(
            "largest position error [mm]: STA (left half), PD (right half);\n"
            "red: larger than as declared, blue: smaller, full colour at a factor of 100"
        )

    def oscillation(self, panel: Any) -> None:
        """The settled error of the STA against where its sliding variable starts."""
        for index, axis in enumerate(self._axes):
            errors = [
                self.error(("oscillation", f"{start:g}", "sta"), "torpedo", axis)
                for start in STARTS
            ]
            places, marker = 1e3 * np.array(STARTS), MARKERS[index % len(MARKERS)]
            panel.loglog(places, 1e3 * np.array(errors), marker, label=f"ours, {axis}")
            printed = 1e3 * PAPER["sta"]["torpedo"][axis]
            panel.axhline(printed, color=f"C{index}", linestyle=":", label=f"paper, {axis}")
        panel.set(
            xlabel=r"$|\hat\sigma(0)|$ [mm/s]",
            ylabel="settled error of the STA [mm]",
            title=r"a. the oscillation that $\alpha(0)$ = 0 leaves",
        )
        _finish(panel)

    def peaks(self, panel: Any) -> None:
        """The peaks in operation mode against the filter of the joint references."""
        filters = list(variations()["joint references"])
        keys = [("as declared", ""), *(("joint references", value) for value in filters)]
        names = ["stepped", *(value.replace("filter, ", "") for value in filters)]
        for row, marker in zip(ROWS, "os", strict=True):
            for index, axis in enumerate(self._axes):
                errors = [self.error((*key, row), "operation", axis) for key in keys]
                panel.plot(
                    1e3 * np.array(errors),
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

    def readings(self, panel: Any) -> None:
        """Errors and thrust under the readings of the PD controller."""
        shown = [
            ("STA", "as declared", "", "sta"),
            ("STA, velocity\nmeasured", "velocity", "measured, (9)", "sta"),
            ("PD in N", "as declared", "", "pd"),
            ("PD in 1/s²", "PD", "in 1/s^2", "pd"),
            ("PD in (19)", "PD", "in (19)", "pd"),
        ]
        names = [name for name, *_ in shown]
        runs = [(item, value, row) for _, item, value, row in shown]
        place = np.arange(len(shown))
        count = len(self._axes)
        width = 0.75 / (count + 1)
        left = place - width * count / 2
        for index, axis in enumerate(self._axes):
            errors = 1e3 * np.array([self.error(run, "operation", axis) for run in runs])
            panel.bar(left + width * index, errors, width, label=f"peak, {axis}")
        outcomes = [self._outcomes[*run, "operation"] for run in runs]
        effort = [np.nan if outcome is None else outcome.thrust_effort for outcome in outcomes]
        panel.bar(left + width * count, effort, width, color="0.6", label="mean |thrust| [N]")
        panel.set_xticks(place, names)
        panel.tick_params(axis="x", labelsize=8)
        panel.set(yscale="log", ylabel="[mm], [N]", title="c. readings of the PD, operation mode")
        _finish(panel)

    def rates(self, panel: Any) -> None:
        """The lead of the STA over the PD controller against the control period."""
        for number, name in enumerate(SENSORS_AND_THRUSTERS):
            for law in ("explicit", "implicit"):
                lead = [self.lead(f"{law}, {name}, {period:g}") for period in PERIODS]
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

    def lead(self, value: str) -> float:
        """The settled error of the STA over that of the PD controller, mean of the axes."""
        sta, pd = (
            np.array([self.error(("rate", value, row), "settled", axis) for axis in self._axes])
            for row in ROWS
        )
        return float(np.mean(sta / pd))


def _short(number: float) -> str:
    return f"{number:.3g}" if number >= 1e-3 else f"{number:.0e}"


def _finish(panel: Any) -> None:
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8)
