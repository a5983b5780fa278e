"""Writes on the terminal: errors in one line, tables, progress."""

from __future__ import annotations

import argparse
import os
import re
import sys
import textwrap
from collections.abc import Iterable
from typing import Any, NoReturn

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from usm_gym.support.validation import SAID, clipped


class HelpFormatter(argparse.HelpFormatter):
    """Fits texts into the terminal: fills paragraphs, keeps indented lines, such as examples."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return "\n".join(
            textwrap.fill(line, width, subsequent_indent=hanging(line), break_on_hyphens=False)
            for line in re.sub(r"(?<=\S)\n(?=\S)", " ", text.strip("\n")).split("\n")
        )


def hanging(line: str) -> str:
    """The indent of what does not fit into a line: of an example, that of its second column."""
    indented = re.match(r" +(\S.*?  +(?=\S))?", line)
    if indented is None:
        return ""
    return " " * (indented.end() if indented[1] else indented.end() + 4)


class Parser(argparse.ArgumentParser):
    """An argument parser that fits its texts into the terminal and reports an error in one line."""

    def __init__(self, **options: Any) -> None:
        """Take the options of `argparse.ArgumentParser`."""
        super().__init__(**options)
        self.formatter_class = HelpFormatter

    def error(self, message: str) -> NoReturn:
        """Leave with status 2."""
        said = clipped(" ".join(clipped(word) for word in message.split(" ")), SAID)
        self.exit(2, f"{self.prog}: error: {said} (see {self.prog} --help)\n")


# Columns of a table in a file or a pipe, if the variable COLUMNS does not say another number.
PIPE_WIDTH = 120


def output_console() -> Console:
    """The console for results: as wide as the terminal, COLUMNS, or `PIPE_WIDTH`."""
    known = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdecimal()
    return Console(width=None if known else PIPE_WIDTH, highlight=False)


def progress_bar() -> Progress:
    """A progress bar on standard error, which only a terminal shows."""
    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


def empty_table(*words: str, numbers: Iterable[str] = (), title: str | None = None) -> Table:
    """A table without rows, with columns of words, then right-aligned columns of numbers."""
    table = Table(
        *words,
        title=title,
        title_justify="left",
        title_style="",
        box=SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for heading in numbers:
        table.add_column(heading, justify="right")
    return table
