"""The verdict of a leaderboard: which policy to take, and what it is the best of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice

from usm_baselines.benchmark.results import CompetitorScores, is_informed
from usm_baselines.families import Family
from usm_baselines.registry import base_of, entry, ids
from usm_baselines.tiers import PAPER

# The most that a calm policy changes its commands, N/s.
CALM = 20.0
# What a policy is told if it foresees what the joints will do.
FORESIGHT = "joint references"
# The paper's law.
LAW = PAPER[0]
# The row that is told all constants of an episode.
TOLD_ALL = "for comparison: knows all constants"

# What a tier stands for.
TIERS = {
    "field": "positions at once, with little noise",
    "basin": "a tank: positions rare and late",
    "sea": "open water: positions rare, late and noisy, and waves",
}

BEST, UNLEARNED = "best overall", "best without learning"
REASONS: dict[str, Callable[[str, CompetitorScores], bool]] = {
    BEST: lambda id, row: True,
    UNLEARNED: lambda id, row: not is_learned(id),
    f"best with at most {CALM:g} N/s": lambda id, row: (
        row.metrics["thrust_variation"].mean <= CALM and not row.failures
    ),
    "best without the joint references": lambda id, row: FORESIGHT not in row.told,
    "the paper's law, best gains": lambda id, row: is_papers(id),
    "the paper's law and gains": lambda id, row: id == LAW,
}


def choices(rows: Mapping[str, CompetitorScores]) -> dict[str, list[str]]:
    """The policies between which a reader will choose, best first, with what each is the best of.

    Args:
        rows: The rows of a suite, best first.
    """
    found: dict[str, list[str]] = {}
    for reason, fits in REASONS.items():
        for id, row in rows.items():
            if row.competitor and fits(id, row):
                found.setdefault(id, []).append(reason)
                break
    told = (id for id, row in rows.items() if not row.competitor and is_informed(id))
    found |= {id: [TOLD_ALL] for id in islice(told, 1)}
    return {id: found[id] for id in rows if id in found}


def front(rows: Mapping[str, CompetitorScores]) -> list[str]:
    """The competitors to which none is ahead in both error and thrust variation, calmest first.

    Without those that lose robots.
    """
    points = {
        id: (row.metrics["thrust_variation"].mean, row.combined[0])
        for id, row in rows.items()
        if row.competitor and not row.failures
    }
    order = sorted(points, key=lambda id: points[id])
    best: list[str] = []
    for id in order:
        if not best or points[id][1] < points[best[-1]][1]:
            best.append(id)
    return best


def is_learned(id: str) -> bool:
    """Whether a policy is, or stands on, a trained network."""
    return id in ids() and entry(id).family is Family.LEARNED


def is_papers(id: str) -> bool:
    """Whether a policy is the paper's law, or one over it, with any gains, lag and estimates."""
    law = base_of(id)
    steers = law in ids() and entry(law).family is Family.HEAD
    return law == LAW or (steers and law.endswith(f"-{LAW}"))
