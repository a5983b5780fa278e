"""`usm reproduce`: the paper's Table 1 and figures, and what hangs on its open items."""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path
from typing import Any

from rich.table import Table
from usm_baselines.paper.reproduction import (
    HEADING_GAIN,
    IMPLICIT_STEP,
    PAPER,
    SAMPLE_TIME,
    SIGMA_START,
    STEP,
    cases,
    run_cases,
    table,
)
from usm_baselines.paper.reproduction_figures import NAMES

from usm_cli.options import output_folder
from usm_cli.terminal import empty_table, output_console, progress_bar
from usm_gym.support.files import write_json, write_text
from usm_gym.support.provenance import provenance
from usm_gym.support.text import figures
from usm_gym.support.validation import require
from usm_gym.task.sampling import named
from usm_gym.task.scenario import MODES, Scenario

DESCRIPTION = """\
Run the paper as printed: explicit laws and observer at a step of 1e-5 s, ideal thrusters without
limit, its gains, on the declared scenario `table1`; print our Table 1 beside the paper's. With
--output, also write table1.json, table1.md and the figures into a folder (the figures need the
extra `render`). Takes less than a minute on two cores.

--study and --fit write into the same folder, take some minutes, and go on where they stopped when
they are started again.
"""
EXAMPLES = """\
examples:
  usm reproduce                                    the table
  usm reproduce --output paper                     the table and all figures
  usm reproduce --output paper --figures fig05,fig07
  usm reproduce --step 1e-4                        at another step
  usm reproduce --output paper --study             every open item one at a time
  usm reproduce --output paper --fit               refit the declared scenario
"""
COLUMNS = [(part, axis) for part in ("torpedo", "operation", "settled") for axis in ("x", "y")]
GENERATIONS = 60


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "reproduce",
        help="regenerate the paper's Table 1 and figures",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("--output", metavar="DIR", help="folder for the table and the figures")
    add("--figures", metavar="A,B", help=f"which figures ({', '.join(NAMES)}; default: all)")
    add("--step", type=float, default=STEP, metavar="S", help="step, s (default: 1e-5)")
    other = parser.add_mutually_exclusive_group()
    other.add_argument("--study", action="store_true", help="vary every open item instead")
    other.add_argument("--fit", action="store_true", help="refit the declaration instead")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Make the table, the study or the fit."""
    names = chosen_figures(arguments.figures)
    check_step(arguments.step)
    extra = [f"--{name}" for name in ("study", "fit", "figures") if getattr(arguments, name)]
    require(arguments.output or not extra, "--output", None, f"a folder, for {' '.join(extra)}")
    folder = None if arguments.output is None else output_folder(arguments.output)
    if folder and arguments.study:
        run_study(folder)
    elif folder and arguments.fit:
        run_fit(folder)
    else:
        run_table(folder, arguments.step, names)


def run_table(folder: Path | None, step: float, names: list[str]) -> None:
    """Run all cases, print the table, write the folder."""
    chosen = cases(step)
    with progress_bar() as bar:
        task = bar.add_task("runs", total=len(chosen))
        records = run_cases(chosen, workers(), lambda: bar.advance(task))
    result = table(chosen, records)
    output_console().print(terminal_table(result["rows"]))
    if folder is None:
        return
    scenario: dict[str, Scenario] = {mode: named("table1", mode) for mode in MODES}
    document = {
        "kind": "reproduction",
        "step": step,
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
    from usm_baselines.paper.reproduction_figures import draw

    draw(names, records, folder)


def run_study(folder: Path) -> None:
    """Run the sensitivity study, write study.json and study.png."""
    from usm_baselines.paper.sensitivity import runs, study
    from usm_baselines.paper.sensitivity_figure import draw_study

    with progress_bar() as bar:
        task = bar.add_task("study")
        runs_done = study(
            folder / "study.json",
            workers(),
            lambda done, total: bar.update(task, completed=done, total=total),
            runs(),
        )
    draw_study(runs_done, folder / "study.png")


def run_fit(folder: Path) -> None:
    """Refit the declaration, write fit.json, print what came of it."""
    from usm_baselines.paper.reproduction_fit import fit

    with progress_bar() as bar:
        task = bar.add_task("fit")
        found = fit(
            folder / "fit.json",
            GENERATIONS,
            workers(),
            lambda done, total: bar.update(task, completed=done, total=total),
        )
    output_console().print(fit_table(found))


def workers() -> int:
    """One thread for each core."""
    return os.cpu_count() or 1


def chosen_figures(text: str | None) -> list[str]:
    """The figures that the argument asks for."""
    if text is None:
        return list(NAMES)
    chosen = [name.strip() for name in text.split(",") if name.strip()]
    require(chosen and set(chosen) <= set(NAMES), "--figures", text, ", ".join(NAMES))
    return chosen


def check_step(step: float) -> None:
    """Refuse a step at which the records' instants would be missed."""
    count = SAMPLE_TIME / step if step > 0 else 0.0
    require(
        1.0 <= count < math.inf and abs(count - round(count)) < 1e-6 * count,
        "--step",
        step,
        f"a positive number of which {SAMPLE_TIME:g} s is a multiple",
    )


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
    """Table 1 for the terminal."""
    shown = empty_table(
        "mm",
        numbers=(f"{part}\n{axis}" for part, axis in COLUMNS),
        title="absolute maximum of the position error after settling",
    )
    for line in lines(rows):
        shown.add_row(*line)
    return shown


def fit_table(found: dict[str, Any]) -> Table:
    """The numbers that the fit saw, and its freedoms, for the terminal."""
    shown = empty_table(
        "",
        numbers=("declared", "fitted"),
        title="ours over the paper's at a step of 1e-5 s, and what was free",
    )
    for part, printed in found["seen"].items():
        for index, axis in enumerate("xy"):
            cells = [
                figures(found[name]["paper"]["numbers"][part][index] / printed[index])
                for name in ("declared", "fitted")
            ]
            shown.add_row(f"{part} {axis}", *cells)
    cells = [figures(found[name]["paper"]["residual"]) for name in ("declared", "fitted")]
    shown.add_row("residual", *cells)
    for freedom in found["freedom"]:
        cells = [figures(found[name]["freedoms"][freedom]) for name in ("declared", "fitted")]
        shown.add_row(freedom, *cells)
    return shown


def markdown(rows: dict[str, Any]) -> str:
    """The table as Markdown."""
    head = "| mm | " + " | ".join(f"{part} {axis}" for part, axis in COLUMNS) + " |"
    rule = "|---|" + "---|" * len(COLUMNS)
    body = ["| " + " | ".join(line) + " |" for line in lines(rows)]
    title = "Absolute maximum of the position error after settling (Table 1 of the paper).\n"
    return "\n".join([title, head, rule, *body]) + "\n"
