"""The leaderboard as Markdown, as CSV, and as the table in the README."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from typing import Any

from usm_baselines.benchmark.leaderboard import MAIN, Document
from usm_gym.statistics import FEWEST_EPISODES
from usm_gym.support.text import figures, mm
from usm_gym.support.validation import require

MARKS = ("<!-- leaderboard -->", "<!-- end of leaderboard -->")
COLUMNS = (
    "x, mm",
    "y, mm",
    "middle half x",
    "middle half y",
    "worst x",
    "worst y",
    "thrust, N",
    "variation, N/s",
    "lost",
    "beats the next",
)
BRIEF_COLUMNS = ("x, mm", "y, mm", "worst x / y", "variation, N/s", "lost")
# Whose gains are kept in the README beside better ones: the paper's.
PAPER = ("sta", "pd")
LEGEND = """\
Largest position error after settling, mm: mean over the episodes with its 95 % interval, mean of
the middle half of the episodes, worst episode. Rows are ordered by the sum of the means in x and y.
"Beats the next" says whether the interval of the paired difference to the next row leaves out 0,
and with what probability an episode goes better.
"""
SCORES = (
    *(f"{name}_{axis}" for name in ("max_error", "settled_error", "rms_error") for axis in "xy"),
    "heading_error",
    "thrust_effort",
    "thrust_variation",
)


def table(rows: Mapping[str, Any]) -> str:
    """The rows of a suite as Markdown."""
    lines = _head(COLUMNS)
    for id, each in rows.items():
        errors = [each[f"max_error_{axis}"] for axis in "xy"]
        cells = _means(errors) + [mm(e["iqm"]) for e in errors] + [mm(e["worst"]) for e in errors]
        cells += [figures(each[key]["mean"]) for key in ("thrust_effort", "thrust_variation")]
        beats = each.get("beats_next")
        decision = "" if beats is None else f"{said(beats)} ({beats['probability']:.2f})"
        lines.append(_line(id, each, [*cells, str(each["failures"]), decision]))
    return "\n".join(lines) + "\n"


def brief_table(rows: Mapping[str, Any]) -> str:
    """The README's table: of each law the better gains, and the paper's, in fewer columns."""
    lines = _head(BRIEF_COLUMNS)
    laws = set()
    for id, each in rows.items():
        law = id.removesuffix("-tuned")
        if law in laws and id not in PAPER:
            continue
        laws.add(law)
        errors = [each[f"max_error_{axis}"] for axis in "xy"]
        worst = " / ".join(mm(e["worst"]) for e in errors)
        variation = figures(each["thrust_variation"]["mean"])
        lines.append(_line(id, each, [*_means(errors), worst, variation, str(each["failures"])]))
    return "\n".join(lines) + "\n"


def _head(columns: Sequence[str]) -> list[str]:
    return [f"| policy | {' | '.join(columns)} |", "|---|" + "---:|" * len(columns)]


def _line(id: str, row: Mapping[str, Any], cells: Sequence[str]) -> str:
    name = id if row["competitor"] else f"{id} (no competitor)"
    return "| " + " | ".join([name, *cells]) + " |"


def _means(errors: Sequence[Mapping[str, Any]]) -> list[str]:
    return [f"{mm(e['mean'])} [{mm(e['ci95'][0])}, {mm(e['ci95'][1])}]" for e in errors]


def said(beats: Mapping[str, Any]) -> str:
    """Whether the data decide, in a word or two."""
    if beats["episodes"] < FEWEST_EPISODES:
        return "too few"
    return "yes" if beats["decided"] else "undecided"


def markdown(found: Document) -> str:
    """The whole leaderboard as Markdown."""
    parts = [f"# Leaderboard of usm-gym {found['version']}\n", LEGEND]
    for name, rows in found["suites"].items():
        episodes = len(next(iter(rows.values()))["per_episode"]["failed"])
        parts.append(f"## {name} ({episodes} episodes)\n")
        parts.append(table(rows))
        for id, reason in found["refused"].get(name, {}).items():
            parts.append(f"{id} is refused: {reason}\n")
    return "\n".join(parts)


def readme_block(found: Document) -> str:
    """The main suite's short table between its marks."""
    return f"{MARKS[0]}\n{brief_table(found['suites'][MAIN])}{MARKS[1]}\n"


def with_table(page: str, found: Document) -> str:
    """A page with the main suite's short table put between its marks.

    Raises:
        ValueError: If the page lacks the marks.
    """
    pattern = re.escape(MARKS[0]) + ".*?" + re.escape(MARKS[1]) + "\n"
    block = readme_block(found)
    changed, count = re.subn(pattern, lambda match: block, page, flags=re.DOTALL)
    require(count == 1, "marks of the table", count, f"one pair, {MARKS[0]} to {MARKS[1]}")
    return changed


def csv_text(found: Document) -> str:
    """One line for each policy on each suite; errors in m, thrust in N, variation in N/s."""
    head = ["suite", "policy", "competitor", "failures"]
    for name in SCORES:
        head += [name, f"{name}_low", f"{name}_high", f"{name}_worst"]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(head)
    for suite_name, rows in found["suites"].items():
        for id, each in rows.items():
            line = [suite_name, id, each["competitor"], each["failures"]]
            for name in SCORES:
                line += [each[name]["mean"], *each[name]["ci95"], each[name]["worst"]]
            writer.writerow(line)
    return out.getvalue()
