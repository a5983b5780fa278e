"""Scores on the terminal: who is best, by how much, and how sure that is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console, JustifyMethod
from rich.table import Table
from rich.text import Text
from usm_baselines.benchmark.leaderboard import Standing, ranks
from usm_baselines.benchmark.leaderboard_page import MARK, rank_labels
from usm_baselines.benchmark.results import (
    CompetitorScores,
    Scores,
    attitude_in,
    axes_in,
    lost,
    medians_in,
    over_informed,
    prices,
    rms_in,
    shifts_in,
)

from usm_cli.terminal import empty_table
from usm_gym.statistics import FEWEST_EPISODES, ratio_interval
from usm_gym.support.text import counted, degrees, figures, give_or_take, listed, mm
from usm_gym.task.loss import LOST_ERROR

LEGEND = """\
error: largest position error after settling, {axes} added up, mean ± half of its 95 % interval; \
N/s: how much the thrust varies; lost: robots, each of which counts {loss} mm or more. \
Order: the objective, which is the error plus {prices}. \
Rows share a rank (=) until the data tell one from the first of them."""
UNRANKED = "Rows without a rank are no competitors: they are told more than a vehicle knows."
# What a lost robot counts at least, mm.
LOSS = round(1e3 * LOST_ERROR)
# The column that is never cut.
POLICY = "policy"
# Wider than any table.
WIDEST = 10_000
# More names than these are not spelled out in a sentence.
FEW = 4


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        heading: Its heading, in one line or two.
        cells: What it says of each row.
        place: Columns are shown in this order, as far as there is room; those of 0 always.
        words: Whether it holds words and not numbers.
    """

    heading: str
    cells: Sequence[str | Text]
    place: int = 0
    words: bool = False


def table(rows: Mapping[str, Standing], console: Console) -> Table:
    """The scores, best first, in as many columns as the console has room for."""
    places = list(ranks(rows).values())
    alone = places.count(1) < len(rows)
    styles = ["dim" if rank is None else "bold" if rank == 1 and alone else "" for rank in places]
    return _fitted(columns_of(rows), console, styles)


def columns_of(rows: Mapping[str, Standing]) -> list[Column]:
    """All columns from left to right."""
    every = list(rows.values())
    axes, medians, ratios = axes_in(every), medians_in(every), over_informed(rows)
    joint = " / ".join(axes)

    def each(write: Any) -> list[str]:
        return [write(row) for row in every]

    found = [Column("", list(rank_labels(rows).values())), _names(rows)]
    found.append(Column(f"error {' + '.join(axes)}\nmm", each(combined_error)))
    found += [
        Column(f"{axis}\nmm", each(lambda row, axis=axis: _mean(row.errors[axis])), 4)
        for axis in axes
    ]
    if medians:
        found.append(Column(f"median\n{joint}", each(lambda row: _joint(row.medians.values())), 1))
    found.append(
        Column(f"worst\n{joint}", each(lambda row: _joint(e.worst for e in row.errors.values())), 6)
    )
    if rms_in(every):
        found.append(
            Column(f"rms\n{joint}", each(lambda row: _joint(e.mean for e in row.rms.values())), 7)
        )
    found += [
        Column(f"{angle}\n°", each(lambda row, angle=angle: degrees(row.attitude[angle].mean)), 2)
        for angle in attitude_in(every)
    ]
    found.append(Column("N/s", each(lambda row: figures(row.metrics["thrust_variation"].mean))))
    found.append(Column("objective\nmm", each(lambda row: figures(row.objective)), 3))
    if ratios:
        found.append(Column("over\ninformed", list(ratios.values()), 5))
    losses = [Text(lost(row, bool(medians)), "red" if row.failures else "") for row in every]
    found.append(Column("lost", losses))
    return [*found, Column("told", each(lambda row: row.told), 8, words=True)]


def legend(rows: Mapping[str, Standing]) -> str:
    """What the columns mean that every table has, and notes on rows."""
    said = LEGEND.format(
        axes=listed(axes_in(rows.values())),
        loss=LOSS,
        prices=prices(attitude_in(rows.values())),
    )
    parts = [said] if all(row.competitor for row in rows.values()) else [said, UNRANKED]
    notes = sorted({row.note for row in rows.values() if row.note})
    return "\n".join([*parts, *(f"{MARK} {note}" for note in notes)])


def combined_error(row: Scores) -> str:
    """The largest errors of all axes added up, mm, with half the width of its interval."""
    mean, margin = row.combined
    return give_or_take(1e3 * mean, 1e3 * margin)


def conclusion(rows: Mapping[str, CompetitorScores]) -> str:
    """Who wins, by how much, and how sure that is, in a sentence; rows: best first."""
    competing = [name for name, row in rows.items() if row.competitor]
    if not competing:
        return "None of these policies competes."
    first, *others = competing
    best, episodes = rows[first], rows[first].episodes
    if not others:
        return (
            f"{first} has an error of {combined_error(best)} mm over "
            f"{counted(episodes, 'scenario')}; name a second policy to compare it with."
        )
    if episodes < FEWEST_EPISODES:
        return (
            f"{first} is ahead with an error of {combined_error(best)} mm, but "
            f"{counted(episodes, 'scenario')} cannot say who wins; it takes {FEWEST_EPISODES}."
        )
    # By the rule of ranks, the data tell a row from the first unless it shares its rank.
    places = ranks(rows)
    tied = [name for name in others if places[name] == places[first]]
    beaten = [name for name in others if name not in tied]
    open_ = f"the data do not tell it from {_some(tied)}" if tied else ""
    if not beaten:
        return f"{first} is ahead over {episodes} scenarios, but {open_}."
    second = beaten[0]
    behind, ahead = rows[second].objectives, best.objectives
    ratio = behind.mean() / ahead.mean()
    low, high = ratio_interval(behind, ahead)
    lead = (
        f"is {figures(ratio)} times as large (95 % interval {figures(low)} to {figures(high)}), "
        f"over {episodes} scenarios."
    )
    error = f"an error of {combined_error(best)} mm"
    if tied:
        return (
            f"{first} is ahead with {error}, but {open_}; the objective of {second}, the next from "
            f"which they do, {lead}"
        )
    return f"{first} wins with {error}: the objective of {second}, the next, {lead}"


def shift_table(rows: Mapping[str, Scores], console: Console) -> Table:
    """The errors by shift, mm, of as many shifts as the console has room for."""
    columns = [_names(rows)]
    for shift in shifts_in(rows.values()):
        errors = (row.by_shift[shift].values() for row in rows.values())
        cells = [_joint(error.mean for error in each) for each in errors]
        columns.append(Column(shift, cells, 0 if shift in ("first", "last") else 1))
    axes = " / ".join(axes_in(rows.values()))
    title = f"largest position error from a shift to the next, mm, {axes}, mean"
    return _fitted(columns, console, title=title)


def _fitted(
    columns: Sequence[Column],
    console: Console,
    styles: Sequence[str] | None = None,
    title: str | None = None,
) -> Table:
    """A table of as many columns as there is room for, with a style for each row."""
    unbounded = console.options.update_width(WIDEST)

    def drawn(places: set[int]) -> Table:
        made = empty_table(title=title)
        shown = [column for column in columns if column.place in places]
        for column in shown:
            justify: JustifyMethod = "left" if column.words else "right"
            # Of a name that is too long, the rest stands below.
            fold = column.heading == POLICY
            made.add_column(column.heading, justify=justify, no_wrap=not fold, overflow="fold")
        cells = zip(*(column.cells for column in shown), strict=True)
        for index, row in enumerate(cells):
            made.add_row(
                *(Text(cell) if isinstance(cell, str) else cell for cell in row),
                style=styles[index] if styles else "",
            )
        return made

    places = {0}
    for place in sorted({column.place for column in columns} - places):
        if console.measure(drawn({*places, place}), options=unbounded).maximum <= console.width:
            places.add(place)
    return drawn(places)


def _names(rows: Mapping[str, Scores]) -> Column:
    notes = (getattr(row, "note", "") for row in rows.values())
    names = [f"{name} {MARK}" if note else name for name, note in zip(rows, notes, strict=True)]
    return Column(POLICY, names, words=True)


def _some(names: Sequence[str]) -> str:
    return listed(names) if len(names) <= FEW else f"{len(names)} others"


def _joint(errors: Iterable[float]) -> str:
    return " / ".join(map(mm, errors))


def _mean(error: Any) -> str:
    low, high = error.ci95
    return f"{mm(error.mean)} [{mm(low)}, {mm(high)}]"
