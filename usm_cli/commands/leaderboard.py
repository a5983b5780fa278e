"""`usm leaderboard`: score every policy on every frozen suite."""

from __future__ import annotations

import argparse
import os
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.markdown import Markdown
from usm_baselines.benchmark.leaderboard import BOARDS, PLANE, Board, front, leaderboard, places
from usm_baselines.benchmark.leaderboard_page import csv_text, markdown, table, with_table

from usm_cli.options import output_folder
from usm_cli.selection import (
    POLICIES,
    add_policies,
    add_scoring,
    leave_if_refused,
    named_contenders,
    scored,
)
from usm_cli.speed import SpeedResult
from usm_cli.terminal import output_console
from usm_gym.evaluation import Evaluation
from usm_gym.suites import NAMES
from usm_gym.support.files import check_writable, holding, read_text, write_text
from usm_gym.support.results import Provenance
from usm_gym.support.validation import require
from usm_gym.task.modes import in_space, of_head

DESCRIPTION = """\
Score every policy on the frozen suites that it is meant for, and laws for the body on the operation
suite with the joints still: policies that are tuned for `basin` or `sea` on the suites of these
conditions only, and there no others but the paper's `sta` and `pd` and those that are no
competitors. Policies that are named meet every suite. Writes leaderboard.json, leaderboard.csv,
leaderboard.md and figures (extra `render`) into a folder. After an interruption, run it again to
continue: the folder `cache` there keeps the scores of a policy on a suite until something changes
on which they depend.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm leaderboard --workers 2                          into results/VERSION
  usm leaderboard --head --space                       the head of the robot in space
  usm leaderboard --insert README.md                   also the verdict, between its marks
  usm leaderboard --policies sta,my_module:MyController --output mine
  usm leaderboard --policies lqg-tuned,lqg-basin,lqg-sea --output tiers
                                                       a cross-table of gains and conditions, too
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "leaderboard",
        help="score every policy on every suite",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add_policies(parser, default="all on the suites that they are meant for")
    add_scoring(parser)
    add = parser.add_argument
    add("--space", action="store_true", help="the suites in space instead of those in the plane")
    add("--head", action="store_true", help="the suites in which the head follows a path")
    add(
        "--output",
        metavar="DIR",
        help="folder (default: results/VERSION, or its folder space, head or head3d)",
    )
    add(
        "--insert",
        metavar="FILE",
        help="page in which to update the verdict, and the whole table of the operation suite",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Score, write the folder, print the main table."""
    page = None if arguments.insert is None else read_text(arguments.insert)
    if page is not None:
        check_writable(arguments.insert)
    board = board_of(arguments.head, arguments.space)
    usual = Path("results", version("usm-gym"), board.folder)
    folder = output_folder(arguments.output or str(usual))
    from usm_baselines.benchmark.leaderboard_figures import draw_all

    named = arguments.policies is not None
    contenders = named_contenders(arguments.policies) if named else None
    fronts = front() if board is PLANE and not named else {}
    suites = board.suites()
    chosen = places(contenders, fronts, suites, arguments.time_limit)
    with holding(folder):
        outcomes = scored([place.job for place in chosen], arguments, folder / "cache")
        pairs = list(zip(chosen, outcomes, strict=True))
        acts = any(isinstance(outcome, Evaluation) for p, outcome in pairs if p.suite == board.main)
        require(acts, "--policies", arguments.policies, "at least one policy that acts")
        origin = Provenance.here({"suites": [name for name in NAMES if name in suites]})
        result = leaderboard(pairs, fronts, version("usm-gym"), origin)
        result.write(folder / "leaderboard.json")
        write_text(folder / "leaderboard.csv", csv_text(result))
        write_text(folder / "leaderboard.md", markdown(result))
        if page is not None:
            figure = Path(os.path.relpath(folder / "verdict.svg", Path(arguments.insert).parent))
            known = decision_times(folder, board)
            write_text(arguments.insert, with_table(page, result, figure.as_posix(), known))
        draw_all(result, folder)
    output_console().print(Markdown(table(result.main)))
    leave_if_refused({id: why for rows in result.refused.values() for id, why in rows.items()})


def board_of(head: bool, space: bool) -> Board:
    """The board of body or head, in the plane or in space."""
    kinds = {(of_head(board.main), in_space(board.main)): board for board in BOARDS}
    return kinds[head, space]


def decision_times(folder: Path, board: Board = PLANE) -> dict[str, float]:
    """How long policies take for a decision, us, if `usm bench` has left that beside the tables.

    Args:
        folder: Folder of the leaderboard.
        board: Which one it is; that of the plane has its folder where the file of `usm bench` is,
            all others have theirs inside it. Decisions for the head are not timed.
    """
    path = (folder.parent if board.folder else folder) / "bench.json"
    if of_head(board.main) or not path.exists():
        return {}
    speed = SpeedResult.read(path)
    decisions = speed.decisions if board is PLANE else speed.spatial_decisions
    return {id: figure.median for id, figure in decisions.items()}
