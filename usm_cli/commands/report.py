"""`usm report`: turn results into a page."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from rich.progress import Progress, TaskID

from usm_cli.options import add_computing, check_installed, computing, count
from usm_cli.selection import POLICIES, named_contenders
from usm_cli.terminal import output_console, progress_bar
from usm_gym.support.files import check_writable, write_text
from usm_gym.support.provenance import provenance

DESCRIPTION = """\
Turn results into one self-contained page of HTML: sortable tables with intervals, a replay of an
episode of every policy, errors over time, error against thrust variation or against the varied
quantity, conditions and provenance. The results are the JSON files of `usm evaluate`, `usm
leaderboard`, `usm robustness`, `usm reproduce` and `usm study`. Needs the extra `report`.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm report results/0.2.0/leaderboard.json --output page.html
  usm report mine.json results/robustness/noise.json --output page.html
  usm report mine.json --scenario 7 --policies sta,my_module:MyController --output page.html
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "report",
        help="turn results into a page with replays",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("results", nargs="+", metavar="RESULT.json", help="files of results")
    add("--output", required=True, metavar="FILE", help="the page to write, .html")
    add(
        "--policies",
        metavar="A,B",
        help="policies to replay (default: the registered ones of the result)",
    )
    add("--scenario", type=int, metavar="I", help="episode to replay, from 0 (default: 0)")
    add_computing(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Replay, write the page."""
    check_installed("usm report", "report", "jinja2")
    # These imports need the extra.
    from usm_cli.report.chapters import Choice, chapter, read
    from usm_cli.report.page import html

    path = Path(arguments.output)
    check_writable(path)
    contenders = None if arguments.policies is None else named_contenders(arguments.policies)
    scenario = count(arguments, "scenario", 0, least=0)
    files = [Path(name) for name in arguments.results]
    results = {file: read(file) for file in files}  # before any computation
    chapters = []
    with computing(arguments) as workers, progress_bar() as bar:
        choice = Choice(contenders, scenario, workers)
        for file in files:
            line = bar.add_task(f"replay {file.name}")
            chapters.append(chapter(results[file], choice, partial(advance, bar, line)))
    write_text(path, html(chapters, provenance({})))
    size = path.stat().st_size / 1e6
    output_console().print(f"{path}: {size:.1f} MB", markup=False, soft_wrap=True)


def advance(bar: Progress, line: TaskID, done: int, total: int) -> None:
    """Update a line of the progress bar."""
    bar.update(line, completed=done, total=total)
