"""The loop at the paper's step, and the table made with it."""

import dataclasses

import gymnasium as gym
import numpy as np
import pytest

import baselines
from baselines.paper_rate import Law, simulate
from baselines.reproduction import PAPER, at_step, cases, run_cases, table
from usm_gym.scenario import named


def test_the_loop_is_the_environment_under_the_same_law():
    """Both sense, act and step in turn; the environment rounds to float32 in between."""
    scenario = dataclasses.replace(
        at_step(named("table1", "operation"), 1e-3), duration=2.0, settle_time=1.0
    )
    loop = simulate(scenario, Law(implicit=True), every=1)
    env = gym.make("USM-Operation-v0")
    observation, info = env.reset(options={"scenario": scenario})
    policy = baselines.make("sta", env, heading_gain=125.0)
    state = None
    for k in range(1, 2000):
        action, state = policy.predict(observation, state)
        observation, *_, info = env.step(action)
        error = [info["error_x"], info["error_y"]]
        np.testing.assert_allclose(error, loop.error[k], atol=2e-6)
    assert np.abs(loop.error).max() > 1e-3


def test_a_step_that_is_too_large_is_refused_and_no_nan_returned():
    scenario = at_step(named("table1", "operation"), 0.1)
    with pytest.raises(ValueError, match="stays finite"):
        simulate(scenario, Law(), every=1)
    with pytest.raises(ValueError, match="control_period"):
        simulate(named("table1", "operation"), Law())


def test_short_runs_are_the_same_bits_side_by_side_and_alone():
    chosen = [
        dataclasses.replace(
            case, scenario=dataclasses.replace(case.scenario, duration=0.05, settle_time=0.01)
        )
        for case in cases()
    ]
    first = run_cases(chosen, 2, lambda: None)
    second = run_cases(chosen, 1, lambda: None)
    assert first.keys() == second.keys()
    for key in first:
        for a, b in zip(first[key], second[key], strict=True):
            assert (a == b).all()


def test_the_tables_of_the_paper_in_half_a_minute():
    """The bounds that the reproduction has to keep, from the one declared scenario."""
    chosen = cases()
    result = table(chosen, run_cases(chosen, 2, lambda: None))
    rows, paper = result["rows"], PAPER
    for part, axes in paper["pd"].items():
        for axis, printed in axes.items():
            assert 0.5 < rows["pd"][part][axis] / printed < 2.0, (part, axis)
    for axis in "xy":
        assert 0.25 < rows["sta"]["operation"][axis] / paper["sta"]["operation"][axis] < 4.0
        for part in ("torpedo", "settled"):
            assert abs(rows["sta"][part][axis] / paper["sta"][part][axis] - 1.0) < 0.25
        assert rows["sta"]["settled"][axis] == pytest.approx(rows["sta"]["torpedo"][axis], rel=0.01)
        assert rows["sta"]["torpedo"][axis] < rows["pd"]["torpedo"][axis] / 3.0
        assert rows["sta"]["settled"][axis] < rows["pd"]["settled"][axis] / 8.0
