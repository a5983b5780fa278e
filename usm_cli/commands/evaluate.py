"""`usm evaluate`: score policies on a frozen suite or on sampled scenarios."""

from __future__ import annotations

import argparse
from typing import Any

from rich.table import Table

from usm_cli.selection import (
    POLICIES,
    add_policies,
    add_scenarios,
    add_scoring,
    by_name,
    chosen_contenders,
    chosen_scenarios,
    leave_if_refused,
    scored,
    seeds,
    suite_name,
    tasks,
)
from usm_cli.terminal import empty_table, output_console
from usm_gym.support.files import check_writable, write_json
from usm_gym.support.provenance import provenance
from usm_gym.support.text import figures, mm

DESCRIPTION = """\
Score policies: per episode and axis, the largest true position error after settling (5 s), as in
Table 1 of the paper. All policies meet the same scenarios and the same noise. Printed are means
over episodes with 95 % bootstrap intervals; a lost robot counts 0.5 m or more in both axes. A
policy that fails to act is left out of the table, with the reason on a line of its own, status 1.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm evaluate                                          all competitors, fifty frozen scenarios
  usm evaluate --policies sta,pd --suite torpedo        two of them in torpedo mode
  usm evaluate --policies sta --seed 7 --episodes 200   sampled scenarios
  usm evaluate --conditions ideal                       the suite without noise, lag and current
  usm evaluate --conditions '{{"position_noise": 0}}'     one field other than in "field"
  usm evaluate --policies sta --output sta.json         keep everything, episode by episode
  usm evaluate --policies sta,sta@gains.json            gains of one's own, see usm tune
  usm evaluate --policies sta,my_module:MyController    a controller of one's own
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "evaluate",
        help="score policies",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add_policies(parser)
    add_scenarios(parser)
    add_scoring(parser)
    parser.add_argument("--output", metavar="FILE", help="write the results as JSON")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Evaluate, print the table, write the file."""
    if arguments.output:
        check_writable(arguments.output)
    scenarios = chosen_scenarios(arguments)
    chosen = tasks(chosen_contenders(arguments.policies), scenarios, arguments.time_limit)
    found, refused = by_name(chosen, scored(chosen, arguments))
    privileged = {task.contender.name for task in chosen if task.contender.privileged}
    results = {
        name: evaluation.summary() | {"competitor": name not in privileged}
        for name, evaluation in found.items()
    }
    name = suite_name(arguments)
    if results:
        output_console().print(table(results, f"{name or 'sampled'}, {len(scenarios)} episodes"))
    if arguments.output:
        document = {
            "kind": "evaluation",
            "suite": name,
            "conditions": scenarios[0].to_dict()["conditions"],
            "conditions_override": arguments.conditions,
            "settle_time": scenarios[0].settle_time,
            "episodes": len(scenarios),
            "scenarios": [scenario.to_dict() for scenario in scenarios],
            "results": results,
            "refused": refused,
            "provenance": provenance(seeds(arguments)),
        }
        write_json(arguments.output, document)
    leave_if_refused(refused)


def table(results: dict[str, Any], title: str) -> Table:
    """The scores for the terminal, errors in mm."""
    errors = ("x", "y", "worst x", "worst y", "settled x", "settled y")
    rows = empty_table(
        "policy",
        numbers=(*errors, "thrust\nN", "variation\nN/s", "lost"),
        title=f"largest position error after settling, mm: mean [95 % interval] ({title})",
    )
    for name, row in results.items():
        cells = []
        for axis in "xy":
            score = row[f"max_error_{axis}"]
            low, high = score["ci95"]
            cells.append(f"{mm(score['mean'])} [{mm(low)}, {mm(high)}]")
        cells += [mm(row[f"max_error_{axis}"]["worst"]) for axis in "xy"]
        cells += [mm(row[f"settled_error_{axis}"]["mean"]) for axis in "xy"]
        cells += [figures(row[key]["mean"]) for key in ("thrust_effort", "thrust_variation")]
        rows.add_row(name, *cells, str(row["failures"]))
    return rows
