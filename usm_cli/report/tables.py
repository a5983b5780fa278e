"""Makes the tables of a page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from usm_baselines.benchmark.leaderboard_page import rank_labels
from usm_baselines.benchmark.results import (
    CompetitorScores,
    Scores,
    Summary,
    attitude_in,
    axes_in,
    lost,
    medians_in,
    rms_in,
)
from usm_baselines.benchmark.robustness import RefusedPoint, RobustnessResult
from usm_baselines.benchmark.verdict import choices
from usm_baselines.paper.reproduction import PARTS, ReproductionResult

from usm_cli.report.blocks import Cell, Column, Mark, Rivals, SortableTable
from usm_cli.score_table import combined_error
from usm_gym.statistics import FEWEST_EPISODES, told_apart
from usm_gym.support.text import degrees, figures, mm
from usm_gym.task.head_scenario import HeadEpisode
from usm_gym.task.modes import AnyScenario

Row = TypeVar("Row", bound=Scores)
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
# The scale of the errors of a table covers so many decades; a label closer to an end of it than
# this, per cent, is left out.
DECADES, EDGE = 2.0, 6.0


def competes(row: Scores) -> bool:
    """Whether a policy knows no more than a vehicle does."""
    return row.competitor if isinstance(row, CompetitorScores) else True


def by_objective(rows: Mapping[str, Row]) -> dict[str, Row]:
    """Sort rows: competitors first, the smaller objective first."""
    return dict(sorted(rows.items(), key=lambda pair: (not competes(pair[1]), pair[1].objective)))


def remark(row: Scores) -> str:
    """What is said below a policy's name."""
    note = row.note if isinstance(row, CompetitorScores) else ""
    return note if competes(row) else "no competitor"


def score_table(rows: Mapping[str, Scores], refused: Mapping[str, str]) -> SortableTable:
    """Scores of policies on the same scenarios, one row per policy, best first."""
    scale = LogScale(rows.values())
    axes = axes_in(rows.values())
    ranked = {id: row for id, row in rows.items() if isinstance(row, CompetitorScores)}
    places, each = rank_labels(ranked), ", ".join(axes)
    medians = medians_in(rows.values())
    columns = [
        Column("rank, policy"),
        Column("objective, mm"),
        Column(f"error {' + '.join(axes)}, mm"),
        Column(f"{each} on one scale, mm" if axes else "error", scale.ticks, axes),
        Column(f"{each}, mm"),
        *([Column(f"median {each}")] if medians else []),
        Column(f"worst {each}"),
        *([Column(f"rms {each}")] if rms_in(rows.values()) else []),
        *(Column(f"{angle}, °") for angle in attitude_in(rows.values())),
        Column("variation, N/s"),
        Column("lost"),
        *([Column("told", words=True)] if ranked else []),
    ]
    body = []
    for place, (name, row) in enumerate(rows.items()):
        errors = row.errors
        cells = [Cell(name, place, remark(row), rank=places.get(name))]
        cells += [Cell(figures(row.objective), row.objective), combined(row)]
        cells.append(Cell("", row.objective, marks=scale.marks(errors)))
        cells.append(joint([error.mean for error in errors.values()]))
        cells += [joint(list(row.medians.values()))] if medians else []
        cells.append(joint([error.worst for error in errors.values()]))
        cells += [joint([error.mean for error in row.rms.values()])] if row.rms else []
        cells += [Cell(degrees(e.mean), e.mean) for e in row.attitude.values()]
        variation = row.metrics["thrust_variation"].mean
        cells.append(Cell(figures(variation), variation))
        share = lost(row, bool(medians)).replace(" (", "\n(")
        cells.append(Cell(share, row.failures, alarm=row.failures > 0))
        cells += [Cell(ranked[name].told, ranked[name].told)] if name in ranked else []
        body.append(cells)
    notes = [f"{name} is refused: {why}" for name, why in refused.items()]
    return SortableTable(columns, body, notes, rivals(ranked) if len(ranked) > 1 else None)


def verdict_table(rows: Mapping[str, CompetitorScores]) -> SortableTable:
    """The policies to choose from, and what each is the best of."""
    places = rank_labels(rows)
    body = [
        [
            Cell(name, place, rank=places[name]),
            Cell(", ".join(reasons), reasons[0]),
            Cell(combined_error(rows[name]), rows[name].combined[0]),
            Cell(figures(variation := rows[name].metrics["thrust_variation"].mean), variation),
        ]
        for place, (name, reasons) in enumerate(choices(rows).items())
    ]
    error = f"error {' + '.join(axes_in(rows.values()))}, mm"
    columns = [Column("rank, policy"), Column("why", words=True), Column(error)]
    return SortableTable([*columns, Column("variation, N/s")], body)


def rivals(rows: Mapping[str, CompetitorScores]) -> Rivals:
    """What policies are to one another; rows: competitors first, best first."""
    objectives = np.array([row.objectives for row in rows.values()])
    apart, means = told_apart(objectives), objectives.mean(axis=-1)
    better = 0.5 - 0.5 * np.sign(objectives[:, None] - objectives[None])
    few = objectives.shape[1] < FEWEST_EPISODES
    verdicts = [
        "".join(
            "f" if few else "u" if not told else "y" if mean < rival else "n"
            for rival, told in zip(means, decided, strict=True)
        )
        for mean, decided in zip(means, apart, strict=True)
    ]
    chances = np.rint(100 * better.mean(axis=-1)).astype(int).tolist()
    return Rivals(list(rows), sum(map(competes, rows.values())), verdicts, chances)


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


def conditions_table(suites: Mapping[str, Sequence[AnyScenario]]) -> SortableTable:
    """The conditions of the episodes of suites, one row per suite."""
    body = []
    for name, scenarios in suites.items():
        conditions = scenarios[0].conditions
        modes = ", ".join(sorted({scenario.mode for scenario in scenarios}))
        low, high = conditions.coefficient_range
        moving = any(scenario.shifts for scenario in scenarios)
        steered = isinstance(scenarios[0], HeadEpisode)
        motion = "the policy's" if steered else "yes" if moving else "none"
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
        cells.append(Cell(motion, float(moving or steered)))
        body.append(cells)
    return SortableTable([Column(title) for title in CONDITIONS], body)


class LogScale:
    """A logarithmic scale for the errors of a table, from the best competitor's on.

    Attributes:
        ticks: Labels in mm and their places, per cent.
    """

    def __init__(self, rows: Iterable[Scores]) -> None:
        """Begin below the smallest error of a competitor that loses no robot."""
        every = list(rows)
        able = [row for row in every if competes(row) and not row.failures] or every
        lows = [error.ci95[0] for row in able for error in row.errors.values()]
        self._low = math.log10(0.8 * min([low for low in lows if low > 0] or [1e-3]))
        powers = range(math.floor(self._low), math.ceil(self._low + DECADES) + 1)
        marks = [digit * 10.0**power for power in powers for digit in (1, 3)]
        places = [(f"{1e3 * mark:g}", self._place(mark)) for mark in marks]
        self.ticks = [tick for tick in places if EDGE < tick[1] < 100 - EDGE]

    def marks(self, errors: Mapping[str, Summary]) -> dict[str, Mark]:
        """The places of errors, by axis."""
        return {axis: self._mark(error) for axis, error in errors.items()}

    def _mark(self, error: Summary) -> Mark:
        low, high = error.ci95
        mean = self._place(error.mean)
        beyond = "‹" if mean < 0 else "›" if mean > 100 else ""
        places = (self._place(at) for at in (low, error.mean, high, error.worst))
        seen = [min(max(place, 0.0), 100.0) for place in places]
        return Mark(seen[0], seen[1], seen[2], seen[3], beyond)

    def _place(self, metres: float) -> float:
        power = math.log10(metres) if metres > 0 else -math.inf
        return round(100 * (power - self._low) / DECADES, 2)


def combined(row: Scores) -> Cell:
    """The largest errors of all axes added up, mm, and below it half of its interval."""
    return Cell(combined_error(row).replace(" ±", "\n±"), row.combined[0])


def joint(lengths: Sequence[float]) -> Cell:
    """Lengths, m, one below the other in mm."""
    return Cell("\n".join(map(mm, lengths)), sum(lengths))


def interval(error: Summary) -> str:
    """The 95 % interval of a length, mm."""
    low, high = error.ci95
    return f"[{mm(low)}, {mm(high)}]"
