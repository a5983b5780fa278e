"""The tables of a page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from usm_baselines.benchmark.leaderboard_page import said

from usm_cli.report.blocks import Cell, Column, Mark, Table
from usm_gym.statistics import interquartile_mean
from usm_gym.support.text import figures, mm
from usm_gym.task.scenario import Scenario

Row = Mapping[str, Any]
ERRORS = ("max_error_x", "max_error_y")
CONDITIONS = (
    "suite",
    "episodes",
    "mode",
    "control rate, Hz",
    "thruster lag, s",
    "thruster limit, N",
    "position noise, mm",
    "current up to, cm/s",
    "coefficients, true over nominal",
    "joint motion",
)
PARTS = ("torpedo", "operation", "settled")


def score_table(rows: Mapping[str, Row], refused: Mapping[str, str]) -> Table:
    """Scores of policies on the same scenarios, a row each."""
    scale = LogScale([row[name] for row in rows.values() for name in ERRORS])
    decided = any("beats_next" in row for row in rows.values())
    columns = [
        Column("policy"),
        Column("error x, mm"),
        Column("error y, mm"),
        Column("x and y on one scale, mm", scale.ticks),
        Column("middle half x"),
        Column("middle half y"),
        Column("worst x"),
        Column("worst y"),
        Column("thrust, N"),
        Column("variation, N/s"),
        Column("lost"),
        *([Column("beats the next")] if decided else []),
    ]
    body = []
    for name, row in rows.items():
        errors = [row[each] for each in ERRORS]
        halves = [float(interquartile_mean(row["per_episode"][each])) for each in ERRORS]
        cells = [Cell(name, name, "" if row["competitor"] else "no competitor")]
        cells += [Cell(mm(each["mean"]), each["mean"], interval(each)) for each in errors]
        cells.append(Cell("", sum(each["mean"] for each in errors), marks=scale.marks(row)))
        cells += [length(each) for each in halves]
        cells += [length(each["worst"]) for each in errors]
        for key in ("thrust_effort", "thrust_variation"):
            cells.append(Cell(figures(row[key]["mean"]), row[key]["mean"]))
        lost = row["failures"]
        cells.append(Cell(str(lost), lost, alarm=lost > 0))
        if decided:
            cells.append(decision(row.get("beats_next")))
        body.append(cells)
    return Table(columns, body, [f"{name} is refused: {why}" for name, why in refused.items()])


def curve_table(curves: Mapping[str, Sequence[Row]]) -> Table:
    """Mean errors at each value of a quantity, a row for each policy and axis."""
    values = [point["value"] for point in next(iter(curves.values()))]
    body = []
    for name, points in curves.items():
        for axis in "xy":
            cells = [Cell(f"{name}, {axis}", f"{name}, {axis}")]
            for point in points:
                if "refused" in point:
                    cells.append(Cell("refused", math.inf, alarm=True))
                else:
                    error = point[f"max_error_{axis}"]
                    cells.append(Cell(mm(error["mean"]), error["mean"], interval(error)))
            body.append(cells)
    notes = [
        f"{name} is refused at {point['value']:g}: {point['refused']}"
        for name, points in curves.items()
        for point in points
        if "refused" in point
    ]
    titles = [Column(f"at {value:g}") for value in values]
    return Table([Column("policy, axis"), *titles], body, notes)


def paper_table(rows: Mapping[str, Row], paper: Mapping[str, Row]) -> Table:
    """Our Table 1 beside the paper's."""
    columns = [Column("policy")]
    columns += [Column(f"{part} {axis}, mm") for part in PARTS for axis in "xy"]
    body = []
    for name, row in rows.items():
        cells = [Cell(name, name)]
        for part in PARTS:
            for axis in "xy":
                ours, detail = row[part][axis], ""
                if name in paper:
                    printed = paper[name][part][axis]
                    detail = f"paper {mm(printed)}, ratio {figures(ours / printed)}"
                cells.append(Cell(mm(ours), ours, detail))
        body.append(cells)
    return Table(columns, body)


def conditions_table(suites: Mapping[str, Sequence[Scenario]]) -> Table:
    """Under which conditions the episodes of each suite run, a row for each suite."""
    body = []
    for name, scenarios in suites.items():
        conditions = scenarios[0].conditions
        modes = ", ".join(sorted({each.mode for each in scenarios}))
        low, high = conditions.coefficient_range
        moving = any(each.shifts for each in scenarios)
        current = 100 * (conditions.current_limit + conditions.current_variation)
        cells = [Cell(name, name), Cell(str(len(scenarios)), len(scenarios)), Cell(modes, modes)]
        for value in (
            1.0 / conditions.control_period,
            conditions.thruster_time_constant,
            conditions.thruster_limit,
            1e3 * conditions.position_noise,
            current,
        ):
            cells.append(Cell(f"{value:g}", value))
        cells.append(Cell(f"{low:g} to {high:g}", high - low))
        cells.append(Cell("yes" if moving else "none", float(moving)))
        body.append(cells)
    return Table([Column(title) for title in CONDITIONS], body)


class LogScale:
    """A logarithmic scale on which all errors of a table have their place.

    Attributes:
        ticks: Decades in mm, and where they are, per cent.
    """

    def __init__(self, errors: Sequence[Row]) -> None:
        """Span means, intervals and worst episodes, m."""
        positive = [each for error in errors for each in _numbers(error) if each > 0] or [1e-3]
        self._low = math.log10(min(positive)) - 0.1
        self._width = math.log10(max(positive)) + 0.1 - self._low
        decades = range(math.ceil(self._low), math.floor(self._low + self._width) + 1)
        self.ticks = [(f"{10.0 ** (power + 3):g}", self._place(10.0**power)) for power in decades]

    def marks(self, row: Row) -> dict[str, Mark]:
        """Where a row's errors are, by axis."""
        places = {name[-1]: map(self._place, _numbers(row[name])) for name in ERRORS}
        return {axis: Mark(*each) for axis, each in places.items()}

    def _place(self, metres: float) -> float:
        power = math.log10(metres) if metres > 0 else self._low
        return round(100 * (power - self._low) / self._width, 2)


def interval(score: Row) -> str:
    """The 95 % interval of a length, mm."""
    low, high = score["ci95"]
    return f"[{mm(low)}, {mm(high)}]"


def length(metres: float) -> Cell:
    """A length in mm."""
    return Cell(mm(metres), metres)


def decision(beats: Row | None) -> Cell:
    """Whether a row is better than the next, and with what probability in an episode."""
    if beats is None:
        return Cell("", -1.0)
    return Cell(said(beats), beats["probability"], f"{beats['probability']:.2f}")


def _numbers(error: Row) -> tuple[float, float, float, float]:
    low, high = error["ci95"]
    return low, error["mean"], high, error["worst"]
