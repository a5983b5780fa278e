"""`usm policies`: the policies that can be compared."""

from __future__ import annotations

import argparse
from typing import Any

from rich.table import Table
from usm_baselines.registry import entry, ids

from usm_cli.terminal import output_console


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "policies",
        help="list the registered policies",
        description="List the registered policies; --policies takes their names.",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print the table."""
    table = Table("policy", "what it is", box=None)
    for id in ids():
        policy = entry(id)
        marks = [mark for mark in ("slow", "privileged") if getattr(policy, mark)]
        marks += [policy.note] if policy.note else []
        table.add_row(id, policy.summary + "".join(f" ({mark})" for mark in marks))
    output_console().print(table)
