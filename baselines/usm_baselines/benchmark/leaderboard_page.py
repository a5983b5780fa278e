"""The leaderboard as Markdown, as CSV, and as verdict and table in the README."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Mapping, Sequence

from usm_baselines.benchmark.leaderboard import (
    Lead,
    LeaderboardResult,
    Standing,
    crossed,
    ranks,
)
from usm_baselines.benchmark.results import (
    CompetitorScores,
    Summary,
    attitude_in,
    axes_in,
    lost,
    medians_in,
    over_informed,
    prices,
    rms_in,
    shifts_in,
)
from usm_baselines.benchmark.verdict import BEST, TIERS, UNLEARNED, choices
from usm_baselines.registry import POSITION_ONLY
from usm_gym.statistics import FEWEST_EPISODES
from usm_gym.support.text import degrees, figures, give_or_take, listed, mm
from usm_gym.support.validation import require

# The tier of which the verdict speaks first.
TANK = "basin"
FIGURE = """\
Further down and to the left is better. Grey dots are all other policies; nobody is beyond the grey
line. Dotted is `informed`, which knows all constants of an episode and does not compete.
"""
MARKS = ("<!-- leaderboard -->", "<!-- end of leaderboard -->")
# Marks a policy about whose scores there is a note.
MARK = "†"
# Metrics without columns in the CSV file.
NO_COLUMN = ("saturation_share",)
LEGEND = """\
Largest position error after settling, mm: mean over the episodes, with half of its 95 % interval;
worst episode.{turned} Variation is how much the command of a thruster changes in a second. Rows are
ordered by the objective by which gains and agents are chosen: the means in {axes} added up, plus
{prices}. Going down, rows share a rank (=) until the data tell one from the first of them. "Beats
the next" says whether the interval of the paired difference to the next row leaves out 0, and with
what probability an episode goes better. "Over informed" is a row's means over those of the law that
is told what is constant in an episode: the distance that knowledge could close.

`leaderboard.csv` has every metric with its interval. `usm report` makes a page of the file
`leaderboard.json`, whose tables sort and compare each row with a rival of your choice.
"""
MEDIAN_LEGEND = """\
Where robots are lost, and in scans, a table also has the median of the largest error and the
share of lost robots; a lost one counts as half a metre or more in the mean.
"""
SHIFT_LEGEND = "Largest error from a shift of the joint references to the next, mm, mean, {axes}.\n"
TOLD_LEGEND = "Besides the measured position and the reference, which all policies know:\n"
CROSS_LEGEND = """\
Gains tuned for one tier of conditions, scored in all: largest error after settling, mm, mean,
{axes}.
"""


def table(rows: Mapping[str, Standing]) -> str:
    """The rows of a suite as Markdown, with no more than what a reader compares them by."""
    axes, places, ratios = axes_in(rows.values()), rank_labels(rows), over_informed(rows)
    medians, each = medians_in(rows.values()), " / ".join(axes)
    columns = [f"error {' + '.join(axes)}, mm", *(f"{axis}, mm" for axis in axes), f"worst {each}"]
    columns += [f"median {each}"] if medians else []
    columns += [f"{angle}, °" for angle in attitude_in(rows.values())]
    columns += ["variation, N/s", "lost"]
    columns += [*(["over informed"] if ratios else []), "beats the next"]
    lines = [f"| rank | policy | {' | '.join(columns)} |", f"|---:|---|{'---:|' * len(columns)}"]
    for id, row in rows.items():
        mean, margin = row.combined
        errors, lead = row.errors.values(), row.beats_next
        cells = [give_or_take(1e3 * mean, 1e3 * margin), *(mm(error.mean) for error in errors)]
        cells.append(" / ".join(mm(error.worst) for error in errors))
        cells += [" / ".join(map(mm, row.medians.values()))] if medians else []
        cells += [degrees(error.mean) for error in row.attitude.values()]
        cells += [figures(row.metrics["thrust_variation"].mean), lost(row, bool(medians))]
        cells += [ratios[id]] if ratios else []
        cells.append("" if lead is None else f"{in_short(lead)} ({lead.probability:.2f})")
        lines.append(_line(places[id], id, row, cells))
    return "\n".join([*lines, *_notes(rows)]) + "\n"


def verdict_table(rows: Mapping[str, Standing], decisions: Mapping[str, float]) -> str:
    """The policies to choose from and what each is the best of, as Markdown.

    Args:
        rows: The rows of a suite, best first.
        decisions: How long policies take for a decision, us, as far as it is known.
    """
    axes, places = axes_in(rows.values()), rank_labels(rows)
    columns = ["rank", "policy", "why", f"error {' + '.join(axes)}, mm", "variation, N/s"]
    columns += ["decision, µs"] if decisions else []
    lines = [f"| {' | '.join(columns)} |", "|---:|---|---|" + "---:|" * (len(columns) - 3)]
    for id, reasons in choices(rows).items():
        mean, margin = rows[id].combined
        cells = [places[id], f"`{id}`", ", ".join(reasons), give_or_take(1e3 * mean, 1e3 * margin)]
        cells.append(figures(rows[id].metrics["thrust_variation"].mean))
        if decisions:
            cells.append(figures(decisions[id]) if id in decisions else "")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def brief_table(rows: Mapping[str, Standing]) -> str:
    """The README's whole table, in fewer columns."""
    axes, angles = axes_in(rows.values()), attitude_in(rows.values())
    rms_axes = " / ".join(rms_in(rows.values()))
    columns = ["told", *(f"{axis}, mm" for axis in axes), f"rms {rms_axes}"]
    columns += [f"worst {' / '.join(axes)}", *(f"{angle}, °" for angle in angles)]
    lines = _head([*columns, "variation, N/s", "lost"])
    places = rank_labels(rows)
    for id, row in rows.items():
        errors = row.errors.values()
        rms = " / ".join(mm(error.mean) for error in row.rms.values())
        worst = " / ".join(mm(error.worst) for error in errors)
        attitude = [degrees(error.mean) for error in row.attitude.values()]
        variation = figures(row.metrics["thrust_variation"].mean)
        cells = [row.told, *map(_mean, errors), rms, worst, *attitude, variation]
        lines.append(_line(places[id], id, row, [*cells, str(row.failures)]))
    return "\n".join([*lines, *_notes(rows)]) + "\n"


def shift_table(rows: Mapping[str, Standing]) -> str:
    """The errors by shift of a suite of scans, as Markdown."""
    shifts = shifts_in(rows.values())
    lines = [f"| policy | {' | '.join(shifts)} |", "|---|" + "---:|" * len(shifts)]
    for id, row in rows.items():
        cells = [_means(row.by_shift[shift]) for shift in shifts]
        lines.append(f"| {id} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def cross_table(result: LeaderboardResult) -> str:
    """Laws with the gains for every tier in every tier, as Markdown; empty if there are none."""
    laws = crossed(result)
    if not laws:
        return ""
    suites = result.board.tiers.values()
    lines = [f"| law | tuned for | {' | '.join(suites)} |", "|---|---|" + "---:|" * len(suites)]
    for law, policies in laws.items():
        for tier, id in policies.items():
            rows = [each[id] for each in result.tiers.values()]
            cells = [f"{_means(row.errors)}, {lost(row, True)} lost" for row in rows]
            lines.append(f"| {law} | {tier} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def rank_labels(rows: Mapping[str, CompetitorScores]) -> dict[str, str]:
    """The rows' ranks as text, with "=" where several share one."""
    found = ranks(rows)
    shared = Counter(found.values())

    def label(rank: int | None) -> str:
        return "" if rank is None else f"{rank}=" if shared[rank] > 1 else str(rank)

    return {id: label(rank) for id, rank in found.items()}


def in_short(lead: Lead) -> str:
    """Whether the data decide, in a word or two."""
    if lead.episodes < FEWEST_EPISODES:
        return "too few"
    return "yes" if lead.decided else "undecided"


def markdown(result: LeaderboardResult) -> str:
    """The whole leaderboard as Markdown."""
    angles = attitude_in(result.main.values())
    legend = LEGEND.format(
        axes=listed(result.axes),
        turned=f" Largest {listed(angles)} error, °." if angles else "",
        prices=prices(angles),
    )
    axes = " / ".join(result.axes)
    parts = [f"# Leaderboard of usm-gym {result.version}\n", legend]
    if any(medians_in(rows.values()) for rows in result.suites.values()):
        parts.append(MEDIAN_LEGEND)
    for name, rows in result.suites.items():
        episodes = next(iter(rows.values())).episodes
        parts.append(f"## {name} ({episodes} episodes)\n")
        parts.append(table(rows))
        if shifts_in(rows.values()):
            parts += [SHIFT_LEGEND.format(axes=axes), shift_table(rows)]
        for id, reason in result.refused.get(name, {}).items():
            parts.append(f"{id} is refused: {reason}\n")
    if table_of_tiers := cross_table(result):
        parts += ["## Gains across tiers\n", CROSS_LEGEND.format(axes=axes), table_of_tiers]
    parts += ["## What the policies are told\n", TOLD_LEGEND, knowledge(result)]
    return "\n".join(parts)


def knowledge(result: LeaderboardResult) -> str:
    """What the policies are told, and which are told the same, as Markdown."""
    told = {id: row.told for rows in result.suites.values() for id, row in rows.items()}
    lines = []
    for known in dict.fromkeys(told.values()):
        alike = ", ".join(id for id, its in sorted(told.items()) if its == known)
        lines.append(f"- {'nothing' if known == POSITION_ONLY else known}: {alike}\n")
    return "".join(lines)


def verdict(result: LeaderboardResult, figure: str, decisions: Mapping[str, float]) -> str:
    """The verdict in every tier: the figure, and the policies to choose from.

    Args:
        result: The leaderboard.
        figure: Where the figure is, from the page.
        decisions: As of `verdict_table`.
    """
    axes, tiers = " + ".join(result.axes), result.tiers
    parts = [f"{advice(tiers[TANK], decisions)}\n"] if TANK in tiers else []
    parts += [f"![Error {axes} against thrust variation, tier by tier]({figure})\n", FIGURE]
    for tier, rows in tiers.items():
        parts += [f"**In `{tier}`**, {TIERS[tier]}\n", verdict_table(rows, decisions)]
    return "\n".join(parts)


def advice(rows: Mapping[str, Standing], decisions: Mapping[str, float]) -> str:
    """What to take, with its error, thrust variation and time, in a sentence."""
    found = {reason: id for id, reasons in choices(rows).items() for reason in reasons}

    def cost(id: str) -> str:
        mean, margin = rows[id].combined
        error = f"{give_or_take(1e3 * mean, 1e3 * margin)} mm"
        variation = f"{figures(rows[id].metrics['thrust_variation'].mean)} N/s"
        took = [f"{figures(1e-3 * decisions[id])} ms per decision"] if id in decisions else []
        return ", ".join([f"`{id}` ({error}", variation, *took]) + ")"

    best, plain = (found[reason] for reason in (BEST, UNLEARNED))
    instead = "" if plain == best else f", or without a network {cost(plain)}"
    return f"**For a tank, take {cost(best)}{instead}.** So far, all of this is simulation."


def readme_block(result: LeaderboardResult, figure: str, decisions: Mapping[str, float]) -> str:
    """The verdict, and the whole table of the main suite, between their marks."""
    parts = [MARKS[0], verdict(result, figure, decisions)]
    parts.append(f"<details><summary>All {len(result.main)} policies in `field`</summary>\n")
    parts += [brief_table(result.main), "</details>", MARKS[1], ""]
    return "\n".join(parts)


def with_table(
    page: str, result: LeaderboardResult, figure: str, decisions: Mapping[str, float]
) -> str:
    """A page with verdict and table put between its marks; arguments as of `readme_block`.

    Raises:
        ValueError: If the page lacks the marks.
    """
    pattern = re.escape(MARKS[0]) + ".*?" + re.escape(MARKS[1]) + "\n"
    block = readme_block(result, figure, decisions)
    changed, count = re.subn(pattern, lambda match: block, page, flags=re.DOTALL)
    require(count == 1, "marks of the table", count, f"one pair, {MARKS[0]} to {MARKS[1]}")
    return changed


def csv_text(result: LeaderboardResult) -> str:
    """One line per policy and suite; errors in m and rad, thrust in N, variation in N/s.

    A metric that a suite does not have is left empty there.
    """
    listed = [row for rows in result.suites.values() for row in rows.values()]
    names = dict.fromkeys(name for row in listed for name in row.metrics)
    scores = [name for name in names if name not in NO_COLUMN]
    head = ["suite", "rank", "policy", "told", "tuned_for", "competitor", "objective", "failures"]
    for name in scores:
        head += [name, *(f"{name}_{column}" for column in ("low", "high", "worst", "median"))]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(head)
    for suite, rows in result.suites.items():
        places = ranks(rows)
        for id, row in rows.items():
            line: list[object] = [suite, places[id], id, row.told, row.tuned_for, row.competitor]
            line += [row.objective, row.failures]
            for name in scores:
                summary = row.metrics.get(name)
                line += (
                    [None] * 5
                    if summary is None
                    else [summary.mean, *summary.ci95, summary.worst, summary.median]
                )
            writer.writerow(line)
    return out.getvalue()


def _head(columns: Sequence[str]) -> list[str]:
    told, *numbers = columns
    head = f"| rank | policy | {told} | {' | '.join(numbers)} |"
    return [head, "|---:|---|---|" + "---:|" * len(numbers)]


def _line(place: str, id: str, row: Standing, cells: Sequence[str]) -> str:
    name = f"{id} {MARK}" if row.note else id
    name += "" if row.competitor else " (no competitor)"
    return "| " + " | ".join([place, name, *cells]) + " |"


def _notes(rows: Mapping[str, Standing]) -> list[str]:
    notes = sorted({row.note for row in rows.values() if row.note})
    return [f"\n{MARK} {'; '.join(notes)}."] if notes else []


def _means(errors: Mapping[str, Summary]) -> str:
    return " / ".join(mm(error.mean) for error in errors.values())


def _mean(error: Summary) -> str:
    low, high = error.ci95
    return f"{mm(error.mean)} [{mm(low)}, {mm(high)}]"
