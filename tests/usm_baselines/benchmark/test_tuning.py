"""Gains are tuned on training scenarios only, the same however the work is done."""

import contextlib
import sqlite3
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from optuna.distributions import FloatDistribution
from optuna.trial import create_trial

pytest.importorskip("optuna", reason="the extra `tune` is not installed")

import optuna
import sqlalchemy
from support.episodes import METRICS
from usm_baselines import registry
from usm_baselines.benchmark import tuning
from usm_baselines.benchmark.tuning import Problem, objective, tune
from usm_baselines.gains import Budget
from usm_baselines.space import Range

import usm_gym
from usm_gym import suites
from usm_gym.evaluation import Evaluation
from usm_gym.support.seeding import EVALUATION, SUITE, TRAINING, TUNING, VALIDATION
from usm_gym.task.conditions import FIELD
from usm_gym.task.modes import in_space, of_head
from usm_gym.task.scenario import STILL
from usm_gym.task.spatial_scenario import NO_SCAN

SPACE = {
    "observer_gain": Range(0.1, 100.0, "m/s^3"),
    "surface": Range(0.1, 10.0, "1/s"),
    "alpha_start": Range(0.0, 1.0, "m^0.5/s^1.5", log=False),
}
FIELD_NOMINAL = usm_gym.Scenario().nominal
PROBLEM_BUDGET = Budget(trials=20, episodes=3)


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Declare a space for the STA, and tune on episodes of a second."""
    entries = dict(registry._entries)
    entries["sta"] = replace(entries["sta"], space=SPACE)
    monkeypatch.setattr(registry, "_entries", entries)
    sample = tuning.sample_of

    def brief(*arguments: Any) -> Any:
        scenario = sample(*arguments)
        still = {"scan": NO_SCAN} if in_space(scenario.mode) else {"inspection": STILL}
        joints = {} if of_head(scenario.mode) else still
        return replace(scenario, duration=1.0, settle_time=0.2, **joints)

    monkeypatch.setattr(tuning, "sample_of", brief)


def problem(**changes: Any) -> Problem:
    return Problem(**{"policy": "sta", "budget": PROBLEM_BUDGET, **changes})


def test_the_objective_is_the_declared_one() -> None:
    scores = {name: np.full(2, 1.0) for name in METRICS}
    scores["max_error_x"] = np.array([1e-3, 3e-3])
    scores["max_error_y"] = np.array([2e-3, 4e-3])
    scores["thrust_variation"] = np.array([100.0, 300.0])
    scores["heading_error"] = np.radians([2.0, 4.0])
    evaluation = Evaluation(scores, np.zeros(2, bool))
    assert objective(evaluation) == pytest.approx(5.0 + 0.002 * 200.0 + 0.05 * 3.0)
    assert objective(evaluation, weight=0.0) == pytest.approx(5.0 + 0.05 * 3.0)


def test_every_eighth_scenario_reacts_later_than_the_policy_is_told() -> None:
    asked = problem(budget=Budget(20, 33))
    worse = {7: (1, 0.05), 15: (0, 0.065), 23: (1, 0.065), 31: (1, 0.05)}
    for purpose in (TUNING, VALIDATION):
        job = asked.job({}, purpose)
        assert job.nominal == FIELD_NOMINAL
        for episode, (told, met) in enumerate(
            zip(asked.scenarios(purpose), job.scenarios, strict=True)
        ):
            late, lag = worse.get(episode, (0, 0.05))
            expected = replace(told.conditions, action_delay=late, thruster_time_constant=lag)
            assert met == replace(told, conditions=expected)


def test_for_the_head_every_second_scenario_does() -> None:
    asked = problem(policy="rates-sta", mode="head", budget=Budget(20, 6))
    pairs = zip(asked.scenarios(TUNING), asked.job({}, TUNING).scenarios, strict=True)
    assert [told != met for told, met in pairs] == [False, True] * 3


def first_generation(storage: str, asked: Problem) -> list[dict[str, float]]:
    tune(asked, storage)
    study = optuna.load_study(study_name=asked.study, storage=storage)
    return [trial.params for trial in study.trials[: tuning.GENERATION]]


def test_every_search_starts_about_the_middle_of_its_ranges_whatever_gains_a_law_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    storage, brief = f"sqlite:///{tmp_path / 'trials.db'}", Budget(tuning.GENERATION, 1)
    sta = registry.entry("sta")
    other = replace(sta, factory=partial(sta.factory, surface=9.0, observer_gain=90.0))
    monkeypatch.setitem(registry._entries, "other", other)
    asked = [
        first_generation(storage, problem(policy=policy, budget=brief))
        for policy in ("sta", "other")
    ]
    assert asked[0] == asked[1]
    for name, span in SPACE.items():
        places = [span.place(gains[name]) for gains in asked[0]]
        assert min(places) < 0.5 < max(places)
        assert np.mean(places) == pytest.approx(0.5, abs=3 * tuning.SPREAD / np.sqrt(len(places)))


def test_of_gains_that_are_as_good_the_most_central_are_taken(tmp_path: Path) -> None:
    storage = f"sqlite:///{tmp_path / 'trials.db'}"
    result = tune(problem(), storage)
    study = optuna.load_study(study_name=problem().study, storage=storage)
    values = {trial.value: trial.params for trial in study.trials if trial.value is not None}
    best = min(values)

    def distance(gains: dict[str, float]) -> float:
        return max(abs(SPACE[name].place(gain) - 0.5) for name, gain in gains.items())

    good = [gains for value, gains in values.items() if value <= 1.01 * best]
    assert result.gains == min(good, key=distance)
    assert result.objective <= 1.01 * best


def test_tuning_improves() -> None:
    seen: list[tuple[int, float]] = []
    result = tune(problem(), progress=lambda trials, best: seen.append((trials, best)))
    assert seen[-1] == (20, result.objective)
    bests = [best for _, best in seen[1:]]
    assert bests == sorted(bests, reverse=True)
    assert result.validation < result.start
    assert set(result.gains) == set(SPACE)
    assert all(each.low <= result.gains[name] <= each.high for name, each in SPACE.items())


def test_the_result_is_the_same_for_any_workers_and_after_an_interruption(tmp_path: Path) -> None:
    whole = tune(problem())
    assert tune(problem(), workers=2) == whole
    storage = f"sqlite:///{tmp_path / 'trials.db'}"

    def interrupt(trials: int, best: float) -> None:
        if trials == 16:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tune(problem(), storage, progress=interrupt)
    assert tune(problem(), storage) == whole
    assert tune(problem(budget=Budget(8, 3)), storage) == tune(problem(budget=Budget(8, 3)))
    assert tune(problem(seed=1)) != whole


def test_another_problem_never_continues_a_study(monkeypatch: pytest.MonkeyPatch) -> None:
    one = problem()
    others = [
        problem(seed=1),
        problem(weight=0.01),
        problem(mode="torpedo"),
        problem(conditions=replace(FIELD, position_noise=0.0)),
        problem(budget=Budget(20, 4)),
    ]
    assert len({each.study for each in (one, *others)}) == 6
    assert problem(budget=Budget(40, 3)).study == one.study  # more trials go on with the others
    before, wider = one.study, {**SPACE, "surface": Range(0.1, 20.0, "1/s")}
    monkeypatch.setitem(registry._entries, "sta", replace(registry.entry("sta"), space=wider))
    assert problem().study != before


def test_tuning_cannot_reach_a_frozen_suite() -> None:
    # By imports: not even indirectly. By draws: no scenario, no noise seed in common.
    code = (
        "import grimp;"
        "graph = grimp.build_graph('usm_cli', 'usm_agents', 'usm_baselines', 'usm_gym');"
        "found = {m for m in graph.find_upstream_modules('usm_baselines.benchmark.tuning')"
        " | graph.find_upstream_modules('usm_cli.commands.tune') if 'suites' in m};"
        "print(sorted(found))"
    )
    answer = subprocess.check_output([sys.executable, "-c", code], text=True)
    assert answer.strip() == "[]"
    frozen = {each.noise_seed for name in suites.NAMES for each in suites.suite(name)}
    for seed in range(20):
        for purpose in (TUNING, VALIDATION):
            drawn = {each.noise_seed for each in problem(seed=seed).scenarios(purpose)}
            assert not drawn & frozen
    with pytest.raises(ValueError, match="purpose"):
        problem().scenarios(EVALUATION)


def test_no_two_purposes_share_a_stream() -> None:
    purposes = (SUITE, EVALUATION, TRAINING, TUNING, VALIDATION)
    assert len(set(purposes)) == 5
    drawn = {purpose: problem() for purpose in (TUNING, VALIDATION)}
    seeds = [each.noise_seed for purpose, p in drawn.items() for each in p.scenarios(purpose)]
    assert len(set(seeds)) == 6


def test_a_policy_that_never_acts_is_said_to() -> None:
    def broken(nominal: Any, **gains: float) -> Any:
        raise ValueError("no motor")

    registry.register("broken", broken, "broken", space={"gain": Range(1.0, 2.0, "1")})
    with pytest.raises(ValueError, match="no motor"):
        tune(problem(policy="broken", budget=Budget(2, 1)))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"policy": "zero"}, "zero"),
        ({"policy": "nobody"}, "nobody"),
        ({"budget": Budget(0, 3)}, "trials"),
        ({"budget": Budget(3, 0)}, "episodes"),
        ({"weight": -1.0}, "weight"),
        ({"seed": -1}, "seed"),
    ],
)
def test_what_makes_no_sense_is_refused(changes: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        problem(**changes)


def test_a_storage_that_cannot_be_used_gets_one_line() -> None:
    with pytest.raises(ValueError, match="storage nonsense"):
        tune(problem(), "nonsense")


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 1, 7, 8, 12, 19])
def test_a_search_that_was_killed_between_any_two_trials_goes_on_as_if_nothing_had_happened(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original, count = optuna.Study.add_trial, 0

    def killed(*arguments: Any, **options: Any) -> Any:
        nonlocal count
        count += 1
        if count > number:
            raise KeyboardInterrupt
        return original(*arguments, **options)

    storage = f"sqlite:///{tmp_path / 'trials.db'}"
    with monkeypatch.context() as patch:
        patch.setattr(optuna.Study, "add_trial", killed)
        with pytest.raises(KeyboardInterrupt):
            tune(problem(), storage)
    assert tune(problem(), storage) == tune(problem())


def test_a_study_in_a_file_belongs_to_one_process_at_a_time(tmp_path: Path) -> None:
    storage = f"sqlite:///{tmp_path / 'trials.db'}"
    brief, refused = problem(budget=Budget(8, 1)), []

    def meanwhile(trials: int, best: float) -> None:
        if trials == 0:
            with pytest.raises(BlockingIOError, match="in use by another command") as caught:
                tune(brief, storage)
            refused.append(caught.value)
            tune(problem(budget=Budget(1, 1), seed=1), storage)  # another study in the same file

    assert tune(brief, storage, progress=meanwhile) == tune(brief)
    assert len(refused) == 1


def test_a_disk_that_fills_up_gets_one_line(tmp_path: Path) -> None:
    def fill(connection: Any, *_: Any) -> None:
        connection.execute("PRAGMA max_page_count = 1")  # no more than there are

    engine, storage = sqlalchemy.engine.Engine, f"sqlite:///{tmp_path / 'trials.db'}"
    tune(problem(budget=Budget(1, 1)), storage)
    sqlalchemy.event.listen(engine, "checkout", fill)
    try:
        with pytest.raises(ValueError, match=r"trials\.db cannot be used: database .* full$"):
            tune(problem(budget=Budget(60, 1)), storage)
    finally:
        sqlalchemy.event.remove(engine, "checkout", fill)
    assert tune(problem(budget=Budget(2, 1)), storage)


def test_a_locked_database_gets_one_line(tmp_path: Path) -> None:
    with contextlib.closing(sqlite3.connect(tmp_path / "trials.db")) as other:
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(ValueError, match=r"cannot be used: database is locked$"):
            tune(problem(), f"sqlite:///{tmp_path / 'trials.db'}?timeout=0")


def test_a_password_is_not_said() -> None:
    with pytest.raises(ValueError, match="storage") as caught:
        tune(problem(), "nonsense://me:secret@host/trials")
    assert "secret" not in str(caught.value)


@pytest.mark.parametrize(("values", "taken"), [((1.0, 1.005, 2.0), 1), ((1.0, 1.02, 2.0), 0)])
def test_of_trials_that_are_as_good_the_most_central_is_taken(values, taken) -> None:
    assert chosen([0.9, 0.6, 0.5], values) == taken


def test_gains_near_an_end_are_taken_only_if_there_are_no_others() -> None:
    assert chosen([0.97, 0.9, 0.5], (1.0, 1.5, 2.0)) == 1
    assert chosen([0.97, 0.02, 0.96], (1.0, 1.5, 2.0)) == 0


def chosen(places: list[float], values: tuple[float, ...]) -> int:
    """Which of some trials is taken, whose gains lie at some places of their ranges."""
    asked = problem(budget=Budget(len(places), 1))
    study = optuna.create_study()
    for place, value in zip(places, values, strict=True):
        gains = {name: span.at(place) for name, span in asked.space.items()}
        spans = {
            name: FloatDistribution(span.low, span.high, log=span.log)
            for name, span in asked.space.items()
        }
        study.add_trial(create_trial(params=gains, distributions=spans, value=value))
    return tuning._chosen(study, asked).number
