"""A refit of what the paper leaves open to what it prints.

Differential evolution over the freedoms of `FREEDOM`, on the eight numbers of `seen`: the six of
the PD controller, and the STA's peaks in operation mode. All other numbers are predictions.
Candidates are scored with the implicit laws at a coarser step; the best is checked at the paper's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from usm_baselines.paper.paper_rate import Law, LostRobotError
from usm_baselines.paper.reproduction import (
    HEADING_GAIN,
    IMPLICIT_STEP,
    PAPER,
    PARTS,
    STEP,
    Case,
    at_step,
    errors_of,
    laws,
    run_case,
    velocity_start,
)
from usm_gym.support.files import read_json
from usm_gym.support.results import Interval, Provenance, Result
from usm_gym.support.validation import Number, UsageError, in_one_line, validated
from usm_gym.task.loss import LOST_ERROR
from usm_gym.task.sampling import named
from usm_gym.task.scenario import Mode, Scenario

Array = NDArray[np.float64]

# The numbers of the paper that the fit sees: row and part of the table.
SEEN = (("pd", "torpedo"), ("pd", "operation"), ("pd", "settled"), ("sta", "operation"))
# What is free, and between what, spread evenly in the logarithm.
FREEDOM = {
    "speed": (0.02, 0.12),  # of the path, m/s
    "amplitude": (0.05, 0.5),  # of the path, m
    "frequency": (0.03, 0.2),  # of the path, rad/s
    "deflection": (0.2, 2.0),  # of the head, rad
    "joint_stiffness": (1e3, 1e6),  # N m/rad
    "joint_corner": (20.0, 1000.0),  # joint stiffness over damping, 1/s
    "heading_gain": (5.0, 500.0),  # N m/rad
    "look_ahead": (0.5, 8.0),  # m
}
SEED = 0
POPULATION = 24
# A factor of so much off the paper's number counts one.
AIM = {"pd": 1.3, "sta": 2.0}
Freedoms = dict[str, float]
Numbers = dict[str, list[float]]


@validated
class Assessment:
    """What a declaration makes at a step.

    Attributes:
        step: The step, s.
        numbers: The numbers that the fit sees, by law and part, one per axis, m.
        residual: How far they are from the paper's.
    """

    step: Number
    numbers: Mapping[str, tuple[Number, ...]]
    residual: Number


@validated
class Candidate:
    """A declaration and what it makes.

    Attributes:
        freedoms: Its values.
        coarse: At the step of the search.
        paper: At the paper's step.
    """

    freedoms: Mapping[str, Number]
    coarse: Assessment
    paper: Assessment


Evaluations = tuple[tuple[tuple[Number, ...], Number], ...]


@validated
class FitProgress(Result):
    """A fit that is under way.

    Attributes:
        evaluations: Every candidate so far, in the unit cube of the freedoms, with its residual.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "fit"
    marked: ClassVar[bool] = False
    evaluations: Evaluations
    provenance: Provenance


@validated
class FitResult(Result):
    """The fit, as `usm reproduce --fit` writes it.

    Attributes:
        freedom: What is free, and between what.
        seen: What the paper prints, m.
        aim: A factor of so much off the paper's number counts one, by law.
        declared: The declaration of this project.
        fitted: The best one.
        evaluations: Every candidate, in the unit cube of the freedoms, with its residual.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "fit"
    marked: ClassVar[bool] = False
    freedom: Mapping[str, Interval]
    seen: Mapping[str, tuple[Number, ...]]
    aim: Mapping[str, Number]
    declared: Candidate
    fitted: Candidate
    evaluations: Evaluations
    provenance: Provenance


def declared() -> Freedoms:
    """The freedoms as the scenario "table1" declares them."""
    operation, torpedo = named("table1", "operation"), named("table1", "torpedo")
    stiffness, damping = operation.joint_stiffness or 0.0, operation.joint_damping or 0.0
    return {
        "speed": operation.path.speed,
        "amplitude": operation.path.amplitude,
        "frequency": operation.path.frequency,
        "deflection": operation.inspection.deflections[0],
        "joint_stiffness": stiffness,
        "joint_corner": stiffness / damping,
        "heading_gain": HEADING_GAIN,
        "look_ahead": torpedo.look_ahead or 0.0,
    }


def scenario_of(freedoms: Freedoms, mode: Mode, step: float) -> Scenario:
    """The scenario "table1" with other freedoms, at a step (s)."""
    scenario = at_step(named("table1", mode), step)
    path = replace(
        scenario.path,
        speed=freedoms["speed"],
        amplitude=freedoms["amplitude"],
        frequency=freedoms["frequency"],
    )
    scenario = replace(
        scenario,
        path=path,
        joint_stiffness=freedoms["joint_stiffness"],
        joint_damping=freedoms["joint_stiffness"] / freedoms["joint_corner"],
    )
    if scenario.look_ahead is not None:
        return replace(scenario, look_ahead=freedoms["look_ahead"])
    size = freedoms["deflection"]
    return replace(
        scenario, inspection=replace(scenario.inspection, deflections=(size, -size, 0.0))
    )


def numbers(freedoms: Freedoms, step: float, implicit: bool) -> Numbers:
    """The numbers that the fit sees, one per axis, m; `LOST_ERROR` where the robot is lost."""
    errors: dict[tuple[str, Mode], Mapping[str, Mapping[str, float]] | None] = {}
    for row, mode in dict.fromkeys((row, PARTS[part]) for row, part in SEEN):
        scenario = scenario_of(freedoms, mode, step)
        law: Law = laws(scenario)[row]._replace(implicit=implicit, start=velocity_start(scenario))
        gain = freedoms["heading_gain"]
        law = law._replace(
            super_twisting=law.super_twisting._replace(heading_gain=gain),
            pd=law.pd._replace(heading_gain=gain),
        )
        case = Case(row, mode, law, scenario)
        try:
            errors[row, mode] = errors_of(case, run_case(case))
        except LostRobotError:
            errors[row, mode] = None
    made: Numbers = {}
    for row, part in SEEN:
        known = errors[row, PARTS[part]]
        axes = PAPER[row][part]
        made[f"{row} {part}"] = [LOST_ERROR if known is None else known[part][k] for k in axes]
    return made


def seen() -> Numbers:
    """What the paper prints for the same numbers, m."""
    return {f"{row} {part}": list(PAPER[row][part].values()) for row, part in SEEN}


def residual(made: Mapping[str, Sequence[float]]) -> float:
    """Sum of squares of log(ours / the paper's) over log(aim)."""
    total = 0.0
    for name, printed in seen().items():
        unit = math.log(AIM[name.split()[0]])
        ratio = np.log(np.divide(made[name], printed)) / unit
        total += float(ratio @ ratio)
    return total


def fit(
    path: Path, generations: int, workers: int, progress: Callable[[int, int], object]
) -> FitResult:
    """Fit, keeping every evaluation in a file after every generation.

    The search is a function of its seed and of the scores alone, so that an interrupted fit that is
    started again retraces its way from the file and goes on.

    Args:
        path: The file.
        generations: How many generations.
        workers: Threads.
        progress: Called with the evaluations done and those there will be.

    Returns:
        What the file then holds.
    """
    search = Search(path, workers, lambda done: progress(done, POPULATION * (generations + 1)))
    best = search.best(generations)
    result = FitResult(
        freedom=FREEDOM,
        seen={name: tuple(values) for name, values in seen().items()},
        aim=AIM,
        declared=assessed(declared()),
        fitted=assessed(best),
        evaluations=search.evaluations,
        provenance=search.origin,
    )
    result.write(path)
    return result


class Search:
    """A differential evolution that keeps its evaluations in a file.

    Attributes:
        origin: Where the evaluations come from.
    """

    def __init__(self, path: Path, workers: int, progress: Callable[[int], object]) -> None:
        """Take up what the file holds; `progress` is called with the evaluations done."""
        self.origin = Provenance.here({"fit": SEED})
        self._low, self._high = np.log(list(FREEDOM.values())).T
        self._path, self._workers, self._progress = path, workers, progress
        self._scores = stored(path, self.origin)
        self._done = 0

    @property
    def evaluations(self) -> Evaluations:
        """Every candidate with its residual."""
        return tuple((tuple(map(float, x)), score) for x, score in self._scores.items())

    def best(self, generations: int) -> Freedoms:
        """The best candidate after some generations."""
        start = np.random.default_rng(SEED).random((POPULATION, len(FREEDOM)))
        width = self._high - self._low
        start[0] = (np.log(list(declared().values())) - self._low) / width
        with ThreadPoolExecutor(self._workers) as pool:

            def generation(_: object, candidates: Iterable[Array]) -> list[float]:
                return self._scored(pool, [np.asarray(x) for x in candidates])

            best = differential_evolution(
                self._score,
                Bounds(np.zeros(len(FREEDOM)), np.ones(len(FREEDOM))),
                init=start,
                maxiter=generations,
                tol=0.0,
                rng=SEED,
                updating="deferred",
                polish=False,
                workers=generation,
            )
        return self._freedoms(best.x)

    def _scored(self, pool: ThreadPoolExecutor, candidates: list[Array]) -> list[float]:
        """The residuals of a generation; the file then holds them, too."""
        fresh = [x for x in candidates if tuple(x) not in self._scores]
        for x, residual in zip(fresh, pool.map(self._score, fresh), strict=True):
            self._scores[tuple(x)] = residual
        if fresh:
            FitProgress(evaluations=self.evaluations, provenance=self.origin).write(self._path)
        self._done += len(candidates)
        self._progress(self._done)
        return [self._scores[tuple(x)] for x in candidates]

    def _score(self, x: Array) -> float:
        return residual(numbers(self._freedoms(x), IMPLICIT_STEP, implicit=True))

    def _freedoms(self, x: Array) -> Freedoms:
        values = np.exp(self._low + x * (self._high - self._low)).tolist()
        return dict(zip(FREEDOM, values, strict=True))


def assessed(freedoms: Freedoms) -> Candidate:
    """Freedoms with their numbers and residual at both steps."""

    def at(step: float, implicit: bool) -> Assessment:
        made = numbers(freedoms, step, implicit)
        kept = {name: tuple(values) for name, values in made.items()}
        return Assessment(step=step, numbers=kept, residual=residual(made))

    return Candidate(freedoms=freedoms, coarse=at(IMPLICIT_STEP, True), paper=at(STEP, False))


def stored(path: Path, origin: Provenance) -> dict[tuple[float, ...], float]:
    """Scores of this commit in the file, by candidate."""
    if not path.exists():
        return {}
    try:
        document = read_json(path)
        whole = isinstance(document, dict) and "fitted" in document
        kept = (FitResult if whole else FitProgress).parsed(document, path)
    except UsageError as error:
        raise UsageError(f"{in_one_line(error)}; remove it to start anew") from error
    return {} if kept.provenance.commit != origin.commit else dict(kept.evaluations)
