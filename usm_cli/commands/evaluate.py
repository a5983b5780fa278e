"""`usm evaluate`: score policies on a frozen suite or on sampled scenarios."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from usm_baselines.benchmark.leaderboard import ranked
from usm_baselines.benchmark.results import CompetitorScores, EvaluationResult, shifts_in
from usm_baselines.contender import Contender

from usm_cli.score_table import conclusion, legend, shift_table, table
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
from usm_cli.terminal import output_console
from usm_gym.evaluation import Evaluation
from usm_gym.support.files import check_writable
from usm_gym.support.results import Provenance
from usm_gym.support.text import counted
from usm_gym.task.modes import AnyScenario

DESCRIPTION = """\
Score policies. The score of an episode is the largest true position error after settling (5 s, for
the head 10 s, in scans 20 s), in each axis, as in Table 1 of the paper. All policies meet the same
scenarios and the same noise. Prints means over episodes, best first, and who wins; the wider the
terminal, the more columns. A lost robot counts 0.5 m or more in both axes. Where robots are lost,
and in scans, a table also has medians and shares of lost robots; for scans a second one has the
errors after the first, third, fifth and last shift. Without --policies, a short list answers which
controller to take. Under `basin` and `sea` it has all policies that are tuned for them, and beside
them only the paper's `sta` and `pd`. A policy that fails to act is left out of the table and named
with the reason; the exit status is then 1.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm evaluate                                          the short list, fifty frozen scenarios
  usm evaluate --policies all                           all competitors
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
    contenders = chosen_contenders(arguments.policies, scenarios[0])
    chosen = jobs(contenders, scenarios, arguments.time_limit)
    scores, refused = by_name(chosen, scored(chosen, arguments))
    known = {job.contender.name: job.contender for job in chosen}
    if arguments.output:
        write(arguments, scenarios, known, scores, refused)
    if scores:
        many = counted(len(scenarios), "scenario")
        where = f"{suite_name(arguments) or 'sampled'}, {many}, best first"
        show([(known[name], evaluation) for name, evaluation in scores.items()], where)
    leave_if_refused(refused)


def write(
    arguments: argparse.Namespace,
    scenarios: Sequence[AnyScenario],
    known: Mapping[str, Contender],
    scores: Mapping[str, Evaluation],
    refused: Mapping[str, str],
) -> None:
    """Write the file of results."""
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
    result.write(arguments.output)


def show(scores: Sequence[tuple[Contender, Evaluation]], where: str) -> None:
    """Print the table, what its columns mean, and who wins."""
    console = output_console()
    rows = ranked(scores)
    console.print(where, markup=False)
    console.print(table(rows, console))
    if shifts_in(rows.values()):
        console.print(shift_table(rows, console))
    console.print(legend(rows), style="dim", markup=False)
    console.print(f"\n{conclusion(rows)}", style="bold", markup=False)
