"""A table is complete whatever a controller does, and nothing is computed or counted twice."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.episodes import short
from usm_baselines.benchmark import scoring
from usm_baselines.benchmark.scoring import Job, Refusal, score_all
from usm_baselines.contender import Contender, contender

import usm_gym
from usm_gym import Inspection, Robot
from usm_gym.evaluation import Evaluation
from usm_gym.task.nominal import shared_nominal

ROBOT = Robot()
SCENARIOS = tuple(short(3))


class Still:
    """No thrust, or what a subclass makes of it."""

    def act(self, action: Any) -> Any:
        return action

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, **_: Any
    ) -> Any:
        action = self.act(np.zeros((len(observation), 5)))
        return action if action is None else (action, state)


class Raising(Still):
    def act(self, action: Any) -> Any:
        return action / 0 if action is None else [][0]


class NotANumber(Still):
    def act(self, action: Any) -> Any:
        return action * np.nan


class Narrow(Still):
    def act(self, action: Any) -> Any:
        return action[:, :4]


class Nothing(Still):
    def act(self, action: Any) -> Any:
        return None


class Leaving(Still):
    def act(self, action: Any) -> Any:
        sys.exit("enough")


class Sleeping(Still):
    def act(self, action: Any) -> Any:
        time.sleep(600)


class Dawdling(Still):
    def act(self, action: Any) -> Any:
        time.sleep(0.02)
        return action


class Unstable(Still):
    def act(self, action: Any) -> Any:
        return action + 1e6


def job(policy: str | Callable[[], Any] = "zero", scenarios: Any = SCENARIOS) -> Job:
    if isinstance(policy, str):
        known = contender(policy)
    else:
        known = Contender(policy.__name__, lambda nominal: policy())
    return Job(known, scenarios, shared_nominal(scenarios))


def assert_same(one: Any, other: Any) -> None:
    assert isinstance(one, Evaluation)
    for name, values in one.per_episode.items():
        assert np.array_equal(values, other.per_episode[name]), name
    assert np.array_equal(one.failed, other.failed)


FAULTS: dict[type[Still], str] = {
    Raising: "IndexError: list index out of range",
    NotANumber: "NaN",
    Narrow: "(3, 4); allowed: (3, 5)",
    Nothing: "pair (action, state)",
    Leaving: "SystemExit: enough",
    Sleeping: "thinks for more than 0.3 s",
    Dawdling: "thinks for more than 0.3 s",
}


@pytest.mark.parametrize("workers", [1, 2])
def test_a_fault_costs_its_own_row_and_no_other(workers: int) -> None:
    faulty = [replace(job(fault), time_limit=0.3) for fault in FAULTS]
    first, *refused, last = score_all([job(), *faulty, job(Still)], workers)
    assert_same(first, last)
    for outcome, reason in zip(refused, FAULTS.values(), strict=True):
        assert isinstance(outcome, Refusal)
        assert reason in outcome.reason
        assert "\n" not in outcome.reason


def test_an_unstable_controller_loses_the_robot_and_is_scored() -> None:
    (outcome,) = score_all([job(Unstable, tuple(short(2, duration=8.0)))])
    assert isinstance(outcome, Evaluation)
    assert outcome.failed.all()
    assert outcome.per_episode["max_error_x"].min() >= 0.5


def test_scores_are_those_of_evaluate_however_they_are_computed() -> None:
    expected = usm_gym.evaluate(contender("sta").make(job().nominal), SCENARIOS)
    episodes: list[float] = []
    for workers in (1, 2):
        jobs = [job("sta"), job("sta", SCENARIOS[::-1])]
        one, turned = score_all(jobs, workers, progress=episodes.append, batch=2)
        assert_same(one, expected)
        assert isinstance(turned, Evaluation)
        for name, values in turned.per_episode.items():
            assert np.array_equal(values[::-1], expected.per_episode[name])
    assert sum(episodes) == pytest.approx(12)


@pytest.mark.parametrize("workers", [1, 2])
def test_progress_moves_within_a_policy_and_adds_up_although_one_is_refused(workers: int) -> None:
    chosen = tuple(short(2, duration=8.0))
    episodes: list[float] = []
    score_all([job("sta", chosen), job(Raising, chosen)], workers, progress=episodes.append)
    assert sum(episodes) == pytest.approx(4)
    assert min(episodes) >= 0.0
    # What other processes say comes with a delay, so that it may be later than their end.
    assert workers > 1 or sum(0.0 < each < 2.0 for each in episodes) >= 3


def test_what_is_kept_is_not_computed_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    jobs = [job("sta"), job(Still), job(Raising)]
    first = score_all(jobs[:1], cache=tmp_path)
    score_all(jobs, cache=tmp_path)
    assert len(list(tmp_path.iterdir())) == 1  # neither other people's code nor a refusal
    monkeypatch.setattr(scoring, "score_batch", None)
    episodes: list[float] = []
    (again,) = score_all(jobs[:1], cache=tmp_path, progress=episodes.append)
    assert_same(again, first[0])
    assert episodes == [3]


def test_what_is_kept_of_scans_has_the_errors_by_shift(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = Inspection(times=(0.2, 0.3, 0.4, 0.5, 0.6), deflections=(0.1, -0.1, 0.1, -0.1, 0.1))
    scans = tuple(replace(each, duration=8.0, inspection=motion) for each in SCENARIOS)
    first = score_all([job("zero", scans)], cache=tmp_path)
    monkeypatch.setattr(scoring, "score_batch", None)
    (again,) = score_all([job("zero", scans)], cache=tmp_path)
    assert_same(again, first[0])
    assert isinstance(again, Evaluation)
    assert "last_shift_error_y" in again.per_episode


DAMAGES: dict[str, Callable[[dict[str, Any]], str]] = {
    "empty": lambda data: "",
    "truncated": lambda data: json.dumps(data)[:-20],
    "no fields": lambda data: "{}",
    "no object": lambda data: "[]",
    "no numbers": lambda data: json.dumps({**data, "per_episode": {"max_error_x": "1"}}),
    "words": lambda data: json.dumps(data).replace("0.", '"0."', 1),
    "a metric short": lambda data: json.dumps(
        {**data, "per_episode": dict(list(data["per_episode"].items())[1:])}
    ),
    "an episode short": lambda data: json.dumps({**data, "failed": data["failed"][1:]}),
    "of other episodes": lambda data: json.dumps(
        {
            **data,
            "per_episode": {name: row[1:] for name, row in data["per_episode"].items()},
            "failed": data["failed"][1:],
        }
    ),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=list(DAMAGES))
def test_kept_scores_that_are_damaged_are_computed_again(
    damage: Callable[[dict[str, Any]], str], tmp_path: Path
) -> None:
    (whole,) = score_all([job("zero")], cache=tmp_path)
    (file,) = tmp_path.iterdir()
    text = file.read_text()
    file.write_text(damage(json.loads(text)))
    with pytest.warns(UserWarning, match=file.name) as warned:
        (again,) = score_all([job("zero")], cache=tmp_path)
    assert len(warned) == 1
    assert_same(again, whole)
    assert file.read_text() == text


def test_a_key_tells_all_that_scores_depend_on() -> None:
    one = job("sta")
    others = [
        job("pd"),
        job("sta", SCENARIOS[:2]),
        job("sta", SCENARIOS[::-1]),
        replace(one, nominal=replace(one.nominal, position_noise=1.0)),
        job("sta", [replace(SCENARIOS[0], robot=replace(ROBOT, joint_damping=6.0))]),
        replace(one, contender=replace(one.contender, identity="other sources")),
    ]
    assert len({each.key for each in (one, *others)}) == len(others) + 1
    assert replace(one, time_limit=1.0).key == job("sta").key == one.key


KILLED = """
import sys
from pathlib import Path
from support.episodes import short
from usm_baselines.benchmark import scoring
from usm_baselines.contender import contender
from usm_gym.task.nominal import shared_nominal

jobs = []
for seed in range(8):
    scenarios = tuple(short(2, 20.0, seed))
    nominal = shared_nominal(scenarios)
    jobs.append(scoring.Job(contender("sta"), scenarios, nominal))
for outcome in scoring.score_all(jobs, cache=Path(sys.argv[1])):
    print(outcome.per_episode["max_error_x"].tolist())
"""


def whole_files(folder: Path) -> list[Path]:
    """Return the scores in a folder, without what a killed process was about to write."""
    return [file for file in folder.glob("*.json") if ".part" not in file.name]


@pytest.mark.posix
@pytest.mark.slow
def test_a_killed_run_goes_on_where_it_stopped(tmp_path: Path) -> None:
    tests = str(Path(__file__).parents[2])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([tests, *sys.path])}
    command = [sys.executable, "-c", KILLED]
    process = subprocess.Popen([*command, tmp_path / "killed"], env=environment)
    while len(whole_files(tmp_path / "killed")) < 3:
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    kept = {file: file.stat().st_mtime_ns for file in whole_files(tmp_path / "killed")}
    assert 3 <= len(kept) < 8
    assert all(json.loads(file.read_text())["failed"] for file in kept)
    scores = [
        subprocess.check_output([*command, tmp_path / name], env=environment)
        for name in ("killed", "whole")
    ]
    assert scores[0] == scores[1]
    assert all(file.stat().st_mtime_ns == then for file, then in kept.items())
    assert len(whole_files(tmp_path / "killed")) == 8
