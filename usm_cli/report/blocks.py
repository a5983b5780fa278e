"""The blocks of a page, as plain data; the template of a block draws it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from usm_gym.manipulator import Manipulator
from usm_gym.robots import AnyRobot


@dataclass(frozen=True)
class Mark:
    """An interval on the scale of its column, in per cent of the width.

    Attributes:
        low: Lower limit of the 95 % interval.
        mean: Mean.
        high: Upper limit.
        worst: Worst episode.
        beyond: "‹" or "›" where the mean is beyond that end of the scale; empty if it is not.
    """

    low: float
    mean: float
    high: float
    worst: float
    beyond: str = ""


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Attributes:
        text: The text.
        value: The value by which rows are sorted.
        detail: Smaller text below it, such as an interval.
        rank: The rank before the name of a policy; None in tables without ranks.
        marks: Intervals to draw instead of the text, by axis.
        alarm: Whether it is bad news.
    """

    text: str
    value: float | str
    detail: str = ""
    marks: Mapping[str, Mark] | None = None
    alarm: bool = False
    rank: str | None = None


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        title: Its content, with the unit.
        ticks: Labels of the scale of the marks and their places, per cent of the width.
        marked: The axes of its marks, in order.
        words: Whether it holds words and not numbers.
    """

    title: str
    ticks: Sequence[tuple[str, float]] = ()
    marked: Sequence[str] = ()
    words: bool = False


@dataclass(frozen=True)
class Rivals:
    """What each row of a table is to every other: a last column shows it, for the rival chosen.

    Attributes:
        names: The rows in their order.
        competing: How many of them compete; they come first.
        verdicts: A letter for every rival, one text per row: whether the row beats it, "y", "n",
            "u" where the data do not decide, "f" where there are too few episodes.
        chances: In how many per cent of the episodes the row does better, (rows, rows).
    """

    names: Sequence[str]
    competing: int
    verdicts: Sequence[str]
    chances: Sequence[Sequence[int]]


@dataclass(frozen=True)
class SortableTable:
    """A table whose columns sort; the first cell of a row names it."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]
    notes: Sequence[str] = ()
    rivals: Rivals | None = None


@dataclass(frozen=True)
class Tables:
    """Tables of the same kind, one of which is visible at a time.

    Attributes:
        title: Heading.
        lead: What they show, in a sentence or two.
        label: What distinguishes them.
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
        lead: What they show.
        data: The data that `plots.js` draws: `kind` ("points" or "curves"), `x` (`label`, `log`),
            `y` (`log`), and `panels` with `label` and `points`, `lines` or `series`.
    """

    template: ClassVar[str] = "plot.html"
    title: str
    lead: str
    data: Mapping[str, Any]


@dataclass(frozen=True)
class Replay:
    """A replay of an episode of several policies.

    Attributes:
        title: Heading.
        lead: The scenario in words.
        data: The data that `replay.js` plays (`usm_cli.report.replay`).
        first: The two policies that the page shows first.
        notes: Remarks on the replay.
    """

    template: ClassVar[str] = "replay.html"
    title: str
    lead: str
    data: Mapping[str, Any]
    first: tuple[str, str]
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Facts:
    """Terms and their explanations."""

    template: ClassVar[str] = "facts.html"
    title: str
    facts: Mapping[str, str]


@dataclass(frozen=True)
class Chapter:
    """Everything about one result.

    Attributes:
        title: Heading.
        lead: A description in a sentence.
        blocks: The blocks, in order.
        policies: The policies that it shows, which the page explains.
        verdict: Which controller copes; for the head of the page.
        motion: What joint motion does to the error, if known; for the head of the page.
        robots: The robots, each by the name of what it swims in; the head of the page draws them.
    """

    title: str
    lead: str
    blocks: Sequence[Tables | Plot | Replay | Facts]
    policies: Sequence[str] = ()
    verdict: str = ""
    motion: str = ""
    robots: Mapping[str, AnyRobot | Manipulator] = field(default_factory=dict)
