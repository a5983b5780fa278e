"""The `usm` command."""

from __future__ import annotations

import sys
import traceback
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

from usm_cli.commands import (
    bench,
    compare,
    evaluate,
    leaderboard,
    policies,
    report,
    reproduce,
    robustness,
    study,
    train,
    tune,
    watch,
)
from usm_cli.terminal import Parser
from usm_gym.support.validation import UsageError, in_one_line

COMMANDS = (
    policies,
    evaluate,
    compare,
    leaderboard,
    robustness,
    tune,
    train,
    study,
    watch,
    report,
    reproduce,
    bench,
)

DESCRIPTION = """\
Trajectory tracking for an underwater swimming manipulator: score controllers and compare them.
A first look:

  usm evaluate                 every policy on the fifty frozen operation scenarios
  usm policies                 what there is to compare
  usm compare A B              whether one of them is better than another
  usm leaderboard              all of them on all frozen suites
  usm robustness --vary noise  how they fare when something gets worse
  usm watch                    one of them at work
  usm report RESULT.json       a page with all of it, to be played
  usm tune POLICY              better gains for one of them
  usm train --output DIR       an agent that adds thrust to one of them
  usm study residual           what trained agents owe to what
  usm reproduce                the paper's Table 1 and figures
  usm bench                    how fast all this is here
"""


BUG = "usm: this is a bug in usm-gym; please report it with the lines above"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and leave with its status.

    It is 2 for bad input and for output that cannot be written, and 1 for a bug of ours.
    """
    status: Any = None
    debug = False
    try:
        try:
            chosen = parser().parse_args(arguments)
            debug = chosen.debug
            chosen.run(chosen)
        except SystemExit as left:
            status = left.code
        sys.stdout.flush()
    except BrokenPipeError:
        status = 1  # the reader has gone, and knows
    except (UsageError, OSError) as error:
        if debug:
            traceback.print_exc()
        print(f"usm: error: {in_one_line(error)}", file=sys.stderr)
        status = 2
    except Exception:
        traceback.print_exc()
        print(BUG, file=sys.stderr)
        status = 1
    if status:
        sys.exit(status)


def parser() -> Parser:
    """The parser of all commands."""
    parser = Parser(prog="usm", description=DESCRIPTION)
    parser.add_argument("--version", action="version", version=f"usm-gym {version('usm-gym')}")
    parser.add_argument(
        "--debug", action="store_true", help="show where in the code an error was found"
    )
    subparsers = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    for command in COMMANDS:
        command.add_to(subparsers)
    return parser
