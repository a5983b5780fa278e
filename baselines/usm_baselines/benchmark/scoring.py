"""Many policies on many scenarios: independent jobs, each kept in a file as soon as it is done.

What a controller does wrong costs its own row and no other: it is refused with the reason.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import numpy as np
from pydantic import TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as pydantic_dataclass

from usm_baselines.contender import Contender
from usm_gym.evaluation import (
    BATCH,
    Evaluation,
    batches,
    evaluate,
    joined,
    metric_names,
    scored_by_shift,
)
from usm_gym.policy import Policy, is_privileged, nominal_of
from usm_gym.support import parallel
from usm_gym.support.files import read_json, write_json
from usm_gym.support.relay import relayed
from usm_gym.support.validation import (
    CONFIG,
    Number,
    Switch,
    UsageError,
    in_one_line,
    require,
)
from usm_gym.task.modes import AnyScenario
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

# How long the code of others may think in a batch, s.
TIME_LIMIT, LONGEST_TIME = 240.0, 1e6


@dataclass(frozen=True)
class Refusal:
    """Why a policy has no score.

    Attributes:
        reason: In one line.
    """

    reason: str


@dataclass(frozen=True)
class Job:
    """A policy and the scenarios on which it is scored.

    Attributes:
        contender: The policy.
        scenarios: The episodes.
        nominal: The knowledge from which the policy is made.
        time_limit: How long a policy whose code is not known may think in a batch, s.
    """

    contender: Contender
    scenarios: tuple[AnyScenario, ...]
    nominal: Nominal
    time_limit: float = TIME_LIMIT

    def __post_init__(self) -> None:
        """Refuse a time limit that leaves no time."""
        allowed = f"more than 0, up to {LONGEST_TIME:g} s"
        require(0 < self.time_limit <= LONGEST_TIME, "time_limit", self.time_limit, allowed)

    @property
    def key(self) -> str | None:
        """A hash of everything that the scores depend on; None where that is not known."""
        if self.contender.identity is None:
            return None
        parts = [
            self.contender.identity,
            [scenario.to_dict() for scenario in self.scenarios],
            dataclasses.asdict(self.nominal),
        ]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


@pydantic_dataclass(frozen=True, config=CONFIG)
class _Kept:
    """What a file of scores says."""

    policy: str
    per_episode: dict[str, list[Number]]
    failed: list[Switch]


_KEPT = TypeAdapter(_Kept)


def score_all(
    jobs: Sequence[Job],
    workers: int = 1,
    cache: Path | None = None,
    progress: Callable[[float], object] = lambda episodes: None,
    batch: int = BATCH,
) -> list[Evaluation | Refusal]:
    """Score every job.

    Args:
        jobs: The jobs.
        workers: Number of processes; without effect on the result.
        cache: Folder in which the scores of a job are looked for, and kept when it is done; there
            are none of refused policies, nor of those whose code is not known. A file that is
            damaged is written anew, after a warning.
        progress: Called now and then with the number of episodes done since the last call, also
            with fractions of them, and from another thread; it adds up to all episodes.
        batch: How many episodes are run side by side at most; without effect on the result.

    Returns:
        Scores or the reason why there are none, in the order of the jobs.
    """
    require(workers >= 1, "workers", workers, "1 or more")
    outcomes: dict[int, Evaluation | Refusal] = {}
    tasks: list[tuple[Job, slice]] = []
    waiting: dict[int, list[Evaluation | Refusal | None]] = {}
    places = []
    for index, job in enumerate(jobs):
        known = _read(cache, job)
        if known is not None:
            outcomes[index] = known
            progress(len(job.scenarios))
            continue
        parts = batches(len(job.scenarios), batch=batch)
        tasks += [(job, part) for part in parts]
        places += [(index, place) for place in range(len(parts))]
        waiting[index] = [None] * len(parts)
    done = _Done([len(job.scenarios[part]) for job, part in tasks], progress)
    with relayed(done.add) if workers > 1 else nullcontext(done.add) as tell:
        calls = [(*task, partial(tell, number)) for number, task in enumerate(tasks)]
        for number, outcome in parallel.results(score_batch, calls, workers):
            index, place = places[number]
            waiting[index][place] = outcome
            done.finish(number)
            parts_done = [each for each in waiting[index] if each is not None]
            if len(parts_done) == len(waiting[index]):
                outcomes[index] = _whole(parts_done)
                _write(cache, jobs[index], outcomes[index])
    return [outcomes[index] for index in range(len(jobs))]


class _Done:
    """How much of each task is done, and who wants to know."""

    def __init__(self, sizes: Sequence[float], progress: Callable[[float], object]) -> None:
        """Begin with tasks of these sizes."""
        self._left, self._progress = list(sizes), progress
        self._lock = threading.Lock()

    def add(self, task: int, amount: float) -> None:
        """Take note of a part of a task; what comes after its end counts no more."""
        with self._lock:
            amount = min(amount, self._left[task])
            self._left[task] -= amount
            self._progress(amount)

    def finish(self, task: int) -> None:
        """Take note of the end of a task."""
        self.add(task, self._left[task])


def score_batch(
    job: Job, part: slice, progress: Callable[[float], None] | None = None
) -> Evaluation | Refusal:
    """Score a part of the episodes of a job side by side; `progress` as for `evaluate`."""
    scenarios = job.scenarios[part]
    try:
        policy = job.contender.make(job.nominal)
        if job.contender.identity is None:  # ours are never refused for a slow machine
            policy = Timed(policy, job.time_limit)
        return evaluate(policy, scenarios, progress=progress)
    except job.contender.refusals as error:
        kind = "" if isinstance(error, ValueError | TimeoutError) else f"{type(error).__name__}: "
        return Refusal(kind + in_one_line(error))


class Timed:
    """A policy that has to answer within a time.

    Attributes:
        nominal: Nominal knowledge of the policy, if it keeps one.
        privileged: Whether it has to be given true state.
    """

    def __init__(self, policy: Policy, limit: float) -> None:
        """Allow a policy `limit` seconds in all."""
        self.nominal = nominal_of(policy)
        self.privileged = is_privileged(policy)
        self._policy = policy
        self._limit = self._left = limit

    def predict(self, *arguments: Any, **options: Any) -> Any:
        """Let the policy answer.

        Raises:
            TimeoutError: If it has used up its time.
        """
        begin = time.perf_counter()
        with alarm(self._left, self._expire):
            answer = self._policy.predict(*arguments, **options)
        self._left -= time.perf_counter() - begin
        if self._left <= 0:
            self._expire()
        return answer

    def _expire(self) -> NoReturn:
        raise TimeoutError(f"thinks for more than {self._limit:g} s in a batch of episodes")


@contextmanager
def alarm(seconds: float, expire: Callable[[], NoReturn]) -> Iterator[None]:
    """Interrupt what takes longer, where the system and the thread allow it."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "SIGALRM"):
        yield
        return

    def handler(number: int, frame: FrameType | None) -> None:
        expire()

    previous = signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, previous)


def _whole(parts: Sequence[Evaluation | Refusal]) -> Evaluation | Refusal:
    scores = []
    for part in parts:
        if isinstance(part, Refusal):
            return part
        scores.append(part)
    return joined(scores)


def _read(cache: Path | None, job: Job) -> Evaluation | None:
    """The scores of a job that are kept; None, with a warning if the file is damaged."""
    if cache is None or job.key is None or not (file := cache / f"{job.key}.json").exists():
        return None
    try:
        kept = _KEPT.validate_python(read_json(file))
        names, episodes = list(kept.per_episode), len(job.scenarios)
        by_shift = all(map(scored_by_shift, job.scenarios))
        expected = metric_names(world_of(job.scenarios[0].body), by_shift)
        require(names == expected, "per_episode", names, ", ".join(expected))
        lengths = {len(kept.failed), *map(len, kept.per_episode.values())}
        require(lengths == {episodes}, "number of episodes", sorted(lengths), str(episodes))
    except (UsageError, ValidationError, OSError) as error:
        reason = f"{file} is damaged, and the scores are computed again: {in_one_line(error)}"
        warnings.warn(reason, stacklevel=3)
        return None
    scores = {name: np.array(values) for name, values in kept.per_episode.items()}
    return Evaluation(scores, np.array(kept.failed))


def _write(cache: Path | None, job: Job, outcome: Evaluation | Refusal) -> None:
    if cache is None or job.key is None or isinstance(outcome, Refusal):
        return
    cache.mkdir(parents=True, exist_ok=True)
    scores = {name: values.tolist() for name, values in outcome.per_episode.items()}
    data = {"policy": job.contender.name, "per_episode": scores, "failed": outcome.failed.tolist()}
    write_json(cache / f"{job.key}.json", data)
