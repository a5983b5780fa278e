"""Makes the tables of a page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from usm_baselines.benchmark.leaderboard import Lead, Standing
from usm_baselines.benchmark.leaderboard_page import in_short
from usm_baselines.benchmark.results import (
    CompetitorScores,
    Scores,
    Summary,
    attitude_in,
    axes_in,
    rms_in,
)
from usm_baselines.benchmark.robustness import RefusedPoint, RobustnessResult
from usm_baselines.paper.reproduction import PARTS, ReproductionResult

from usm_cli.report.blocks import Cell, Column, Mark, SortableTable
from usm_gym.statistics import interquartile_mean
from usm_gym.support.text import degrees, figures, listed, mm
from usm_gym.task.metrics import MAX_ERROR
from usm_gym.task.scenario import Scenario

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


def competes(row: Scores) -> bool:
    """Whether a policy knows no more than a vehicle does."""
    return row.competitor if isinstance(row, CompetitorScores) else True


def remark(row: Scores) -> str:
    """What is said below a policy's name."""
    note = row.note if isinstance(row, CompetitorScores) else ""
    return note if competes(row) else "no competitor"


def lead_of(row: Scores) -> Lead | None:
    """A row's lead over the next row, if it has one."""
    return row.beats_next if isinstance(row, Standing) else None


def score_table(rows: Mapping[str, Scores], refused: Mapping[str, str]) -> SortableTable:
    """Scores of policies on the same scenarios, one row per policy."""
    scale = LogScale(error for row in rows.values() for error in row.errors.values())
    decided = any(lead_of(row) for row in rows.values())
    axes = axes_in(rows.values())
    columns = [
        Column("policy"),
        Column("told"),
        Column("objective, mm"),
        *(Column(f"error {axis}, mm") for axis in axes),
        Column(f"{listed(axes)} on one scale, mm" if axes else "error", scale.ticks, axes),
        *(Column(f"middle half {axis}") for axis in axes),
        *(Column(f"worst {axis}") for axis in axes),
        *(Column(f"rms {axis}") for axis in rms_in(rows.values())),
        *(Column(f"{angle}, °") for angle in attitude_in(rows.values())),
        Column("thrust, N"),
        Column("variation, N/s"),
        Column("lost"),
        *([Column("beats the next")] if decided else []),
    ]
    body = []
    for name, row in rows.items():
        errors = row.errors
        halves = [interquartile_mean(row.per_episode[MAX_ERROR + axis]) for axis in axes]
        told = row.told if isinstance(row, CompetitorScores) else ""
        cells = [Cell(name, name, remark(row)), Cell(told, told)]
        cells.append(Cell(figures(row.objective), row.objective))
        cells += [Cell(mm(e.mean), e.mean, interval(e)) for e in errors.values()]
        cells.append(Cell("", row.objective, marks=scale.marks(errors)))
        cells += [length(float(half)) for half in halves]
        cells += [length(error.worst) for error in errors.values()]
        cells += [length(error.mean) for error in row.rms.values()]
        cells += [Cell(degrees(e.mean), e.mean) for e in row.attitude.values()]
        for key in ("thrust_effort", "thrust_variation"):
            mean = row.metrics[key].mean
            cells.append(Cell(figures(mean), mean))
        cells.append(Cell(str(row.failures), row.failures, alarm=row.failures > 0))
        if decided:
            cells.append(decision(lead_of(row)))
        body.append(cells)
    return SortableTable(
        columns, body, [f"{name} is refused: {why}" for name, why in refused.items()]
    )


def curve_table(result: RobustnessResult) -> SortableTable:
    """Mean errors at all values of a quantity, one row per policy and axis."""
    body = []
    notes = []
    for name, points in result.results.items():
        for axis in result.axes:
            cells = [Cell(f"{name}, {axis}", f"{name}, {axis}")]
            for point in points:
                if isinstance(point, RefusedPoint):
                    cells.append(Cell("refused", math.inf, alarm=True))
                else:
                    error = point.errors[axis]
                    cells.append(Cell(mm(error.mean), error.mean, interval(error)))
            body.append(cells)
        notes += [
            f"{name} is refused at {point.value:g}: {point.refused}"
            for point in points
            if isinstance(point, RefusedPoint)
        ]
    titles = [Column(f"at {value:g}") for value in result.values]
    return SortableTable([Column("policy, axis"), *titles], body, notes)


def paper_table(result: ReproductionResult) -> SortableTable:
    """Our Table 1 beside the paper's."""
    places = [(part, axis) for part in PARTS for axis in result.axes]
    columns = [Column("policy"), *(Column(f"{part} {axis}, mm") for part, axis in places)]
    body = []
    for name, row in result.rows.items():
        cells = [Cell(name, name)]
        for part, axis in places:
            ours, detail = row[part][axis], ""
            if errors := result.printed(name):
                printed = errors[part][axis]
                detail = f"paper {mm(printed)}, ratio {figures(ours / printed)}"
            cells.append(Cell(mm(ours), ours, detail))
        body.append(cells)
    return SortableTable(columns, body)


def conditions_table(suites: Mapping[str, Sequence[Scenario]]) -> SortableTable:
    """The conditions of the episodes of suites, one row per suite."""
    body = []
    for name, scenarios in suites.items():
        conditions = scenarios[0].conditions
        modes = ", ".join(sorted({scenario.mode for scenario in scenarios}))
        low, high = conditions.coefficient_range
        moving = any(scenario.shifts for scenario in scenarios)
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
    return SortableTable([Column(title) for title in CONDITIONS], body)


class LogScale:
    """A logarithmic scale for all errors of a table.

    Attributes:
        ticks: Decades in mm and their places, per cent.
    """

    def __init__(self, errors: Iterable[Summary]) -> None:
        """Span means, intervals and worst episodes, m."""
        numbers = [number for error in errors for number in _numbers(error)]
        positive = [number for number in numbers if number > 0] or [1e-3]
        self._low = math.log10(min(positive)) - 0.1
        self._width = math.log10(max(positive)) + 0.1 - self._low
        decades = range(math.ceil(self._low), math.floor(self._low + self._width) + 1)
        self.ticks = [(f"{10.0 ** (power + 3):g}", self._place(10.0**power)) for power in decades]

    def marks(self, errors: Mapping[str, Summary]) -> dict[str, Mark]:
        """The places of errors, by axis."""
        return {axis: Mark(*map(self._place, _numbers(error))) for axis, error in errors.items()}

    def _place(self, metres: float) -> float:
        power = math.log10(metres) if metres > 0 else self._low
        return round(100 * (power - self._low) / self._width, 2)


def interval(error: Summary) -> str:
    """The 95 % interval of a length, mm."""
    low, high = error.ci95
    return f"[{mm(low)}, {mm(high)}]"


def length(metres: float) -> Cell:
    """A length in mm."""
    return Cell(mm(metres), metres)


def decision(lead: Lead | None) -> Cell:
    """Whether a row is better than the next, and with what probability per episode."""
    if lead is None:
        return Cell("", -1.0)
    return Cell(in_short(lead), lead.probability, f"{lead.probability:.2f}")


def _numbers(error: Summary) -> tuple[float, float, float, float]:
    low, high = error.ci95
    return low, error.mean, high, error.worst
