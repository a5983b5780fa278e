"""The result of the study of residual agents."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from usm_baselines.benchmark.results import Failures, MiddleSummary, Scores

from usm_gym.support.results import Interval, Part, Provenance, Result
from usm_gym.support.validation import Count, Number, Switch, require, validated
from usm_gym.task.metrics import MAX_ERROR, axes_of, objective
from usm_gym.task.scenario import Mode

# The mode of the main suite, whose name is left out where others are named.
MAIN_MODE: Mode = "operation"
Steps = Annotated[int, Field(strict=True, ge=0)]
Share = Annotated[Number, Field(ge=0, le=1)]


@validated
class CurvePoint(Part):
    """What a validation says of an agent in training.

    Attributes:
        steps: After how many steps.
        seconds: After how much time, s.
        means: Means of the largest errors by axis, m, and of the attitude, rad, which old curves
            lack, and of the thrust variation, N/s.
        failures: How many episodes lost the robot.
    """

    beside: ClassVar[str] = "means"
    steps: Steps
    seconds: Number
    means: Mapping[str, Number]
    failures: Failures

    @property
    def errors(self) -> dict[str, float]:
        """Mean of the largest error, m, by axis."""
        return {axis: self.means[MAX_ERROR + axis] for axis in axes_of(self.means)}

    @property
    def objective(self) -> float:
        """What agents are chosen by, mm: see `usm_gym.task.metrics.objective`."""
        return float(objective(self.means))


@validated
class SeedSummary(MiddleSummary):
    """A metric over the episodes of all seeds; intervals resample seeds and episodes.

    Attributes:
        seeds: Means by seed.
    """

    order: ClassVar[tuple[str, ...]] = ("mean", "ci95", "iqm", "iqm_ci95", "worst", "seeds")
    seeds: Annotated[tuple[Number, ...], Field(min_length=1)]


@validated
class SeedScores(Scores):
    """Scores over the episodes of all seeds.

    Attributes:
        metrics: Summaries by metric.
    """

    order: ClassVar[tuple[str, ...]] = ("failures", "per_episode", "metrics")
    metrics: Mapping[str, SeedSummary]

    def table(self, metric: str) -> NDArray[np.float64]:
        """A metric by seed and episode, (seeds, episodes)."""
        return np.reshape(self.per_episode[metric], (len(self.metrics[metric].seeds), -1))

    @property
    def seed_errors(self) -> list[SeedSummary]:
        """The largest errors, one per axis, m."""
        return [self.metrics[MAX_ERROR + axis] for axis in self.axes]


@validated
class Rival:
    """A classical policy.

    Attributes:
        mode: "operation" or "torpedo".
        scores: Its scores by the conditions.
    """

    mode: Mode
    scores: Mapping[str, SeedScores]


@validated
class Trained:
    """An agent or an ablation, under all its seeds.

    Attributes:
        agent: Whether it is an agent that is shipped.
        mode: "operation" or "torpedo".
        base: Its base policy.
        command: The command that trains it again, as its seed 0.
        curves: Its learning curves by the seed.
        scores: Its scores by the conditions.
    """

    agent: Switch
    mode: Mode
    base: str
    command: str
    curves: Mapping[str, tuple[CurvePoint, ...]]
    scores: Mapping[str, SeedScores]


@validated
class Claim:
    """What an agent is to a classical policy.

    Attributes:
        ratio: Ratios of their means over all seeds, by axis.
        ratio_ci95: Their 95 % intervals, by axis.
        better_in_both: In what share of scenarios the agent, as its seed 0, is better in all axes.
        better_seeds: How many of its seeds are better in the means of all axes.
    """

    ratio: tuple[Number, ...]
    ratio_ci95: tuple[Interval, ...]
    better_in_both: Share
    better_seeds: Failures


@validated
class ForceShares:
    """What an agent does to its base in one axis.

    Attributes:
        deviation: Standard deviations of the forces, N.
        excess_taken_back: Share of what the base commands in excess that the residual takes back.
        needed_added: Share of the needed force that the residual adds.
        explained: Share of the residual's variance that the two explain.
        lateness: By how much the whole force is late behind the needed one, s.
        spectrum: Power spectral densities of the forces, N^2/Hz.
    """

    deviation: Mapping[str, Number]
    excess_taken_back: Number
    needed_added: Number
    explained: Number
    lateness: Number
    spectrum: Mapping[str, tuple[Number, ...]]


@validated
class Dissection(Part):
    """What an agent does to its base.

    Attributes:
        frequency: Frequencies of the spectra, Hz.
        axes: What it does, axis by axis.
    """

    beside: ClassVar[str] = "axes"
    frequency: tuple[Number, ...]
    axes: Mapping[str, ForceShares]


@validated
class StudyResult(Result):
    """The study of residual agents, as `usm study` writes it.

    Attributes:
        study: What is studied.
        home: The conditions of the trainings.
        seed: Seed of the scenarios.
        rows: Agents and ablations.
        rivals: Classical policies.
        against: How the agents compare with the classical policies of their mode.
        episodes: How many scenarios there are at home; half as many elsewhere.
        dissected: What the agents do to their bases.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "study"
    study: str
    home: str
    seed: Annotated[int, Field(strict=True, ge=0)]
    rows: Annotated[Mapping[str, Trained], Field(min_length=1)]
    rivals: Mapping[str, Rival]
    against: Mapping[str, Mapping[str, Claim]]
    episodes: Count
    dissected: Mapping[str, Dissection]
    provenance: Provenance

    def __post_init__(self) -> None:
        """Refuse rows without scores at home, or without a curve, and rows of other axes."""
        everyone: dict[str, Trained | Rival] = {**self.rows, **self.rivals}
        for name, row in everyone.items():
            require(self.home in row.scores, f"scores of {name}", list(row.scores), self.home)
            axes = {scores.axes for scores in row.scores.values()}
            require(axes == {self.axes}, f"axes of {name}", axes, f"{self.axes}")
        for name, trained in self.rows.items():
            points = [point for curve in trained.curves.values() for point in curve]
            whole = points and all(map(len, trained.curves.values()))
            require(whole, f"curves of {name}", list(trained.curves), "one point or more")
            known = all(tuple(point.errors) == self.axes for point in points)
            require(known, f"curves of {name}", "other axes", f"{self.axes}")

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the task."""
        return next(iter(self.rows.values())).scores[self.home].axes

    @property
    def agents(self) -> dict[str, Trained]:
        """The agents that are shipped."""
        return {name: row for name, row in self.rows.items() if row.agent}

    @property
    def ablations(self) -> dict[str, Trained]:
        """The others, which lack one thing or another."""
        return {name: row for name, row in self.rows.items() if not row.agent}
