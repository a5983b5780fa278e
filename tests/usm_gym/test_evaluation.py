"""The one evaluation loop scores what really happens, the same however the work is done."""

import json
from dataclasses import replace
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray
from support.episodes import METRICS

import usm_gym
from usm_gym import Inspection, Path, Robot, Scenario, Thruster
from usm_gym.evaluation import Evaluation, joined, rollout
from usm_gym.task import metrics
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import sample

Array = NDArray[np.float64]

ROBOT = Robot()


def short(mode: Any, preset: str, seed: int, duration: float = 6.0) -> Scenario:
    """Return a drawn scenario that is soon over, its joints moving all the same."""
    scenario = sample(mode, PRESETS[preset], np.random.default_rng(seed))
    return replace(
        scenario,
        inspection=replace(scenario.inspection, times=(2.0,), deflections=(0.8,)),
        duration=duration,
        settle_time=0.5,
    )


@cache
def mixed() -> tuple[Scenario, ...]:
    """Return scenarios of several modes, lengths and timings, not in any order."""
    operation = [short("operation", "basin", k, 6.0 + k % 3) for k in range(4)]
    fast = replace(PRESETS["field"], physics_step=2e-3)
    fine = replace(PRESETS["field"], physics_step=5e-4, hydrodynamics="kelasidi2014")
    return (
        operation[0],
        replace(operation[1], conditions=fast),
        short("torpedo", "field", 7),
        operation[2],
        replace(operation[3], conditions=fine, duration=7.0),
        replace(operation[0], conditions=fast, duration=6.5),
    )


def policy(id: str = "sta") -> Any:
    return usm_baselines.make(id, gym.make("USM-Operation-v0"))


@cache
def scored() -> Evaluation:
    return usm_gym.evaluate(policy(), mixed())


def assert_same(one: Evaluation, other: Evaluation, order: Any = slice(None)) -> None:
    """Assert that two evaluations have the same bits, the other's episodes being reordered."""
    assert list(one.per_episode) == list(other.per_episode) == METRICS
    for name, values in one.per_episode.items():
        assert np.array_equal(values, other.per_episode[name][order]), name
    assert np.array_equal(one.failed, other.failed[order])


class Still:
    """Any constant action."""

    privileged = False

    def __init__(self, action: Any = 0.0, thrusters: int = 5) -> None:
        self.action = np.broadcast_to(np.float32(action), (thrusters,))

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, **_: Any
    ) -> tuple[Any, Any]:
        return np.tile(self.action, (len(observation), 1)), state


def test_workers_do_not_matter() -> None:
    assert_same(usm_gym.evaluate(policy(), mixed(), workers=2), scored())


@pytest.mark.parametrize("id", ["sta", "pd"])
def test_in_space_neither_workers_nor_company_nor_order_matter(id: str) -> None:
    scenarios = [
        replace(scenario, duration=2.0, settle_time=0.5) for scenario in usm_gym.suite("torpedo3d")
    ][:10]
    law: Any = usm_baselines.make(id, scenarios[0].nominal)
    whole = usm_gym.evaluate(law, scenarios)  # two blocks
    assert not whole.failed.any()
    parts = [usm_gym.evaluate(law, scenarios[:1]), usm_gym.evaluate(law, scenarios[:0:-1])]
    order = [0, *range(9, 0, -1)]
    others = [joined(parts)]
    if id == "sta":
        others.append(usm_gym.evaluate(law, [scenarios[k] for k in order], workers=2))
    for other in others:
        for name, values in whole.per_episode.items():
            np.testing.assert_array_equal(values[order], other.per_episode[name], name)
    assert {"max_error_z", "pitch_error", "yaw_error", "roll"} <= set(whole.per_episode)


def test_in_space_the_scores_are_those_of_the_environment_stepped_by_hand() -> None:
    (scenario,) = usm_gym.suite("operation3d")[:1]
    scenario = replace(scenario, duration=4.0, settle_time=1.0)
    env = gym.make("USM-Operation3D-v0")
    observation, info = env.reset(options={"scenario": scenario})
    law: Any = usm_baselines.make("pid", env)
    state, largest, over = None, np.zeros(3), False
    while not over:
        action, state = law.predict(observation, state)
        observation, *_, over, info = env.step(action)
        if env.unwrapped.simulation.count[0] >= 50:
            angles = [abs(info[f"{angle}_error"]) for angle in ("pitch", "yaw", "roll")]
            largest = np.maximum(largest, angles)
    scores = usm_gym.evaluate(law, [scenario]).per_episode
    for axis in "xyz":
        assert scores[f"max_error_{axis}"][0] == info[f"max_error_{axis}"]
    assert [scores[name][0] for name in ("pitch_error", "yaw_error", "roll")] == largest.tolist()


def test_the_order_of_scenarios_does_not_matter() -> None:
    order = [3, 0, 5, 4, 1, 2]
    turned = usm_gym.evaluate(policy(), [mixed()[k] for k in order])
    assert_same(turned, scored(), order)


def test_the_company_of_scenarios_does_not_matter() -> None:
    for k in (0, 1, 4):
        assert_same(usm_gym.evaluate(policy(), [mixed()[k]]), scored(), [k])
    twice = usm_gym.evaluate(policy(), [*mixed()[:2], *mixed()[:2]])
    assert_same(twice, scored(), [0, 1, 0, 1])


def test_control_periods_may_differ_where_the_policy_knows_of_none() -> None:
    slow, fast = (
        replace(
            short("operation", "field", 3),
            conditions=replace(PRESETS["field"], control_period=period),
            path=Path(speed=0.01, amplitude=0.0),
        )
        for period in (0.02, 0.01)
    )
    both = usm_gym.evaluate(Still(), [slow, fast, slow])
    for k, scenario in ((0, slow), (1, fast), (2, slow)):
        assert_same(usm_gym.evaluate(Still(), [scenario]), both, [k])
    assert both.per_episode["rms_error_x"][0] != both.per_episode["rms_error_x"][1]
    with pytest.raises(ValueError, match="control_period"):
        usm_gym.evaluate(policy(), [slow, fast])


def test_the_scores_are_all_different_numbers() -> None:
    # Else the tests above would prove little.
    for name, values in scored().per_episode.items():
        assert np.isfinite(values).all()
        assert len(set(values)) >= (1 if name == "saturation_share" else 6), name


@pytest.mark.parametrize("id", ["sta", "pd"])
@pytest.mark.parametrize("k", [0, 1, 2])
def test_the_scores_are_those_of_the_environment_stepped_by_hand(id: str, k: int) -> None:
    scenario = mixed()[k]
    env = gym.make(f"USM-{scenario.mode.capitalize()}-v0")
    observation, info = env.reset(options={"scenario": scenario})
    by_name: Any = usm_baselines.make(id, env)
    state, errors, headings, commands, over = None, [], [], [], False
    while not over:
        action, state = by_name.predict(observation, state)
        observation, _, terminated, truncated, info = env.step(action)
        errors.append((info["error_x"], info["error_y"]))
        headings.append(info["heading_error"])
        commands.append(env.unwrapped.simulation.read("command")[0].copy())
        over = terminated or truncated
    assert not terminated
    period, settle = scenario.conditions.control_period, 0.5
    time = period * np.arange(1, len(errors) + 1)
    expected = {
        "max_error": metrics.max_error(time, errors, settle),
        "settled_error": metrics.settled_error(time, errors, scenario.shifts, settle),
        "rms_error": metrics.rms_error(time, errors, settle),
    }
    assert len(errors) == scenario.steps
    scores = usm_gym.evaluate(by_name, mixed()[:3]).per_episode
    for name, (x, y) in expected.items():
        assert (scores[f"{name}_x"][k], scores[f"{name}_y"][k]) == (x, y)
    assert scores["max_error_x"][k] == info["max_error_x"]
    assert scores["max_error_y"][k] == info["max_error_y"]
    assert scores["heading_error"][k] == np.abs(headings)[time >= settle].max()
    assert scores["thrust_effort"][k] == metrics.thrust_effort(commands)
    assert scores["thrust_variation"][k] == metrics.thrust_variation(commands, period)
    limit = scenario.conditions.thruster_limit
    assert scores["saturation_share"][k] == metrics.saturation_share(commands, limit)


def test_trajectories_are_those_of_the_control_instants() -> None:
    scenarios = mixed()
    for scenario, trajectory in zip(scenarios, rollout(policy(), scenarios), strict=True):
        assert trajectory.scenario is scenario
        steps = scenario.steps
        assert trajectory.time[0] == scenario.conditions.control_period
        assert trajectory.time[-1] == pytest.approx(scenario.duration)
        assert trajectory.error.shape == (steps, 2)
        assert trajectory.command.shape == (steps, 5)
        assert trajectory.attitude_error.shape == (steps, 1)
        assert not trajectory.lost


def test_a_lost_episode_counts_as_half_a_metre_or_worse_in_both_axes() -> None:
    # At 0.3 m/s along x, a robot at rest falls behind: 0.5 m are lost after some 2.7 s.
    away = replace(short("torpedo", "ideal", 0), path=Path(speed=0.3, amplitude=0.0))
    near = replace(away, path=Path(speed=0.01, amplitude=0.0))
    result = usm_gym.evaluate(Still(), [near, away, near])
    assert result.failed.tolist() == [False, True, False]
    for name in METRICS[:6]:
        assert 0.5 <= result.per_episode[name][1] < 0.52
        assert result.per_episode[name][0] < 0.1
    summary = result.summary()
    assert summary["failures"] == 1
    assert summary["lost_share"] == pytest.approx(1 / 3)
    assert summary["max_error_y"]["median"] == result.per_episode["max_error_y"][[0, 2]].max()
    assert summary["per_episode"]["failed"] == [False, True, False]
    assert summary["max_error_y"]["worst"] >= 0.5
    assert summary["max_error_y"]["mean"] > 0.5 / 3.0  # it enters the mean
    json.dumps(summary, allow_nan=False)


def scan() -> Scenario:
    """Return a short scan of five shifts."""
    scenario = short("operation", "field", 0, 7.0)
    motion = Inspection(times=(1.0, 2.0, 3.0, 4.0, 5.0), deflections=(0.4, -0.4, 0.4, -0.4, 0.4))
    path = Path(speed=0.01, amplitude=0.0)
    return replace(scenario, inspection=motion, path=path)


def test_a_scan_has_the_errors_by_shift() -> None:
    (trajectory,) = rollout(policy(), [scan()])
    result = usm_gym.evaluate(policy(), [scan(), scan()])
    assert list(result.per_episode)[: len(METRICS)] == METRICS
    for name, start, end in (("first", 1, 2), ("third", 3, 4), ("fifth", 5, 7), ("last", 5, 7)):
        after = [
            error
            for t, error in zip(trajectory.time, trajectory.error, strict=True)
            if start - 1e-6 < t < end - 1e-6 or t == end == 7.0
        ]
        for k, axis in enumerate("xy"):
            found = result.per_episode[f"{name}_shift_error_{axis}"]
            assert found.tolist() == [max(abs(error[k]) for error in after)] * 2


def test_of_a_lost_scan_every_shift_counts_as_half_a_metre() -> None:
    away = replace(scan(), path=Path(speed=0.3, amplitude=0.0))
    result = usm_gym.evaluate(Still(), [away])
    assert result.failed.all()
    shifts = [values for name, values in result.per_episode.items() if "_shift_error_" in name]
    assert len(shifts) == 8
    assert all(0.5 <= values[0] < 0.52 for values in shifts)


def test_errors_by_shift_are_those_of_all_episodes_or_of_none() -> None:
    fewer = replace(scan(), inspection=Inspection(times=(1.0,), deflections=(0.4,)))
    later = replace(scan(), duration=4.5)
    for other in (fewer, later):
        assert list(usm_gym.evaluate(Still(), [scan(), other]).per_episode) == METRICS
    parts = [usm_gym.evaluate(Still(), [each]) for each in (scan(), fewer)]
    assert list(joined(parts).per_episode) == METRICS


def test_a_loss_before_settling_is_a_loss() -> None:
    away = replace(
        short("torpedo", "ideal", 0),
        path=Path(speed=0.3, amplitude=0.0),
        inspection=Inspection(times=(), deflections=()),
        settle_time=5.0,
    )
    result = usm_gym.evaluate(Still(), [away])
    assert result.failed.all()
    assert result.per_episode["max_error_x"][0] >= 0.5


def test_a_state_that_is_not_finite_is_a_loss_too() -> None:
    # Euler's forward method at 1 ms is unstable.
    near = replace(short("operation", "field", 0), path=Path(speed=0.01, amplitude=0.0))
    conditions = replace(PRESETS["field"], integrator="explicit")
    result = usm_gym.evaluate(Still(), [replace(near, conditions=conditions), near])
    assert result.failed.tolist() == [True, False]
    assert all(np.isfinite(values).all() for values in result.per_episode.values())
    assert min(result.per_episode[name][0] for name in METRICS[:6]) >= 0.5
    json.dumps(result.summary(), allow_nan=False)


def test_nothing_is_scored_after_a_loss() -> None:
    away = replace(short("torpedo", "ideal", 0), path=Path(speed=0.3, amplitude=0.0))
    trajectory = rollout(Still(), [away, replace(away, path=Path(speed=0.0))])[0]
    assert trajectory.lost
    assert len(trajectory.time) == len(trajectory.error) == len(trajectory.command)
    assert np.abs(trajectory.error[-1]).max() > 0.5
    assert np.abs(trajectory.error[:-1]).max() <= 0.5


def test_actions_beyond_the_bounds_saturate() -> None:
    scenarios = [short("operation", "field", 0, 2.0)]
    result = usm_gym.evaluate(Still([1.0, -1.0, 1.0, -1.0, 1.0]), scenarios)
    assert_same(usm_gym.evaluate(Still([9.0, -30.0, 1.0, -1.0, 2.0]), scenarios), result)
    assert result.per_episode["saturation_share"][0] == 1.0
    assert result.per_episode["thrust_effort"][0] == 20.0
    assert result.per_episode["thrust_variation"][0] == 0.0


@pytest.mark.parametrize("workers", [1, 2])
def test_progress_adds_up_to_the_episodes(workers: int) -> None:
    away = replace(short("torpedo", "ideal", 0), path=Path(speed=0.3, amplitude=0.0))
    for scenarios in (mixed()[:3], [away, away]):  # to the end, or lost before
        reports: list[float] = []
        usm_gym.evaluate(Still(), scenarios, workers=workers, progress=reports.append)
        assert sum(reports) == pytest.approx(len(scenarios))
        assert min(reports) > 0.0


def test_another_robot_may_be_scored() -> None:
    robot = Robot(
        links=4, thrusters=(Thruster(2, "axial"), Thruster(1, "normal"), Thruster(4, "normal"))
    )
    scenario = Scenario(
        inspection=Inspection(bending_joints=1, times=(), deflections=()),
        conditions=PRESETS["ideal"],
        path=Path(speed=0.01, amplitude=0.0),
        duration=6.0,
        settle_time=0.5,
    )
    env = gym.make("USM-Operation-v0", robot={"links": 4, "thrusters": robot.thrusters})
    result = usm_gym.evaluate(usm_baselines.make("sta", env), [scenario], robot=robot)
    assert result.per_episode["max_error_x"][0] < 1e-3
    with pytest.raises(ValueError, match="action"):
        usm_gym.evaluate(Still(), [scenario], robot=robot)
    with pytest.raises(ValueError, match="bending_joints"):
        usm_gym.evaluate(Still(thrusters=3), [Scenario()], robot=robot)


def test_a_summary_is_that_of_its_episodes() -> None:
    summary = scored().summary()
    for name in METRICS:
        values = scored().per_episode[name]
        row = summary[name]
        assert row["mean"] == pytest.approx(values.mean())
        assert row["worst"] == values.max()
        assert np.sum(values < row["median"]) == np.sum(values > row["median"]) == 3
        low, high = row["ci95"]
        assert values.min() <= low <= row["mean"] <= high <= values.max()
        assert summary["per_episode"][name] == values.tolist()
    assert summary["failures"] == 0
    assert json.dumps(summary) == json.dumps(scored().summary())  # the bootstrap has a seed


def test_a_privileged_policy_is_given_the_true_state() -> None:
    class Seer(Still):
        privileged = True

        def predict(self, observation: Any, state: Any = None, *rest: Any, **known: Any) -> Any:
            seen.append(known.pop("snapshot").arrays["error"].copy())
            return super().predict(observation, state, *rest, **known)

    seen: list[Array] = []
    scenario = short("operation", "field", 0, 1.0)
    (trajectory,) = rollout(Seer(), [scenario])
    assert np.array_equal(np.concatenate(seen[1:]), trajectory.error[:-1])
