"""`usm reproduce`: the paper's Table 1 and Figures 3 to 10."""

from __future__ import annotations

import argparse
import os
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.table import Table

from agents.options import output_folder
from agents.terminal import figures, output_console, progress_bar
from baselines.reproduction import (
    HEADING_GAIN,
    IMPLICIT_STEP,
    PAPER,
    SIGMA_START,
    STEP,
    cases,
    run_cases,
    table,
)
from usm_gym.files import write_json, write_text
from usm_gym.provenance import provenance
from usm_gym.scenario import MODES, Scenario, named

DESCRIPTION = """\
Run the paper as printed: explicit laws and observer at a step of 1e-5 s, ideal thrusters without
limit, its gains, on the declared scenario `table1`; print our Table 1 beside the paper's. With
--output, also write table1.json, table1.md and fig03.png to fig10.png into a folder (the figures
need the extra `render`). Takes about half a minute on two cores.
"""
COLUMNS = [(part, axis) for part in ("torpedo", "operation", "settled") for axis in ("x", "y")]


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "reproduce",
        help="regenerate the paper's Table 1 and figures",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--output", metavar="DIR", help="folder for the table and the figures")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Run all cases, print the table, write the folder."""
    folder = None if arguments.output is None else output_folder(arguments.output)
    chosen = cases()
    with progress_bar() as bar:
        task = bar.add_task("runs", total=len(chosen))
        records = run_cases(chosen, os.cpu_count() or 1, lambda: bar.advance(task))
    result = table(chosen, records)
    output_console().print(terminal_table(result["rows"]))
    if folder is None:
        return
    scenario: dict[str, Scenario] = {mode: named("table1", mode) for mode in MODES}
    document = {
        "step": STEP,
        "settle_time": scenario["operation"].settle_time,
        **result,
        "paper": PAPER,
        "scenario": {
            **{mode: each.to_dict() for mode, each in scenario.items()},
            "heading_gain": HEADING_GAIN,
            "sigma_start": list(SIGMA_START),
            "implicit_step": IMPLICIT_STEP,
        },
        "provenance": provenance({}),
    }
    write_json(folder / "table1.json", document)
    write_text(folder / "table1.md", markdown(result["rows"]))
    from baselines.reproduction_figures import draw_all

    draw_all(records, folder)


def lines(rows: dict[str, Any]) -> list[list[str]]:
    """Our rows and the paper's, mm, with the ratio of ours to the paper's, as text."""
    found = []
    for name, row in rows.items():
        found.append([f"{name}, ours", *(figures(1e3 * row[part][axis]) for part, axis in COLUMNS)])
        if name in PAPER:
            printed = PAPER[name]
            theirs = [figures(1e3 * printed[part][axis]) for part, axis in COLUMNS]
            ratio = [figures(row[part][axis] / printed[part][axis]) for part, axis in COLUMNS]
            found += [[f"{name}, paper", *theirs], ["ratio", *ratio]]
    return found


def terminal_table(rows: dict[str, Any]) -> Table:
    """The table for the terminal."""
    shown = Table(
        "mm",
        title="absolute maximum of the position error after settling",
        title_justify="left",
        title_style="",
        box=SIMPLE_HEAD,
        pad_edge=False,
    )
    for part, axis in COLUMNS:
        shown.add_column(f"{part}\n{axis}", justify="right")
    for line in lines(rows):
        shown.add_row(*line)
    return shown


def markdown(rows: dict[str, Any]) -> str:
    """The table as Markdown."""
    head = "| mm | " + " | ".join(f"{part} {axis}" for part, axis in COLUMNS) + " |"
    rule = "|---|" + "---|" * len(COLUMNS)
    body = ["| " + " | ".join(line) + " |" for line in lines(rows)]
    title = "Absolute maximum of the position error after settling (Table 1 of the paper).\n"
    return "\n".join([title, head, rule, *body]) + "\n"
