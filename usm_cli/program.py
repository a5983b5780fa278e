"""Runs the `usm` command: its parser and its exit status."""

from __future__ import annotations

import argparse
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
    record,
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
    record,
    watch,
    report,
    reproduce,
    bench,
)

DESCRIPTION = """\
Trajectory tracking for an underwater swimming manipulator: score controllers and compare them.
A first look:

  usm evaluate                 see which policy is best on fifty frozen scenarios
  usm policies                 list the policies by family
  usm compare A B              decide whether one policy is better than another
  usm leaderboard              score all policies on all frozen suites
  usm robustness --vary noise  see how errors grow when something gets worse
  usm watch                    watch a policy
  usm report RESULT.json       turn results into a page with replays
  usm tune POLICY              search for better gains
  usm train --output DIR       train an agent that adds thrust to a policy
  usm study residual           train agents and see what their ingredients contribute
  usm record POLICY            write a dataset for offline learning
  usm reproduce                run the paper's Table 1 and figures anew
  usm bench                    measure the speed on this machine
"""


BUG = "usm: this is a bug in usm-gym; please report it with the lines above"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and leave with its status.

    The status is 2 for bad input and for output that cannot be written, and 1 for our own bugs.
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
        status = 1  # the reader has gone and knows it
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
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    parser.set_defaults(run=overview)
    subparsers = parser.add_subparsers(metavar="COMMAND", parser_class=Parser)
    for command in COMMANDS:
        command.add_to(subparsers)
    for subparser in subparsers.choices.values():
        subparser.add_argument(
            "--debug", action="store_true", default=argparse.SUPPRESS, help=argparse.SUPPRESS
        )
    return parser


def overview(arguments: argparse.Namespace) -> None:
    """Say what `usm` is for and which commands there are."""
    print(f"{DESCRIPTION}\n`usm COMMAND --help` explains a command and has examples.")
