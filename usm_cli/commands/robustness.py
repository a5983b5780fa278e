"""`usm robustness`: error against one quantity."""

from __future__ import annotations

import argparse
from typing import Any

from rich.table import Table
from usm_baselines.benchmark import robustness
from usm_baselines.benchmark.robustness import QUANTITIES

from usm_cli.options import output_folder
from usm_cli.selection import (
    POLICIES,
    add_policies,
    add_scenarios,
    add_scoring,
    chosen_contenders,
    chosen_scenarios,
    leave_if_refused,
    scored,
    seeds,
    tasks,
)
from usm_cli.terminal import empty_table, output_console
from usm_gym.support.files import write_json
from usm_gym.support.provenance import provenance
from usm_gym.support.text import mm
from usm_gym.support.validation import require

DESCRIPTION = """\
Vary one quantity of a suite, all else being equal, and score policies at each value of it. They
keep the nominal knowledge of the suite; only the control period is known to them whatever it is.
Writes QUANTITY.json and QUANTITY.png (extra `render`) into a folder; an interrupted run goes on
where it stopped.
"""
EXAMPLES = f"""\
quantities:
{"".join(f"  {name:<12}{each.label}{chr(10)}" for name, each in QUANTITIES.items())}
{POLICIES}
examples:
  usm robustness --vary noise --policies sta,pd
  usm robustness --vary limit --values 2,4,8,16 --policies sta
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "robustness",
        help="error against noise, lag, current, ...",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("--vary", choices=list(QUANTITIES), required=True, metavar="QUANTITY", help="which")
    add("--values", metavar="V,W", help="at which values (default: some over a wide range)")
    add_policies(parser)
    add_scenarios(parser)
    add_scoring(parser)
    add("--output", default="results/robustness", metavar="DIR", help="default: results/robustness")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Score, print the table, write the folder."""
    quantity = QUANTITIES[arguments.vary]
    values = quantity.values if arguments.values is None else parse_values(arguments.values)
    scenarios = chosen_scenarios(arguments)
    contenders = chosen_contenders(arguments.policies)
    tasks(contenders, scenarios, arguments.time_limit)  # refuses what cannot be made
    chosen = robustness.tasks(contenders, scenarios, quantity, values, arguments.time_limit)
    folder = output_folder(arguments.output)
    outcomes = scored(chosen, arguments, folder / "cache")
    found = robustness.curves([each.name for each in contenders], values, outcomes)
    document = {
        "kind": "robustness",
        "quantity": arguments.vary,
        "label": quantity.label,
        "values": list(values),
        "scenarios": [scenario.to_dict() for scenario in scenarios],
        "results": found,
        "provenance": provenance(seeds(arguments)),
    }
    write_json(folder / f"{arguments.vary}.json", document)
    figure = robustness.draw(found, quantity.label)
    figure.savefig(folder / f"{arguments.vary}.png", dpi=120, metadata={"Software": None})
    output_console().print(table(found, quantity.label))
    leave_if_refused(
        {
            f"{name} at {point['value']:g}": point["refused"]
            for name, points in found.items()
            for point in points
            if "refused" in point
        }
    )


def parse_values(text: str) -> tuple[float, ...]:
    """Numbers, by commas."""
    try:
        values = tuple(float(each) for each in text.split(","))
    except ValueError:
        values = ()
    require(values, "--values", text, "numbers, by commas")
    return values


def table(found: dict[str, Any], label: str) -> Table:
    """Mean errors x / y in mm, a row for each policy."""
    values = [point["value"] for point in next(iter(found.values()))]
    rows = empty_table(
        "policy",
        *(f"{value:g}" for value in values),
        title=f"largest position error after settling, mm, x / y, against {label}",
    )
    for name, points in found.items():
        rows.add_row(name, *map(cell, points))
    return rows


def cell(point: dict[str, Any]) -> str:
    """The errors at one value."""
    if "refused" in point:
        return "refused"
    return " / ".join(mm(point[f"max_error_{axis}"]["mean"]) for axis in "xy")
