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
    table = Table("policy", "what it is", "told", box=None)
    for id in ids():
        policy = entry(id)
        marks = [mark for mark in ("on_request", "privileged") if getattr(policy, mark)]
        said = [mark.replace("_", " ") for mark in marks] + [policy.note] * bool(policy.note)
        summary = policy.summary + "".join(f" ({each})" for each in said)
        table.add_row(id, summary, policy.told)
    output_console().print(table)
