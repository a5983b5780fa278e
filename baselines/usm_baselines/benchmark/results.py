"""Scores as files hold them, and the results of `usm evaluate` and `usm compare`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, asdict
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter

from usm_baselines.contender import Contender
from usm_gym.evaluation import SHIFT_METRICS
from usm_gym.statistics import Comparison, mean_interval
from usm_gym.support.results import Interval, Part, Provenance, Result
from usm_gym.support.text import figures, listed
from usm_gym.support.validation import Count, Number, Switch, require, validated
from usm_gym.task.conditions import Conditions
from usm_gym.task.metrics import (
    ANGLE_ERROR,
    ATTITUDE_WEIGHT,
    MAX_ERROR,
    VARIATION_WEIGHT,
    attitude_of,
    axes_of,
    objective,
)
from usm_gym.task.stored_scenario import StoredScenarios

Array = NDArray[np.float64]
Failures = Annotated[int, Field(strict=True, ge=0)]
Share = Annotated[Number, Field(ge=0, le=1)]


@validated
class Summary(Part):
    """A metric over the episodes.

    Attributes:
        mean: Mean.
        ci95: Its 95 % interval.
        worst: Worst episode.
        median: Median, which no lost robot moves; None if it is not kept.
    """

    mean: Number
    ci95: Interval
    worst: Number
    _: KW_ONLY
    median: Number | None = None


@validated
class MiddleSummary(Summary):
    """A metric over the episodes, also without the best and the worst quarter of them.

    Attributes:
        iqm: Mean of the middle half of the episodes.
        iqm_ci95: Its 95 % interval.
    """

    iqm: Number
    iqm_ci95: Interval


@validated
class Scores(Part):
    """Scores of a policy over episodes.

    Attributes:
        metrics: Summaries by metric; in JSON they stand beside the other fields.
        failures: How many episodes lost the robot.
        per_episode: What is kept of the episodes, by metric.
        lost_share: Share of the episodes that lost the robot; None if it is not kept.
    """

    beside: ClassVar[str] = "metrics"
    metrics: Mapping[str, Summary]
    failures: Failures
    per_episode: Mapping[str, tuple[Number | Switch, ...]]
    _: KW_ONLY
    lost_share: Share | None = None

    def __post_init__(self) -> None:
        """Refuse scores that lack what tables and pages show."""
        require(self.axes, "metrics", list(self.metrics), f"one {MAX_ERROR}AXIS or more")
        needed = {
            f"{metric}_{axis}" for metric in ("max_error", "settled_error") for axis in self.axes
        }
        missing = {*needed, "thrust_effort", "thrust_variation"} - set(self.metrics)
        require(not missing, "metrics", list(self.metrics), f"also {', '.join(sorted(missing))}")
        for name in (*(MAX_ERROR + axis for axis in self.axes), "thrust_variation"):
            kept = list(self.per_episode)
            require(name in kept, "per_episode", kept, f"also {name}")
        counts = sorted({len(values) for values in self.per_episode.values()})
        require(len(counts) == 1 and counts[0] > 0, "episodes", counts, "the same for all metrics")

    @classmethod
    def of(cls, summary: Mapping[str, Any], **fields: Any) -> Self:
        """The scores that `usm_gym.evaluation.Evaluation.summary` gives, and more fields."""
        return TypeAdapter(cls).validate_python({**summary, **fields})

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the task, in order."""
        return axes_of(self.metrics)

    @property
    def episodes(self) -> int:
        """How many episodes there are."""
        return len(next(iter(self.per_episode.values())))

    @property
    def errors(self) -> dict[str, Summary]:
        """The largest error after settling, m, by axis."""
        return self.by_axis("max_error")

    @property
    def objective(self) -> float:
        """What policies are ranked by, mm: see `usm_gym.task.metrics.objective`."""
        return float(objective({name: summary.mean for name, summary in self.metrics.items()}))

    @property
    def combined(self) -> tuple[float, float]:
        """The largest errors of all axes added up, m: mean, half the width of its interval."""
        episodes = np.sum([self.per_episode[MAX_ERROR + axis] for axis in self.axes], axis=0)
        mean, (low, high) = mean_interval(episodes)
        return mean, (high - low) / 2

    @property
    def rms(self) -> dict[str, Summary]:
        """The root mean square error after settling, m, by axis, as far as it is kept."""
        known = {axis: self.metrics.get(f"rms_error_{axis}") for axis in self.axes}
        return {axis: error for axis, error in known.items() if error is not None}

    @property
    def attitude(self) -> dict[str, Summary]:
        """The largest error of the attitude after settling, rad, by angle."""
        return {name: self.metrics[name + ANGLE_ERROR] for name in attitude_of(self.metrics)}

    @property
    def medians(self) -> dict[str, float]:
        """The median of the largest error after settling, m, by axis, as far as it is kept."""
        found = {axis: error.median for axis, error in self.errors.items()}
        return {axis: median for axis, median in found.items() if median is not None}

    @property
    def by_shift(self) -> dict[str, dict[str, Summary]]:
        """The largest error after some shifts of a scan, m, by shift and axis; else none."""
        known = [name for name in SHIFT_METRICS if f"{name}_{self.axes[0]}" in self.metrics]
        return {name.removesuffix("_shift_error"): self.by_axis(name) for name in known}

    def by_axis(self, metric: str) -> dict[str, Summary]:
        """The summary of a metric such as "settled_error", by axis."""
        return {axis: self.metrics[f"{metric}_{axis}"] for axis in self.axes}


@validated
class CompetitorScores(Scores):
    """Scores of a policy that is a competitor or not.

    Attributes:
        competitor: False if it is told more than a vehicle knows.
        told: What it is told besides the measured position and the reference; empty if unknown.
        note: What to bear in mind about its scores.
        tuned_for: The preset of conditions for which it was tuned or trained; None if for none.
    """

    competitor: Switch
    told: str = ""
    note: str = ""
    tuned_for: str | None = None

    @property
    def objectives(self) -> Array:
        """The objective of each episode, mm, (episodes,)."""
        kept = {name: np.asarray(values) for name, values in self.per_episode.items()}
        return np.asarray(objective(kept), np.float64)

    @staticmethod
    def about(contender: Contender) -> dict[str, Any]:
        """What is kept of a policy besides its scores."""
        competes = not contender.privileged
        return {
            "competitor": competes,
            "told": contender.told,
            "note": contender.note,
            "tuned_for": contender.tuned_for or None,
        }


def require_alike(rows: Iterable[Scores]) -> None:
    """Refuse rows of one table that differ in their axes or in the number of their episodes.

    Raises:
        UsageError: If they do.
    """
    listed = list(rows)
    axes = list(dict.fromkeys(row.axes for row in listed))
    require(len(axes) <= 1, "axes", axes, "the same for every policy")
    episodes = sorted({row.episodes for row in listed})
    require(len(episodes) <= 1, "episodes", episodes, "as many for every policy")


def medians_in(rows: Iterable[Scores]) -> tuple[str, ...]:
    """The axes of which a table shows medians.

    A lost robot counts as half a metre, so that a mean says little where one is lost. Then, and in
    scans, tables also show the median and the share of lost robots.
    """
    listed = list(rows)
    shown = any(row.failures or row.by_shift for row in listed)
    kept = all(len(row.medians) == len(row.axes) for row in listed)
    return axes_in(listed) if shown and kept else ()


def shifts_in(rows: Iterable[Scores]) -> tuple[str, ...]:
    """The shifts after which all rows have errors; none if there is no row."""
    listed = [tuple(row.by_shift) for row in rows]
    return listed[0] if len(set(listed)) == 1 else ()


# Its law is told what is constant in an episode.
INFORMED = "informed"


def is_informed(id: str) -> bool:
    """Whether a policy is that law, or one for the head over it, with any gains."""
    return INFORMED in id.split("-")


def over_informed(rows: Mapping[str, Scores]) -> dict[str, str]:
    """Mean errors of each row over those of the law that is told what is constant, by name.

    That is how far knowledge could take it. Empty if no such law is among the rows.
    """
    told = [row for id, row in rows.items() if is_informed(id)]
    if not told:
        return {}
    best = min(told, key=lambda row: row.objective)

    def ratio(row: Scores) -> str:
        pairs = zip(row.errors.values(), best.errors.values(), strict=True)
        return " / ".join(figures(own.mean / limit.mean) for own, limit in pairs)

    return {id: ratio(row) for id, row in rows.items()}


def lost(row: Scores, shared: bool) -> str:
    """How many robots a policy has lost, if wanted with their share."""
    share = f" ({100 * row.failures / row.episodes:.0f} %)" if shared and row.failures else ""
    return f"{row.failures}{share}"


def attitude_in(rows: Iterable[Scores]) -> tuple[str, ...]:
    """The angles that rows have in common; none if there is no row."""
    return next((tuple(row.attitude) for row in rows), ())


def prices(angles: Sequence[str]) -> str:
    """What the objective adds to the errors, in words; `angles` are those that count."""
    turned = [f"{ATTITUDE_WEIGHT} mm per degree of {listed(angles)} error"] if angles else []
    return " and ".join([*turned, f"{VARIATION_WEIGHT} mm per N/s of thrust variation"])


def rms_in(rows: Iterable[Scores]) -> tuple[str, ...]:
    """The axes of which rows have the root mean square error; none if there is no row."""
    return next((tuple(row.rms) for row in rows), ())


def axes_in(rows: Iterable[Scores]) -> tuple[str, ...]:
    """The axes that rows have in common; none if there is no row."""
    return next((row.axes for row in rows), ())


@validated
class EvaluationResult(Result):
    """Policies on one list of scenarios, as `usm evaluate` writes them.

    Attributes:
        suite: Name of the suite; None where the scenarios were sampled.
        conditions: Conditions of the first scenario.
        conditions_override: What `--conditions` said.
        settle_time: From when on errors count in the first scenario, s.
        episodes: How many scenarios there are.
        scenarios: The scenarios.
        results: Scores by the name of the policy.
        refused: Why a policy has no scores, by its name.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "evaluation"
    suite: str | None
    conditions: Conditions
    conditions_override: str | None
    settle_time: Number
    episodes: Count
    scenarios: StoredScenarios
    results: Mapping[str, CompetitorScores]
    refused: Mapping[str, str]
    provenance: Provenance

    def __post_init__(self) -> None:
        """Refuse rows that do not belong to the same scenarios."""
        require_alike(self.results.values())
        counts = {len(self.scenarios), *(row.episodes for row in self.results.values())}
        require(counts == {self.episodes}, "episodes", self.episodes, f"{sorted(counts)}")

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the task; none if every policy was refused."""
        return axes_in(self.results.values())


@validated
class Difference:
    """How a second policy differs from a first in one metric, as `usm_gym.statistics` compares.

    Attributes:
        episodes: How many.
        first: Mean of the first policy.
        second: Mean of the second policy.
        difference: Mean of second - first, pair by pair.
        difference_ci95: Its interval.
        improvement: Probability that the second does better in an episode.
        improvement_ci95: Its interval.
        decided: Whether the data decide.
        verdict: What follows, in words.
    """

    episodes: Count
    first: Number
    second: Number
    difference: Number
    difference_ci95: Interval
    improvement: Number
    improvement_ci95: Interval
    decided: Switch
    verdict: str

    @classmethod
    def of(cls, comparison: Comparison, first: str, second: str) -> Self:
        """What is kept of the comparison of two policies, given their names."""
        verdict = comparison.verdict(first, second)
        return cls(**asdict(comparison), decided=comparison.decided, verdict=verdict)


@validated
class ComparisonResult(Result):
    """Two policies on the same scenarios, as `usm compare` writes them.

    Attributes:
        first: Name of the first policy.
        second: Name of the second policy.
        episodes: How many scenarios there are.
        comparisons: Their difference, by metric.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "comparison"
    marked: ClassVar[bool] = False
    first: str
    second: str
    episodes: Count
    comparisons: Mapping[str, Difference]
    provenance: Provenance
