"""`usm policies`: the policies that can be compared."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from rich.table import Table
from rich.text import Text
from usm_baselines.families import Family
from usm_baselines.registry import POSITION_ONLY, base_of, entry, ids

from usm_cli.terminal import output_console

# What is added to the name of a law for another form of it, and what that means.
FORMS = {
    "tuned": "with gains tuned for field",
    "basin": "with gains tuned for basin",
    "sea": "with gains tuned for sea",
    "lag": "told how slowly the thrusters react",
    "navigator": "on an estimate of the state that takes in late and rare measurements",
}
TOLD = """\
All policies know the measured position and the reference; "told" is what they know besides.\
"""
DESCRIPTION = """\
List the registered policies by family; --policies takes their names. Below a law stand its other
forms.
"""
OTHERS = "Others", "Registered by yourself."


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "policies", help="list the policies by family", description=DESCRIPTION
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print the families."""
    console = output_console()
    laws: dict[str, list[str]] = {}
    for id in ids():
        laws.setdefault(base_of(id), []).append(id)
    for family in (*Family, None):
        members = [law for law in laws if entry(law).family is family]
        if not members:
            continue
        title, idea = (family.title, family.idea) if family else OTHERS
        console.print(f"[bold]{title}[/]: {idea}")
        grid = Table(box=None, show_header=False, padding=(0, 0, 0, 2))
        grid.add_column(no_wrap=True)
        for law in members:
            grid.add_row(law, described(law, laws[law][1:]))
        console.print(grid)
        console.print()
    forms = "\n".join(f"  NAME-{form}: {meaning}" for form, meaning in FORMS.items())
    console.print(f"{TOLD}\nOther forms of a law:\n{forms}", markup=False)


def described(law: str, forms: Sequence[str]) -> Text:
    """What a law is; below, what it is told and its other forms."""
    policy = entry(law)
    marks = [policy.note] * bool(policy.note)
    marks += ["only scored if named"] * policy.on_request + ["no competitor"] * policy.privileged
    text = Text(policy.summary + "".join(f" ({mark})" for mark in marks))
    if policy.told != POSITION_ONLY:
        text.append(f"\ntold: {policy.told}", style="dim")
    if forms:
        text.append(f"\nalso: {', '.join(forms)}", style="dim")
    return text
