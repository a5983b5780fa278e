"""The leaderboard: every policy on every frozen suite, and what follows from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar, Self

from usm_baselines.benchmark.results import (
    CompetitorScores,
    MiddleSummary,
    Summary,
    require_alike,
)
from usm_baselines.benchmark.scoring import TIME_LIMIT, Job, Refusal
from usm_baselines.contender import Contender, contender
from usm_baselines.gains import FRONT, read_gains
from usm_baselines.registry import law_of
from usm_baselines.tiers import PAPER, meant_for
from usm_gym.evaluation import Evaluation
from usm_gym.statistics import compare, interquartile_mean, interval, told_apart
from usm_gym.suites import NAMES, suite
from usm_gym.support.results import Interval, Part, Provenance, Result
from usm_gym.support.validation import Count, Number, Switch, require, validated
from usm_gym.task.conditions import IN_SPACE
from usm_gym.task.metrics import ANGLE_ERROR, MAX_ERROR, attitude_of, axes_of
from usm_gym.task.modes import AnyScenario, kind_of, of_head
from usm_gym.task.nominal import shared_nominal


@dataclass(frozen=True)
class Board:
    """The suites whose scores stand in one leaderboard: of body or head, in the plane or in space.

    Attributes:
        main: The suite that counts; the others are named after it, but for those of other modes.
        folder: Where in the results of a version it is.
    """

    main: str
    folder: str = ""

    @property
    def still(self) -> str:
        """Name of the control: the main suite with the joints still."""
        return f"{self.main}, joints still"

    @property
    def tiers(self) -> dict[str, str]:
        """By tier, the suite on which policies for it and for the others are compared."""
        named = {tier: f"{self.main}-{tier}" for tier in ("basin", "sea")}
        return {"field": self.main} | {tier: name for tier, name in named.items() if name in NAMES}

    def suites(self) -> dict[str, list[AnyScenario]]:
        """The frozen suites, and of the body the control."""
        known = {name: suite(name) for name in NAMES}
        kind = kind_of(known[self.main][0].mode)
        chosen = {name: them for name, them in known.items() if kind_of(them[0].mode) is kind}
        if not of_head(known[self.main][0].mode):
            chosen[self.still] = [
                replace(scenario, conditions=replace(scenario.conditions, motion=False))
                for scenario in chosen[self.main]
            ]
        return chosen


PLANE, SPACE = Board("operation"), Board("operation3d", "space")
HEAD, SPACE_HEAD = Board("head", "head"), Board("head3d", "head3d")
BOARDS = (PLANE, SPACE, HEAD, SPACE_HEAD)


@validated
class Lead:
    """Whether a row is better than the next.

    Attributes:
        episodes: From how many episodes.
        probability: That an episode goes better.
        ci95: Its 95 % interval.
        decided: Whether the data decide.
    """

    episodes: Count
    probability: Number
    ci95: Interval
    decided: Switch

    @classmethod
    def over(cls, worse: Evaluation, better: Evaluation) -> Self:
        """The lead of the better scores over the worse."""
        compared = compare(worse.objective(), better.objective())
        return cls(
            episodes=compared.episodes,
            probability=compared.improvement,
            ci95=compared.improvement_ci95,
            decided=compared.decided,
        )


@validated
class Standing(CompetitorScores):
    """A row of the leaderboard.

    Attributes:
        metrics: Summaries by metric, for the largest errors with the middle half.
        beats_next: Its lead over the next row; None before a row that is no competitor, and last.
    """

    metrics: Mapping[str, MiddleSummary | Summary]
    beats_next: Lead | None = None

    def __post_init__(self) -> None:
        """Refuse errors without their middle half."""
        super().__post_init__()
        require(len(self.middle) == len(self.axes), "metrics", list(self.errors), "with iqm")

    @property
    def middle(self) -> list[MiddleSummary]:
        """The largest errors, one per axis, m."""
        return [error for error in self.errors.values() if isinstance(error, MiddleSummary)]


@validated
class FrontPoint(Part):
    """A point of error against thrust variation.

    Attributes:
        means: Means of the largest errors by axis, m, and of the thrust variation, N/s.
    """

    beside: ClassVar[str] = "means"
    means: Mapping[str, Number]

    def __post_init__(self) -> None:
        """Refuse a point without coordinates."""
        names = list(self.means)
        valid = axes_of(names) and "thrust_variation" in names
        require(valid, "point of the front", names, f"{MAX_ERROR}AXIS and thrust_variation")

    @property
    def errors(self) -> dict[str, float]:
        """Mean of the largest error, m, by axis."""
        return {axis: self.means[MAX_ERROR + axis] for axis in axes_of(self.means)}

    @property
    def thrust_variation(self) -> float:
        """Mean thrust variation, N/s."""
        return self.means["thrust_variation"]


@validated
class LeaderboardResult(Result):
    """The leaderboard, as `usm leaderboard` writes it.

    Attributes:
        version: Version of usm-gym.
        suites: Rows by suite and policy, best first.
        front: Points of the policies that are tuned with other weights, by the policy's id.
        refused: Why a policy has no row, by suite and policy.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "leaderboard"
    version: str
    suites: Mapping[str, Mapping[str, Standing]]
    front: Mapping[str, tuple[FrontPoint, ...]]
    refused: Mapping[str, Mapping[str, str]]
    provenance: Provenance

    def __post_init__(self) -> None:
        """Refuse a leaderboard without a main suite, and rows that cannot be compared."""
        mains = [board.main for board in BOARDS]
        counts = [main for main in mains if main in self.suites]
        require(counts, "suites", list(self.suites), f"{' or '.join(mains)} among them")
        for name, rows in self.suites.items():
            require(rows, f"rows of {name}", 0, "one policy or more")
            require_alike(rows.values())
        axes = {row.axes for rows in self.suites.values() for row in rows.values()}
        axes |= {tuple(point.errors) for points in self.front.values() for point in points}
        require(len(axes) == 1, "axes", sorted(axes), "the same in all suites")

    @property
    def board(self) -> Board:
        """Whose suites these are."""
        return next(board for board in BOARDS if board.main in self.suites)

    @property
    def main(self) -> Mapping[str, Standing]:
        """The rows of the main suite."""
        return self.suites[self.board.main]

    @property
    def tiers(self) -> dict[str, Mapping[str, Standing]]:
        """The rows of the suites that stand for the tiers, by tier."""
        listed = self.board.tiers.items()
        return {tier: self.suites[name] for tier, name in listed if name in self.suites}

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the task."""
        return next(iter(self.main.values())).axes


@dataclass(frozen=True)
class Place:
    """One policy on one suite.

    Attributes:
        suite: Name of the suite; that of `front` for gains tuned with other weights.
        job: What is scored.
    """

    suite: str
    job: Job


def everyone(scenarios: Sequence[AnyScenario]) -> list[Contender]:
    """All policies that are meant for scenarios, also those on request and no competitors."""
    return [contender(id) for id in meant_for(scenarios[0].conditions, scenarios[0].mode)]


def front() -> dict[str, list[Contender]]:
    """Policies with the shipped gains of other weights, from the smallest weight on, by id."""
    weighted: dict[str, list[tuple[float, Contender]]] = {}
    for file in sorted(FRONT.glob("*.json")):
        gains = read_gains(file)
        row = weighted.setdefault(gains.policy, [])
        row.append((gains.weight, contender(f"{gains.policy}@{file}")))
    return {
        id: [policy for _, policy in sorted(row, key=lambda pair: pair[0])]
        for id, row in weighted.items()
    }


def places(
    contenders: Sequence[Contender] | None,
    fronts: Mapping[str, Sequence[Contender]],
    chosen: Mapping[str, Sequence[AnyScenario]],
    time_limit: float = TIME_LIMIT,
) -> list[Place]:
    """Every policy on every suite, and the fronts on the main one.

    Without policies, everyone on the suites that they are meant for.
    """
    listed = []
    for name, scenarios in chosen.items():
        nominal = shared_nominal(scenarios)
        besides = [policy for row in fronts.values() for policy in row if name == PLANE.main]
        meeting = everyone(scenarios) if contenders is None else contenders
        for policy in (*meeting, *besides):
            listed.append(Place(name, Job(policy, tuple(scenarios), nominal, time_limit)))
    return listed


def leaderboard(
    scored: Sequence[tuple[Place, Evaluation | Refusal]],
    fronts: Mapping[str, Sequence[Contender]],
    version: str,
    provenance: Provenance,
) -> LeaderboardResult:
    """Rows by suite, best first; the fronts; and the reasons why rows are missing.

    Raises:
        UsageError: If no policy has a score on the main suite.
    """
    refused: dict[str, dict[str, str]] = {}
    scores: dict[str, dict[str, tuple[Contender, Evaluation]]] = {}
    for place, outcome in scored:
        contender = place.job.contender
        if isinstance(outcome, Refusal):
            refused.setdefault(place.suite, {})[contender.name] = outcome.reason
        else:
            scores.setdefault(place.suite, {})[contender.name] = contender, outcome
    main = scores.get(PLANE.main, {})
    points = {
        id: [point(main.pop(policy.name)[1]) for policy in row if policy.name in main]
        for id, row in fronts.items()
    }
    suites = {name: ranked(list(pairs.values())) for name, pairs in scores.items() if pairs}
    return LeaderboardResult(
        version=version,
        suites=suites,
        front={id: tuple(row) for id, row in points.items()},
        refused=refused,
        provenance=provenance,
    )


def ranked(scores: Sequence[tuple[Contender, Evaluation]]) -> dict[str, Standing]:
    """The rows of a suite: competitors first, the smaller objective first."""

    def rank(pair: tuple[Contender, Evaluation]) -> tuple[bool, float]:
        return pair[0].privileged, float(pair[1].objective().mean())

    order = sorted(scores, key=rank)
    leads = {
        better.name: Lead.over(other, one)
        for (better, one), (worse, other) in pairwise(order)
        if not worse.privileged
    }
    return {
        contender.name: standing(outcome, contender, leads.get(contender.name))
        for contender, outcome in order
    }


def ranks(rows: Mapping[str, CompetitorScores]) -> dict[str, int | None]:
    """The ranks of rows, best first, by policy; None of those that are no competitors.

    Going down, a row shares the rank of the first row of the current group if the data do not tell
    it from that row; otherwise it opens a new group with its own place: 1, 2, 2, 4.
    """
    found: dict[str, int | None] = dict.fromkeys(rows)
    competing = [id for id, row in rows.items() if row.competitor]
    if not competing:
        return found
    apart, first = told_apart([rows[id].objectives for id in competing]), 0
    for place, id in enumerate(competing):
        if apart[first, place]:
            first = place
        found[id] = first + 1
    return found


def best_of_laws(rows: Mapping[str, Standing]) -> dict[str, Standing]:
    """Of rows, best first: every law with its best gains, the calmer ones, and those of the paper.

    Calmer are gains if none that are better change the thrust less. A law that is told the lag is
    not another law here.
    """
    calmest: dict[str, float] = {}
    kept: dict[str, Standing] = {}
    for id, row in rows.items():
        law, variation = law_of(id).removesuffix("-lag"), row.metrics["thrust_variation"].mean
        if id in PAPER or variation < calmest.get(law, math.inf):
            kept[id] = row
        calmest[law] = min(variation, calmest.get(law, math.inf))
    return kept


def crossed(result: LeaderboardResult) -> dict[str, dict[str, str]]:
    """Laws whose gains for every tier were scored in every tier.

    Returns:
        By law, its policies by the tier for which they are tuned.
    """
    tiers = result.board.tiers
    if not all(suite in result.suites for suite in tiers.values()):
        return {}
    laws: dict[str, dict[str, str]] = {}
    for id, row in result.main.items():
        tier = (row.tuned_for or "").removesuffix(IN_SPACE)
        if tier in tiers and id != law_of(id):
            laws.setdefault(law_of(id), {})[tier] = id
    rows = result.tiers.values()
    return {
        law: {tier: tuned[tier] for tier in tiers}
        for law, tuned in laws.items()
        if set(tuned) == set(tiers) and all(id in each for each in rows for id in tuned.values())
    }


def standing(scores: Evaluation, contender: Contender, lead: Lead | None) -> Standing:
    """A policy's row: the summary of its scores, interquartile means, and the main episodes."""
    summary = scores.summary()
    errors = [MAX_ERROR + axis for axis in axes_of(scores.per_episode)]
    for name in errors:
        episodes = scores.per_episode[name]
        summary[name]["iqm"] = float(interquartile_mean(episodes))
        summary[name]["iqm_ci95"] = list(interval(interquartile_mean, episodes))
    attitude = [angle + ANGLE_ERROR for angle in attitude_of(scores.per_episode)]
    kept = (*errors, *attitude, "thrust_variation", "failed")
    summary["per_episode"] = {name: summary["per_episode"][name] for name in kept}
    return Standing.of(summary, **Standing.about(contender), beats_next=lead)


def point(scores: Evaluation) -> FrontPoint:
    """A policy's place in error against thrust variation."""
    names = (*(MAX_ERROR + axis for axis in axes_of(scores.per_episode)), "thrust_variation")
    return FrontPoint(means={name: float(scores.per_episode[name].mean()) for name in names})
