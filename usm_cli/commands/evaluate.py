"""`usm evaluate`: score policies on a frozen suite or on sampled scenarios."""

from __future__ import annotations

import argparse
from typing import Any

from rich.table import Table
from usm_baselines.benchmark.leaderboard_page import MARK
from usm_baselines.benchmark.results import (
    CompetitorScores,
    EvaluationResult,
    attitude_in,
    lost,
    medians_in,
    over_informed,
    rms_in,
    shifts_in,
)

from usm_cli.selection import (
    POLICIES,
    add_policies,
    add_scenarios,
    add_scoring,
    by_name,
    chosen_contenders,
    chosen_scenarios,
    jobs,
    leave_if_refused,
    scored,
    seeds,
    suite_name,
)
from usm_cli.terminal import empty_table, output_console
from usm_gym.support.files import check_writable
from usm_gym.support.results import Provenance
from usm_gym.support.text import degrees, figures, mm

DESCRIPTION = """\
Score policies. The score of an episode is the largest true position error after settling (5 s, in
scans 20 s), in each axis, as in Table 1 of the paper. All policies meet the same scenarios and the
same noise. Prints means over episodes with 95 % bootstrap intervals; a lost robot counts 0.5 m or
more in both axes. Where robots are lost, and in scans, medians and shares of lost robots stand
beside the means; for scans a second table has the errors after the first, third, fifth and last
shift. Policies that are tuned for `basin` or `sea` are scored there by default and nowhere else,
and there beside them only the paper's `sta` and `pd`. A policy that fails to act is left out of the
table and named with the reason; the exit status is then 1.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm evaluate                                          all competitors, fifty frozen scenarios
  usm evaluate --policies sta,pd --suite torpedo        two of them in torpedo mode
  usm evaluate --policies sta --seed 7 --episodes 200   sampled scenarios
  usm evaluate --conditions ideal                       the suite without noise, lag and current
  usm evaluate --conditions basin                       the suite operation-basin, its policies
  usm evaluate --suite operation-basin --policies lqg-tuned,lqg-basin,lqg-sea
  usm evaluate --conditions '{{"position_noise": 0}}'     "field" with one field changed
  usm evaluate --policies sta --output sta.json         keep the scores of every episode
  usm evaluate --policies sta,sta@gains.json            your own gains, see usm tune
  usm evaluate --policies sta,my_module:MyController    your own controller
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
    contenders = chosen_contenders(arguments.policies, scenarios[0].conditions)
    chosen = jobs(contenders, scenarios, arguments.time_limit)
    scores, refused = by_name(chosen, scored(chosen, arguments))
    known = {job.contender.name: job.contender for job in chosen}
    result = EvaluationResult(
        suite=suite_name(arguments),
        conditions=scenarios[0].conditions,
        conditions_override=arguments.conditions,
        settle_time=scenarios[0].settle_time,
        episodes=len(scenarios),
        scenarios=tuple(scenarios),
        results={
            name: CompetitorScores.of(evaluation.summary(), **CompetitorScores.about(known[name]))
            for name, evaluation in scores.items()
        },
        refused=refused,
        provenance=Provenance.here(seeds(arguments)),
    )
    if result.results:
        output_console().print(table(result))
        if shifts_in(result.results.values()):
            output_console().print(shift_table(result))
    if arguments.output:
        result.write(arguments.output)
    leave_if_refused(refused)


def table(result: EvaluationResult) -> Table:
    """The scores for the terminal, errors in mm."""
    axes, medians = result.axes, medians_in(result.results.values())
    headings = [*axes]
    if medians:  # leaves less room
        headings += [f"{what}\n{' / '.join(axes)}" for what in ("median", "worst")]
    else:
        headings += [f"worst {axis}" for axis in axes]
        headings += [f"rms {axis}" for axis in rms_in(result.results.values())]
    headings += [f"{angle}\n°" for angle in attitude_in(result.results.values())]
    ratios = over_informed(result.results)
    headings += ["over\ninformed"] if ratios else []
    where = f"{result.suite or 'sampled'}, {result.episodes} episodes"
    rows = empty_table(
        "policy",
        numbers=(*headings, "variation\nN/s", "objective\nmm", "lost"),
        title=f"largest position error after settling, mm: mean [95 % interval] ({where})",
    )
    rows.columns[0].no_wrap = True
    for name, row in ordered(result):
        errors = row.errors.values()
        cells = [f"{mm(e.mean)} [{mm(e.ci95[0])}, {mm(e.ci95[1])}]" for e in errors]
        worst = [mm(e.worst) for e in errors]
        if medians:
            cells += [" / ".join(map(mm, row.medians.values())), " / ".join(worst)]
        else:
            cells += [*worst, *(mm(e.mean) for e in row.rms.values())]
        cells += [degrees(e.mean) for e in row.attitude.values()]
        cells += [ratios[name]] if ratios else []
        cells += [figures(row.metrics["thrust_variation"].mean), figures(row.objective)]
        cells.append(lost(row, bool(medians)))
        rows.add_row(f"{name} {MARK}" if row.note else name, *cells)
    notes = {row.note for row in result.results.values() if row.note}
    rows.caption = "; ".join(f"{MARK} {note}" for note in sorted(notes)) or None
    return rows


def shift_table(result: EvaluationResult) -> Table:
    """The errors by shift for the terminal, mm."""
    shifts = shifts_in(result.results.values())
    axes = " / ".join(result.axes)
    rows = empty_table(
        "policy",
        numbers=shifts,
        title=f"largest position error from a shift to the next, mm, {axes}, mean",
    )
    for name, row in ordered(result):
        errors = (row.by_shift[shift].values() for shift in shifts)
        rows.add_row(name, *(" / ".join(mm(e.mean) for e in each) for each in errors))
    return rows


def ordered(result: EvaluationResult) -> list[tuple[str, CompetitorScores]]:
    """The rows, best first."""
    return sorted(result.results.items(), key=lambda pair: pair[1].objective)
