"""What a page is made of, as plain data, drawn by one template per kind of block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True)
class Mark:
    """An interval on the scale of its column, in per cent of the width.

    Attributes:
        low: Lower limit of the 95 % interval.
        mean: Mean.
        high: Upper limit.
        worst: Worst episode.
    """

    low: float
    mean: float
    high: float
    worst: float


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Attributes:
        text: What is written.
        value: What rows are sorted by.
        detail: Written smaller behind it, such as an interval.
        marks: Intervals to be drawn in place of the text, by their axis.
        alarm: Whether it is bad news.
    """

    text: str
    value: float | str
    detail: str = ""
    marks: Mapping[str, Mark] | None = None
    alarm: bool = False


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        title: What it holds, with the unit.
        ticks: Labels of the scale on which marks are drawn, and where, per cent of the width.
        marked: The axes whose marks it has, in order.
    """

    title: str
    ticks: Sequence[tuple[str, float]] = ()
    marked: Sequence[str] = ()


@dataclass(frozen=True)
class SortableTable:
    """A table whose columns sort; the first cell of a row names it."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Tables:
    """Tables of the same kind, one of them shown at a time.

    Attributes:
        title: Heading.
        lead: What there is to see, in a sentence or two.
        label: What they differ in.
        tables: The tables by name.
    """

    template: ClassVar[str] = "tables.html"
    title: str
    lead: str
    label: str
    tables: Mapping[str, SortableTable]


@dataclass(frozen=True)
class Plot:
    """Panels side by side.

    Attributes:
        title: Heading.
        lead: What there is to see.
        data: What `plots.js` draws: `kind` ("points" or "curves"), `x` (`label`, `log`), `y`
            (`log`), and `panels`, which have `label` and `points`, `lines` or `series`.
    """

    template: ClassVar[str] = "plot.html"
    title: str
    lead: str
    data: Mapping[str, Any]


@dataclass(frozen=True)
class Replay:
    """An episode of several policies, to be played.

    Attributes:
        title: Heading.
        lead: The scenario in words.
        data: What `replay.js` plays (`usm_cli.report.replay`).
        first: The two policies that are shown at first.
        notes: What to know about the replay.
    """

    template: ClassVar[str] = "replay.html"
    title: str
    lead: str
    data: Mapping[str, Any]
    first: tuple[str, str]
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Facts:
    """Terms and what they are."""

    template: ClassVar[str] = "facts.html"
    title: str
    facts: Mapping[str, str]


@dataclass(frozen=True)
class Chapter:
    """All of one result.

    Attributes:
        title: Heading.
        lead: What it is, in a sentence.
        motion: What the joint motion does to the error, if the result tells; for the page's head.
        verdict: Which controller copes; for the page's head.
        blocks: What is shown, in order.
    """

    title: str
    lead: str
    motion: str
    verdict: str
    blocks: Sequence[Tables | Plot | Replay | Facts]
