"""`usm robustness`: vary one quantity and score policies."""

from __future__ import annotations

import argparse
from math import isfinite
from typing import Any

from rich.table import Table
from usm_baselines.benchmark import robustness, robustness_figure
from usm_baselines.benchmark.robustness import (
    QUANTITIES,
    RefusedPoint,
    RobustnessResult,
    ScoredPoint,
)

from usm_cli.options import output_folder
from usm_cli.selection import (
    POLICIES,
    add_policies,
    add_scenarios,
    add_scoring,
    chosen_contenders,
    chosen_scenarios,
    jobs,
    leave_if_refused,
    scored,
    seeds,
)
from usm_cli.terminal import empty_table, output_console
from usm_gym.rendering.plots import plotting, save
from usm_gym.support.results import Provenance
from usm_gym.support.text import degrees, mm
from usm_gym.support.validation import require

DESCRIPTION = """\
Vary one quantity of a suite, with all else equal, and score policies at every value. The policies
keep the nominal knowledge of the suite; they always know the true control period. What is counted
in control periods changes with that. The table has the mean of the largest errors and of the
largest heading error, and how many robots are lost; the figure has the errors of the robots that
are not lost, and the share of those that are. Writes QUANTITY.json, and the figure as PNG and SVG
(extra `render`), into a folder. After an interruption, run it again to continue.
"""
EXAMPLES = f"""\
quantities:
{"".join(f"  {name:<12}{known.label}{chr(10)}" for name, known in QUANTITIES.items())}
{POLICIES}
examples:
  usm robustness --vary noise --policies sta,pd
  usm robustness --vary limit --values 2,4,8,16 --policies sta
  usm robustness --vary fix-delay --conditions basin    about the suite operation-basin
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
    add("--vary", choices=list(QUANTITIES), required=True, metavar="QUANTITY", help="see below")
    add("--values", metavar="V,W", help="its values (default: some over a wide range)")
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
    contenders = chosen_contenders(arguments.policies, scenarios[0])
    jobs(contenders, scenarios, arguments.time_limit)  # refuses policies that cannot be made
    chosen = robustness.jobs(contenders, scenarios, quantity, values, arguments.time_limit)
    folder = output_folder(arguments.output)
    outcomes = scored(chosen, arguments, folder / "cache")
    result = RobustnessResult(
        quantity=arguments.vary,
        label=quantity.label,
        values=values,
        scenarios=tuple(scenarios),
        results=robustness.curves([policy.name for policy in contenders], values, outcomes),
        provenance=Provenance.here(seeds(arguments)),
    )
    result.write(folder / f"{arguments.vary}.json")
    with plotting():
        save(robustness_figure.draw(result), folder / arguments.vary)
    output_console().print(table(result))
    leave_if_refused(result.refused)


def parse_values(text: str) -> tuple[float, ...]:
    """Read numbers, separated by commas."""
    try:
        values = tuple(map(float, text.split(",")))
    except ValueError:
        values = ()
    known = bool(values) and all(map(isfinite, values))
    require(known, "--values", text, "numbers, separated by commas")
    return values


def table(result: RobustnessResult) -> Table:
    """Mean errors in mm and degrees and the number of lost robots, one row per policy."""
    axes = " / ".join(result.axes)
    rows = empty_table(
        "policy",
        *(f"{value:g}" for value in result.values),
        title=f"largest position error after settling, mm, {axes}, then those of angles, and lost "
        f"robots, against {result.label}",
    )
    for name, points in result.results.items():
        rows.add_row(name, *map(cell, points))
    return rows


def cell(point: ScoredPoint | RefusedPoint) -> str:
    """Write the errors and losses at one value, the latter in a line of their own."""
    if isinstance(point, RefusedPoint):
        return "refused"
    errors = " / ".join(mm(error.mean) for error in point.errors.values())
    besides = [f"{degrees(error.mean)}°" for error in point.attitude.values()]
    besides += [f"{point.failures} lost"] * (point.failures > 0)
    return "\n".join([errors, *([", ".join(besides)] if besides else [])])
