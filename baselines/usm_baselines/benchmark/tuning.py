"""Tuning of gains by Optuna, on sampled training scenarios only.

The scenarios come from the stream TUNING of a seed, and the check afterwards from the stream
VALIDATION; nothing here can reach a frozen suite. In some of them the vehicle reacts later than
the policy is told, so that no gains are chosen that live on the margin of stability. Every search
starts from the middle of its ranges, whatever gains the policy has of its own. Trials are asked
for in rounds of a fixed size and the sampler is seeded anew for every round, so that the result is
the same for any number of workers and for a tuning that was interrupted.
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
from optuna import Study
from optuna.distributions import BaseDistribution, FloatDistribution
from optuna.exceptions import StorageInternalError
from optuna.trial import FrozenTrial, TrialState
from sqlalchemy import make_url
from sqlalchemy.exc import ArgumentError, SQLAlchemyError

from usm_baselines.benchmark.scoring import Job, Refusal, score_all, score_batch
from usm_baselines.contender import registered
from usm_baselines.gains import Budget, GainsFile
from usm_baselines.registry import entry, tuned
from usm_baselines.space import Space
from usm_gym.evaluation import Evaluation, joined
from usm_gym.support import parallel
from usm_gym.support.files import holding
from usm_gym.support.seeding import TUNING, VALIDATION, stream
from usm_gym.support.validation import UsageError, in_one_line, require
from usm_gym.task.conditions import FIELD, Conditions
from usm_gym.task.metrics import VARIATION_WEIGHT
from usm_gym.task.nominal import shared_nominal
from usm_gym.task.sampling import sample
from usm_gym.task.scenario import Mode, Scenario

# Trials asked for at once, from what is known before all of them.
ROUND = 4
# In every so many-th scenario commands take effect a period late and thrusters lag more, by a
# factor; the policy is not told.
MARGIN_EVERY, MARGIN_DELAY, MARGIN_LAG = 8, 1, 1.3
# Objective of a trial that has no score, mm.
FAILED = 1e4
# Trials that are drawn at random, and never pruned, before the sampler and the pruner set in.
STARTUP_TRIALS = 16
# Objectives that are this close to the best are as good; of these trials the one is taken whose
# gains are nearest to the middle of their ranges.
AS_GOOD = 0.01
# Attributes of a trial: its objective, or None if it was given up early; and why it has no score.
# The names stand in the storages of tunings that go on.
OBJECTIVE, REFUSED = "found", "refused"


@dataclass(frozen=True)
class Problem:
    """What is tuned, and on what.

    Attributes:
        policy: Id of a registered policy with a declared space.
        budget: Trials and episodes.
        weight: Cost of thrust variation, mm per N/s.
        mode: "operation" or "torpedo".
        conditions: Conditions of the sampled scenarios.
        seed: Seed of scenarios and sampler.
        first_episodes: Episodes after which a trial may be given up.
    """

    policy: str
    budget: Budget
    weight: float = VARIATION_WEIGHT
    mode: Mode = "operation"
    conditions: Conditions = FIELD
    seed: int = 0
    first_episodes: int = 16

    def __post_init__(self) -> None:
        """Refuse a policy without a space, and numbers that make no sense."""
        require(self.space, "policy", self.policy, "one that declares which gains are tuned")
        require(self.budget.trials >= 1, "trials", self.budget.trials, "1 or more")
        require(self.budget.episodes >= 1, "episodes", self.budget.episodes, "1 or more")
        require(0 <= self.weight <= 1000, "weight", self.weight, "0 to 1000")
        require(self.seed >= 0, "seed", self.seed, "0 or more")
        require(self.first_episodes >= 1, "first_episodes", self.first_episodes, "1 or more")

    @property
    def space(self) -> Space:
        """The declared space of the gains."""
        return entry(self.policy).space

    @property
    def study(self) -> str:
        """Name of the study: another problem, or other code, never continues it."""
        identity = registered(self.policy, entry(self.policy)).identity
        parts = {**dataclasses.asdict(self), "budget": self.budget.episodes, "code": identity}
        parts["space"] = {name: dataclasses.asdict(span) for name, span in self.space.items()}
        text = json.dumps(parts, sort_keys=True)
        return f"{self.policy}-{hashlib.sha256(text.encode()).hexdigest()[:16]}"

    def scenarios(self, purpose: int) -> tuple[Scenario, ...]:
        """Scenarios for tuning, or for the check of its result, as the policy is told of them."""
        require(purpose in (TUNING, VALIDATION), "purpose", purpose, "TUNING or VALIDATION")
        return tuple(
            sample(self.mode, self.conditions, stream(self.seed, purpose, episode))
            for episode in range(self.budget.episodes)
        )

    def job(self, gains: dict[str, float], purpose: int) -> Job:
        """The policy with some gains on these scenarios, some of which are worse than told."""
        file = GainsFile(self.policy, gains, self.budget, self.weight)
        contender = registered(self.policy, tuned(file))
        told = self.scenarios(purpose)
        met = [
            later(scenario) if episode % MARGIN_EVERY == MARGIN_EVERY - 1 else scenario
            for episode, scenario in enumerate(told)
        ]
        return Job(contender, tuple(met), shared_nominal(told))


@dataclass(frozen=True)
class Optimum:
    """What came of a tuning.

    Attributes:
        gains: The best gains.
        objective: Their objective on the tuning scenarios, mm.
        start: That of the policy's own gains on the validation scenarios, mm.
        validation: That of the best gains on the validation scenarios, mm.
        pruned: How many trials were given up early.
    """

    gains: dict[str, float]
    objective: float
    start: float
    validation: float
    pruned: int


def later(scenario: Scenario) -> Scenario:
    """The same scenario, in which the vehicle reacts later."""
    conditions = scenario.conditions
    changed = replace(
        conditions,
        action_delay=conditions.action_delay + MARGIN_DELAY,
        thruster_time_constant=MARGIN_LAG * conditions.thruster_time_constant,
    )
    return replace(scenario, conditions=changed)


def objective(outcome: Evaluation | Refusal, weight: float = VARIATION_WEIGHT) -> float:
    """Mean of the objective over the episodes, mm; a refusal costs more than any loss.

    Args:
        outcome: Scores, or a refusal.
        weight: Cost of thrust variation, mm per N/s.
    """
    return FAILED if isinstance(outcome, Refusal) else float(np.mean(outcome.objective(weight)))


def tune(
    problem: Problem,
    storage: str | None = None,
    workers: int = 1,
    progress: Callable[[int, float], object] = lambda trials, best: None,
) -> Optimum:
    """Look for the gains with the smallest objective.

    Every trial meets the first scenarios; only those that are no worse there than the median of the
    trials before meet the others, too.

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
        study = _study(problem, storage)
        _search(study, problem, workers, progress)
        chosen = _chosen(study, problem.space)
        best, value = dict(chosen.params), chosen.value or 0.0
        reason = chosen.user_attrs.get(REFUSED)
        pruned = len(study.get_trials(deepcopy=False, states=[TrialState.PRUNED]))
    if value >= FAILED:
        raise UsageError(f"no trial of {problem.policy} has a score: {reason}")
    checks = [problem.job(gains, VALIDATION) for gains in ({}, best)]
    start, validation = (
        objective(outcome, problem.weight) for outcome in score_all(checks, workers)
    )
    return Optimum(best, value, start, validation, pruned)


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


def _study(problem: Problem, storage: str | None) -> Study:
    """The study of a problem, without a round that is half done."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    with _usable(storage, Exception):  # of any database
        study = optuna.create_study(
            study_name=problem.study,
            storage=storage,
            load_if_exists=True,
            pruner=optuna.pruners.MedianPruner(n_startup_trials=STARTUP_TRIALS),
        )
    _tell(study)
    return study


def _search(
    study: Study, problem: Problem, workers: int, progress: Callable[[int, float], object]
) -> None:
    """Carry out the rounds that are left."""
    progress(_finished(study), study.best_value if _finished(study) else float("nan"))
    while (done := _finished(study)) < problem.budget.trials:
        study.sampler = optuna.samplers.TPESampler(
            seed=int(stream(problem.seed, TUNING).integers(2**31)) + done,
            n_startup_trials=STARTUP_TRIALS,
            multivariate=True,
            constant_liar=True,
        )
        if done == 0 and not study.get_trials(deepcopy=False, states=[TrialState.WAITING]):
            middle = {name: span.middle for name, span in problem.space.items()}
            study.enqueue_trial(middle)
        _round(study, problem, min(ROUND, problem.budget.trials - done), workers)
        progress(_finished(study), study.best_value)


def _round(study: Study, problem: Problem, size: int, workers: int) -> None:
    """Ask for trials, score them on the first scenarios, the better ones on all, and tell."""
    space: dict[str, BaseDistribution] = {
        name: FloatDistribution(span.low, span.high, log=span.log)
        for name, span in problem.space.items()
    }
    trials = [study.ask(space) for _ in range(size)]
    jobs = [problem.job(trial.params, TUNING) for trial in trials]
    first = problem.first_episodes
    begun = _scored(jobs, slice(first), workers)
    for index, trial in enumerate(trials):
        trial.report(objective(begun[index], problem.weight), 0)
    going = [index for index, trial in enumerate(trials) if not trial.should_prune()]
    outcomes = {index: begun[index] for index in going}
    if problem.budget.episodes > first:
        rest = _scored([jobs[index] for index in going], slice(first, None), workers)
        outcomes = {index: _joined(begun[index], rest[k]) for k, index in enumerate(going)}
    for index, trial in enumerate(trials):
        outcome = outcomes.get(index)
        if isinstance(outcome, Refusal):
            trial.set_user_attr(REFUSED, outcome.reason)
        trial.set_user_attr(OBJECTIVE, outcome and objective(outcome, problem.weight))
    _tell(study)


def _tell(study: Study) -> None:
    """End the trials of a round, with their objectives, or as failed if one has none.

    Every trial keeps its objective before the first of them ends. So a round during which a tuning
    was killed counts as a whole or not at all, and what follows is the same.
    """
    trials = study.get_trials(deepcopy=False, states=[TrialState.RUNNING])
    complete = all(OBJECTIVE in trial.user_attrs for trial in trials)
    # Those without come last, so that a round that is not complete stays so until it is gone.
    for trial in sorted(trials, key=lambda trial: OBJECTIVE not in trial.user_attrs):
        if not complete:
            study.tell(trial.number, state=TrialState.FAIL)
        elif trial.user_attrs[OBJECTIVE] is None:
            study.tell(trial.number, state=TrialState.PRUNED)
        else:
            study.tell(trial.number, trial.user_attrs[OBJECTIVE])


def _scored(jobs: Sequence[Job], part: slice, workers: int) -> dict[int, Evaluation | Refusal]:
    return dict(parallel.results(score_batch, [(job, part) for job in jobs], workers))


def _joined(first: Evaluation | Refusal, second: Evaluation | Refusal) -> Evaluation | Refusal:
    if isinstance(first, Refusal):
        return first
    return second if isinstance(second, Refusal) else joined([first, second])


def _chosen(study: Study, space: Space) -> FrozenTrial:
    """The trial that is taken, of those that are as good as the best."""
    limit = (1.0 + AS_GOOD) * study.best_value
    trials = study.get_trials(deepcopy=False, states=[TrialState.COMPLETE])

    def distance(trial: FrozenTrial) -> float:
        return max(abs(span.place(trial.params[name]) - 0.5) for name, span in space.items())

    return min((trial for trial in trials if (trial.value or 0.0) <= limit), key=distance)


def _finished(study: Study) -> int:
    """How many trials have been told."""
    return len(study.get_trials(deepcopy=False, states=[TrialState.COMPLETE, TrialState.PRUNED]))
