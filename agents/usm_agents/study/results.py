"""The result of the study of learned agents."""

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
from usm_gym.task.modes import AnyMode

Steps = Annotated[int, Field(strict=True, ge=0)]


@validated
class CurvePoint(Part):
    """What a validation says of an agent in training.

    Attributes:
        steps: After how many steps.
        seconds: After how much time, s.
        means: Means of the largest errors by axis, m, and of the attitude, rad, and of the thrust
            variation, N/s.
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

    @property
    def objectives(self) -> NDArray[np.float64]:
        """What policies are ranked by, mm, (seeds, episodes): see `usm_gym.task.metrics`."""
        return np.asarray(objective({name: self.table(name) for name in self.metrics}))


@validated
class Estimated:
    """A number that scores say, with the interval that they leave.

    Attributes:
        value: The number.
        ci95: Its 95 % interval, for which seeds and episodes are resampled.
    """

    value: Number
    ci95: Interval


@validated
class Claim:
    """What one policy is to another in the same episodes.

    Attributes:
        ratios: Ratios of their means by metric: the largest errors of position and attitude,
            thrust variation, and "objective", by which policies are ranked; without those that
            the other one has none of.
        improvements: Probabilities that an episode's error is smaller, by axis.
        better_seeds: How many of its seeds are better than the other's mean in all axes.
    """

    ratios: Mapping[str, Estimated]
    improvements: Mapping[str, Estimated]
    better_seeds: Failures


@validated
class Scored:
    """A policy at home and elsewhere.

    Attributes:
        told: What it is told besides the measured position and the reference.
        privileged: Whether it is given true state, and so is no competitor.
        home: Its scores at home.
        elsewhere: Its scores under other conditions, by their name.
        refused: Why it cannot be taken to others, by their name.
        adaptation: In scans, the ratio of the mean errors after the fifth and after the first
            shift, by axis.
    """

    told: str
    privileged: Switch
    home: SeedScores
    elsewhere: Mapping[str, SeedScores]
    refused: Mapping[str, str]
    adaptation: Mapping[str, Estimated]

    def label(self, name: str) -> str:
        """Its name in a table."""
        return f"{name} (no competitor)" if self.privileged else name


@validated
class Trained(Scored):
    """An agent or an ablation, under all its seeds.

    Attributes:
        base: Its base policy.
        rival: The name of its base among the rivals.
        command: The command that trains it again, as its seed 0.
        curves: Its learning curves by the seed.
    """

    base: str
    rival: str
    command: str
    curves: Annotated[Mapping[str, tuple[CurvePoint, ...]], Field(min_length=1)]


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
class HomeResult:
    """The agents of a tier and a mode, and the policies beside which they stand.

    Attributes:
        tier: Name of the preset of conditions of the trainings.
        mode: "operation" or "torpedo".
        agents: The agents that are shipped.
        ablations: The others, which lack one thing or another.
        rivals: Their rivals, among them their bases.
        against: What agents are at home to every rival, and ablations to the ablated agent.
        transfer: What agents are to their bases elsewhere, by the name of the conditions.
        dissected: What agents that add to the thrust do to their bases.
    """

    tier: str
    mode: AnyMode
    agents: Mapping[str, Trained]
    ablations: Mapping[str, Trained]
    rivals: Annotated[Mapping[str, Scored], Field(min_length=1)]
    against: Mapping[str, Mapping[str, Claim]]
    transfer: Mapping[str, Mapping[str, Claim]]
    dissected: Mapping[str, Dissection]

    def __post_init__(self) -> None:
        """Refuse rows of other axes, curves without a point, and agents without their bases."""
        require(self.trained, "agents and ablations", "none", "one or more")
        for name, row in self.rows.items():
            axes = {scores.axes for scores in (row.home, *row.elsewhere.values())}
            require(axes == {self.axes}, f"axes of {name}", axes, f"{self.axes}")
        for name, trained in self.trained.items():
            points = [point for curve in trained.curves.values() for point in curve]
            whole = all(map(len, trained.curves.values()))
            require(whole, f"curves of {name}", list(trained.curves), "one point or more")
            known = all(tuple(point.errors) == self.axes for point in points)
            require(known, f"curves of {name}", "other axes", f"{self.axes}")
            bases = ", ".join(self.rivals)
            require(trained.rival in self.rivals, f"rival of {name}", trained.rival, bases)

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the task."""
        return next(iter(self.rivals.values())).home.axes

    @property
    def trained(self) -> dict[str, Trained]:
        """Agents and ablations."""
        return {**self.agents, **self.ablations}

    @property
    def competing(self) -> dict[str, Scored]:
        """Agents and rivals."""
        return {**self.agents, **self.rivals}

    @property
    def competitors(self) -> dict[str, Scored]:
        """Agents and rivals that know no more than a vehicle does."""
        return {name: row for name, row in self.competing.items() if not row.privileged}

    @property
    def rows(self) -> dict[str, Scored]:
        """All policies."""
        return {**self.trained, **self.rivals}


@validated
class StudyResult(Result):
    """The study of learned agents, as `usm study` writes it.

    Attributes:
        study: What is studied.
        seed: Seed of the scenarios.
        episodes: How many scenarios there are at home; half as many elsewhere.
        homes: The tiers, by name.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "study"
    form: ClassVar[int] = 2
    study: str
    seed: Annotated[int, Field(strict=True, ge=0)]
    episodes: Count
    homes: Annotated[Mapping[str, HomeResult], Field(min_length=1)]
    provenance: Provenance
