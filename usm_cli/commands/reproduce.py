"""`usm reproduce`: run the paper's Table 1 and figures anew, and study its open items."""

from __future__ import annotations

import argparse
import math
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table
from usm_baselines.paper.reproduction import (
    AXES,
    PARTS,
    PRINTED,
    SAMPLE_TIME,
    STEP,
    ReproductionResult,
    cases,
    reproduction,
    run_cases,
)
from usm_baselines.paper.reproduction_figures import NAMES

from usm_cli.options import output_folder
from usm_cli.terminal import empty_table, output_console, progress_bar
from usm_gym.support.files import write_text
from usm_gym.support.results import Provenance
from usm_gym.support.text import figures, mm
from usm_gym.support.validation import require

if TYPE_CHECKING:  # its import takes time
    from usm_baselines.paper.reproduction_fit import FitResult

DESCRIPTION = """\
Run the paper as printed, with explicit laws and observer at a step of 1e-5 s, ideal thrusters
without limit and the paper's gains, on the declared scenario `table1`. Prints our Table 1 beside
the paper's. With --output, also writes table1.json, table1.md and the figures into a folder (extra
`render`). Takes less than a minute on two cores.

--study and --fit write into the same folder and take some minutes. After an interruption, run them
again to continue.
"""
EXAMPLES = """\
examples:
  usm reproduce                                    the table
  usm reproduce --output paper                     the table and all figures
  usm reproduce --output paper --figures fig05,fig07
  usm reproduce --step 1e-4                        another step
  usm reproduce --output paper --study             vary the open items one at a time
  usm reproduce --output paper --fit               refit the declared scenario
"""
GENERATIONS = 60


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "reproduce",
        help="run the paper's Table 1 and figures anew",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add = parser.add_argument
    add("--output", metavar="DIR", help="folder for the table and the figures")
    add("--figures", metavar="A,B", help=f"figures to draw ({', '.join(NAMES)}; default: all)")
    add("--step", type=float, default=STEP, metavar="S", help="step, s (default: 1e-5)")
    other = parser.add_mutually_exclusive_group()
    other.add_argument("--study", action="store_true", help="vary every open item instead")
    other.add_argument("--fit", action="store_true", help="refit the declared scenario instead")
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
        line = bar.add_task("runs", total=len(chosen))
        records = run_cases(chosen, workers(), lambda: bar.advance(line))
    result = reproduction(step, records, Provenance.here({}))
    output_console().print(terminal_table(result))
    if folder is None:
        return
    result.write(folder / "table1.json")
    write_text(folder / "table1.md", markdown(result))
    from usm_baselines.paper.reproduction_figures import draw

    draw(names, result, records, folder)


def run_study(folder: Path) -> None:
    """Run the sensitivity study, write study.json, study.png and study.svg."""
    from usm_baselines.paper.sensitivity import study, trials
    from usm_baselines.paper.sensitivity_figure import draw_study

    with progress_bar() as bar:
        line = bar.add_task("study")
        result = study(
            folder / "study.json",
            workers(),
            lambda done, total: bar.update(line, completed=done, total=total),
            trials(),
        )
    draw_study(result, folder / "study")


def run_fit(folder: Path) -> None:
    """Refit the declared scenario, write fit.json, print the fit."""
    from usm_baselines.paper.reproduction_fit import fit

    with progress_bar() as bar:
        line = bar.add_task("fit")
        result = fit(
            folder / "fit.json",
            GENERATIONS,
            workers(),
            lambda done, total: bar.update(line, completed=done, total=total),
        )
    output_console().print(fit_table(result))


def workers() -> int:
    """One thread per core."""
    return os.cpu_count() or 1


def chosen_figures(text: str | None) -> list[str]:
    """The figures that the argument names."""
    if text is None:
        return list(NAMES)
    chosen = [name.strip() for name in text.split(",") if name.strip()]
    require(chosen and set(chosen) <= set(NAMES), "--figures", text, ", ".join(NAMES))
    return chosen


def check_step(step: float) -> None:
    """Refuse a step that does not meet the instants of the records."""
    count = SAMPLE_TIME / step if step > 0 else 0.0
    require(
        1.0 <= count < math.inf and abs(count - round(count)) < 1e-6 * count,
        "--step",
        step,
        f"a positive number of which {SAMPLE_TIME:g} s is a multiple",
    )


def headings(result: ReproductionResult, between: str) -> list[str]:
    """The headings of the columns of `lines` but for the first."""
    return [*(f"{part}{between}{axis}" for part, axis in columns(result)), f"joints,{between}N m"]


def columns(result: ReproductionResult) -> list[tuple[str, str]]:
    """The columns of the table, as pairs of part and axis."""
    return [(part, axis) for part in PARTS for axis in result.axes]


def lines(result: ReproductionResult) -> list[list[str]]:
    """Our rows, the paper's and their ratio, mm, and our largest joint torque, N m, as text."""
    places = columns(result)
    listed = []
    for name, row in result.rows.items():
        torque = figures(result.peak_joint_torque[name]["operation"])
        listed.append([f"{name}, ours", *(mm(row[part][axis]) for part, axis in places), torque])
        if name in result.paper:
            theirs = [mm(result.paper[name][part][axis]) for part, axis in places]
            listed.append([f"{name}, paper", *theirs, ""])
        if printed := result.printed(name):
            ratios = [figures(row[part][axis] / printed[part][axis]) for part, axis in places]
            title = "ratio" if name in result.paper else f"ratio to {PRINTED[name]}, paper"
            listed.append([title, *ratios, ""])
    return listed


def terminal_table(result: ReproductionResult) -> Table:
    """Table 1 for the terminal."""
    shown = empty_table(
        "",
        numbers=headings(result, "\n"),
        title="absolute maximum of the position error after settling, mm, and of the joint torques "
        "in operation mode",
    )
    for line in lines(result):
        shown.add_row(*line)
    return shown


def fit_table(result: FitResult) -> Table:
    """The fitted numbers and the free parameters, for the terminal."""
    shown = empty_table(
        "",
        numbers=("declared", "fitted"),
        title="ours over the paper's at a step of 1e-5 s, and the free parameters",
    )
    candidates = (result.declared, result.fitted)
    for part, printed in result.seen.items():
        for index, axis in enumerate(AXES):
            errors = [candidate.paper.numbers[part][index] for candidate in candidates]
            ratios = [error / printed[index] for error in errors]
            shown.add_row(f"{part} {axis}", *map(figures, ratios))
    residuals = [candidate.paper.residual for candidate in candidates]
    shown.add_row("residual", *map(figures, residuals))
    for freedom in result.freedom:
        values = [candidate.freedoms[freedom] for candidate in candidates]
        shown.add_row(freedom, *map(figures, values))
    return shown


def markdown(result: ReproductionResult) -> str:
    """The table as Markdown."""
    numbers = headings(result, " ")
    head = "| | " + " | ".join(numbers) + " |"
    rule = "|---|" + "---|" * len(numbers)
    body = ["| " + " | ".join(line) + " |" for line in lines(result)]
    title = (
        "Absolute maximum of the position error after settling, mm (Table 1 of the paper), and of "
        "the joint torques in operation mode.\n"
    )
    return "\n".join([title, head, rule, *body]) + "\n"
