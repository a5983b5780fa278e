"""Tuning of gains by CMA-ES, on sampled training scenarios only.

The scenarios come from the stream TUNING of a seed, and the check afterwards from the stream
VALIDATION; nothing here can reach a frozen suite. In some of them the vehicle reacts later than
the policy is told, so that no gains are chosen that live on the margin of stability. Every search
starts from the middle of its ranges, whatever gains the policy has of its own.

Optuna keeps the trials. What the search asks for next follows from all trials before and from
nothing else, so that the result is the same for any number of workers and for a tuning that was
interrupted.

Source: N. Hansen, The CMA evolution strategy: a tutorial, arXiv:1604.00772, 2016.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace

import numpy as np
import optuna
from cmaes import CMA
from optuna import Study
from optuna.distributions import BaseDistribution, FloatDistribution
from optuna.exceptions import StorageInternalError
from optuna.trial import FrozenTrial, create_trial
from sqlalchemy import make_url
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from usm_baselines.benchmark.scoring import Job, Refusal, score_all, score_batch
from usm_baselines.contender import registered
from usm_baselines.gains import Budget, GainsFile
from usm_baselines.registry import entry, tuned
from usm_baselines.space import Space, in_mode
from usm_gym.evaluation import Evaluation
from usm_gym.support import parallel
from usm_gym.support.files import holding
from usm_gym.support.seeding import TUNING, VALIDATION, stream
from usm_gym.support.validation import UsageError, in_one_line, require
from usm_gym.task.conditions import FIELD, LARGEST_DELAY, LARGEST_TIME_CONSTANT, Conditions
from usm_gym.task.metrics import VARIATION_WEIGHT
from usm_gym.task.modes import AnyMode, AnyScenario, of_head, sample_of
from usm_gym.task.nominal import shared_nominal

# Trials of a generation, and the first standard deviation of the search over the width of a range.
GENERATION, SPREAD = 16, 0.3
# In every so many-th scenario the vehicle reacts later than the policy is told. By turns, commands
# take effect so many periods late, and the thrusters lag more by a factor. Each alone is needed: a
# longer lag makes up for late commands in a law that knows the lag.
MARGIN_EVERY = 8
# The loop over the head is as fast as the thrusters. With one in eight, gains were chosen that were
# worse on other scenarios than those by hand.
HEAD_MARGIN_EVERY = 2
MARGINS = ((1, 1.0), (0, 1.3), (1, 1.3))
# Objective of a trial that has no score, mm.
FAILED = 1e4
# Objectives that are this close to the best are as good; of these trials the one is taken whose
# gains are nearest to the middle of their ranges.
AS_GOOD = 0.01
# Nearer to an end of its range than this share of it, a gain is not taken: the range chose it.
END = 0.05
# The attribute of a trial that says why it has no score.
REFUSED = "refused"


@dataclass(frozen=True)
class Problem:
    """What is tuned, and on what.

    Attributes:
        policy: Id of a registered policy with a declared space.
        budget: Trials and episodes.
        weight: Cost of thrust variation, mm per N/s.
        mode: The mode, in the plane or in space.
        conditions: Conditions of the sampled scenarios.
        seed: Seed of scenarios and search.
    """

    policy: str
    budget: Budget
    weight: float = VARIATION_WEIGHT
    mode: AnyMode = "operation"
    conditions: Conditions = FIELD
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a policy without a space, and numbers that make no sense."""
        require(self.space, "policy", self.policy, "one that declares which gains are tuned")
        require(self.budget.trials >= 1, "trials", self.budget.trials, "1 or more")
        require(self.budget.episodes >= 1, "episodes", self.budget.episodes, "1 or more")
        require(0 <= self.weight <= 1000, "weight", self.weight, "0 to 1000")
        require(self.seed >= 0, "seed", self.seed, "0 or more")

    @property
    def space(self) -> Space:
        """The declared space of the gains."""
        return in_mode(entry(self.policy).space, self.mode)

    @property
    def margin_every(self) -> int:
        """In every so many-th scenario the vehicle reacts later than the policy is told."""
        return HEAD_MARGIN_EVERY if of_head(self.mode) else MARGIN_EVERY

    @property
    def study(self) -> str:
        """Name of the study: another problem, or other code, never continues it."""
        identity = registered(self.policy, entry(self.policy)).identity
        parts = {**dataclasses.asdict(self), "budget": self.budget.episodes, "code": identity}
        parts["margins"] = [self.margin_every, *MARGINS]
        parts["space"] = {name: dataclasses.asdict(span) for name, span in self.space.items()}
        text = json.dumps(parts, sort_keys=True)
        return f"{self.policy}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"

    def scenarios(self, purpose: int) -> tuple[AnyScenario, ...]:
        """Scenarios for tuning, or for the check of its result, as the policy is told of them."""
        require(purpose in (TUNING, VALIDATION), "purpose", purpose, "TUNING or VALIDATION")
        return tuple(
            sample_of(self.mode, self.conditions, stream(self.seed, purpose, episode))
            for episode in range(self.budget.episodes)
        )

    def job(self, gains: dict[str, float], purpose: int) -> Job:
        """The policy with some gains on these scenarios, some of which are worse than told."""
        file = GainsFile(self.policy, gains, self.budget, self.weight)
        contender = registered(self.policy, tuned(file))
        told = self.scenarios(purpose)
        # The last of fewer scenarios, so that a short search has a margin, too.
        every = min(self.margin_every, len(told))
        met = list(told)
        for turn, episode in enumerate(range(every - 1, len(told), every)):
            met[episode] = later(told[episode], *MARGINS[turn % len(MARGINS)])
        return Job(contender, tuple(met), shared_nominal(told))


@dataclass(frozen=True)
class Optimum:
    """What came of a tuning.

    Attributes:
        gains: The best gains.
        objective: Their objective on the tuning scenarios, mm.
        start: That of the policy's own gains on the validation scenarios, mm.
        validation: That of the best gains on the validation scenarios, mm.
    """

    gains: dict[str, float]
    objective: float
    start: float
    validation: float


def later(scenario: AnyScenario, periods: int, lag: float) -> AnyScenario:
    """The same scenario, with commands some periods later and a lag longer by a factor."""
    conditions = scenario.conditions
    changed = replace(
        conditions,
        action_delay=min(conditions.action_delay + periods, LARGEST_DELAY),
        thruster_time_constant=min(lag * conditions.thruster_time_constant, LARGEST_TIME_CONSTANT),
    )
    return replace(scenario, conditions=changed)


def objective(outcome: Evaluation | Refusal, weight: float = VARIATION_WEIGHT) -> float:
    """Mean of the objective over the episodes, mm; no more than that of a refusal.

    Args:
        outcome: Scores, or a refusal.
        weight: Cost of thrust variation, mm per N/s.
    """
    if isinstance(outcome, Refusal):
        return FAILED
    return min(float(np.mean(outcome.objective(weight))), FAILED)


def tune(
    problem: Problem,
    storage: str | None = None,
    workers: int = 1,
    progress: Callable[[int, float], object] = lambda trials, best: None,
) -> Optimum:
    """Look for the gains with the smallest objective.

    Args:
        problem: What is tuned, and on what.
        storage: URL of Optuna's storage, in which an interrupted tuning is found again; without it,
            the trials are kept in memory. A study in a file of SQLite belongs to one process at a
            time; on a server, see to that yourself.
        workers: Number of processes; without effect on the result.
        progress: Called with the number of trials that are done, and the best objective, mm.

    Returns:
        The best gains and what they are worth.

    Raises:
        ValueError: If the storage cannot be used, or no trial has a score.
        BlockingIOError: If another process is at the same study in a file of SQLite.
    """
    with _usable(storage, StorageInternalError, SQLAlchemyError), _held(storage, problem.study):
        optuna.logging.set_verbosity(optuna.logging.WARNING)
        with _usable(storage, Exception):  # of any database
            study = optuna.create_study(
                study_name=problem.study, storage=storage, load_if_exists=True
            )
        _search(study, problem, workers, progress)
        chosen = _chosen(study, problem)
        best, value = dict(chosen.params), value_of(chosen)
        reason = chosen.user_attrs.get(REFUSED)
    if value >= FAILED:
        why = reason or "every robot is lost"
        raise UsageError(f"no trial of {problem.policy} has a score: {why}")
    checks = [problem.job(gains, VALIDATION) for gains in ({}, best)]
    start, validation = (
        objective(outcome, problem.weight) for outcome in score_all(checks, workers)
    )
    return Optimum(best, value, start, validation)


@contextmanager
def _usable(storage: str | None, *faults: type[Exception]) -> Iterator[None]:
    """Say in the database's own words what is wrong with it, such as that the disk is full."""
    try:
        yield
    except faults as error:
        cause: BaseException = error
        while cause.__cause__ is not None:
            cause = cause.__cause__
        with suppress(ArgumentError):
            storage = make_url(storage or "").render_as_string(hide_password=True)
        raise UsageError(f"storage {storage} cannot be used: {in_one_line(cause)}") from error


def _held(storage: str | None, study: str) -> AbstractContextManager[None]:
    """Keep a study in a file of SQLite from other processes; those on a server nobody locks."""
    url = None if storage is None else make_url(storage)
    if url is None or url.get_backend_name() != "sqlite" or url.database in (None, "", ":memory:"):
        return nullcontext()
    return holding(f"{url.database}-{study}")


def _search(
    study: Study, problem: Problem, workers: int, progress: Callable[[int, float], object]
) -> None:
    """Carry out the trials that are left."""
    space, trials = problem.space, problem.budget.trials
    distributions: dict[str, BaseDistribution] = {
        name: FloatDistribution(span.low, span.high, log=span.log) for name, span in space.items()
    }
    known = study.get_trials(deepcopy=False)
    values = [value_of(trial) for trial in known]
    progress(len(values), min(values, default=float("nan")))
    optimizer = CMA(
        mean=np.full(len(space), 0.5),
        sigma=SPREAD,
        bounds=np.tile([0.0, 1.0], (len(space), 1)),
        seed=int(stream(problem.seed, TUNING).integers(2**31)),
        population_size=GENERATION,
    )
    for first in range(0, trials, GENERATION):
        places = [optimizer.ask() for _ in range(GENERATION)]
        # Of a tuning that goes on, trials are known; they only have to be told again.
        for trial, each in zip(known[first : first + GENERATION], places, strict=False):
            same = [span.place(trial.params[name]) for name, span in space.items()]
            allowed = "those that this machine and this version of cmaes ask for"
            require(np.allclose(same, each, atol=1e-6), "stored trials", trial.params, allowed)
        asked = [
            {name: span.at(place) for (name, span), place in zip(space.items(), each, strict=True)}
            for each in places[len(values) - first : trials - first]
        ]
        for gains, outcome in zip(asked, _scored(problem, asked, workers), strict=True):
            value = objective(outcome, problem.weight)
            refusal = {REFUSED: outcome.reason} if isinstance(outcome, Refusal) else {}
            study.add_trial(
                create_trial(
                    params=gains, distributions=distributions, value=value, user_attrs=refusal
                )
            )
            values.append(value)
        if asked:
            progress(len(values), min(values))
        told = values[first : first + GENERATION]
        if len(told) == GENERATION:
            optimizer.tell(list(zip(places, told, strict=True)))


def _scored(
    problem: Problem, asked: Sequence[dict[str, float]], workers: int
) -> list[Evaluation | Refusal]:
    """What becomes of gains on the tuning scenarios."""
    tasks = [(problem.job(gains, TUNING), slice(None)) for gains in asked]
    outcomes = dict(parallel.results(score_batch, tasks, workers))
    return [outcomes[index] for index in range(len(tasks))]


def _chosen(study: Study, problem: Problem) -> FrozenTrial:
    """The trial that is taken, of those that are as good as the best away from all ends."""
    trials = study.get_trials(deepcopy=False)[: problem.budget.trials]

    def distance(trial: FrozenTrial) -> float:
        spans = problem.space.items()
        return max(abs(span.place(trial.params[name]) - 0.5) for name, span in spans)

    inside = [trial for trial in trials if distance(trial) <= 0.5 - END] or trials
    limit = (1.0 + AS_GOOD) * min(map(value_of, inside))
    return min((trial for trial in inside if value_of(trial) <= limit), key=distance)


def value_of(trial: FrozenTrial) -> float:
    """The objective of a trial, mm."""
    value = trial.value
    assert value is not None  # none is kept without
    return value
