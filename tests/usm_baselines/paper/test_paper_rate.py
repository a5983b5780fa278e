"""The loop at the paper's step, and the table made with it."""

import dataclasses

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from support.results import PROVENANCE
from usm_baselines.paper.paper_rate import Law, simulate
from usm_baselines.paper.reproduction import (
    PAPER,
    STEP,
    at_step,
    cases,
    reproduction,
    run_cases,
)

from usm_gym.robot import Robot
from usm_gym.task.scenario import named


@pytest.mark.parametrize(
    ("period", "conditions", "tolerance"),
    [
        (1e-3, {}, 2e-6),
        (
            0.02,
            {"position_noise": 5e-5, "thruster_time_constant": 0.05, "thruster_limit": 20.0},
            2e-5,
        ),
    ],
)
def test_the_loop_is_the_environment_under_the_same_law(period, conditions, tolerance):
    """Both sense, act and step in turn; the environment rounds to float32 in between."""
    table1 = named("table1", "operation")
    scenario = dataclasses.replace(
        table1,
        conditions=dataclasses.replace(table1.conditions, control_period=period, **conditions),
        inspection=dataclasses.replace(table1.inspection, times=(0.5, 1.0, 1.5)),
        duration=2.0,
        settle_time=1.0,
    )
    loop = simulate(scenario, Law(implicit=True), every=scenario.conditions.substeps)
    env = gym.make("USM-Operation-v0")
    observation, info = env.reset(options={"scenario": scenario})
    policy = usm_baselines.make("sta", env, heading_gain=125.0)
    state = None
    for k in range(1, scenario.steps):
        action, state = policy.predict(observation, state)
        observation, *_, info = env.step(action)
        error = [info["error_x"], info["error_y"]]
        np.testing.assert_allclose(error, loop.error[k], atol=tolerance)
    assert np.abs(loop.error).max() > 1e-3


def test_with_the_velocity_measured_the_sliding_variable_is_that_of_equation_9():
    scenario = dataclasses.replace(
        at_step(named("table1", "torpedo"), 1e-4), duration=4.0, settle_time=1.0
    )
    record = simulate(scenario, Law(measured=True), every=1)
    rate = np.gradient(record.error, record.time, axis=0)
    late = record.time > 0.1
    np.testing.assert_allclose(record.sigma[late], (record.error + rate)[late], atol=1e-4)
    assert np.abs(record.sigma[~late]).max() > 0.01
    assert np.abs(record.error[record.time > 3.0]).max() < 2e-3


def test_the_disturbance_is_what_the_force_does_not_explain():
    scenario = dataclasses.replace(
        at_step(named("table1", "operation"), 1e-4), duration=11.0, settle_time=1.0
    )
    record = simulate(scenario, Law(reading=0), every=1)
    mass = Robot().total_mass
    expected = np.gradient(np.gradient(record.reference + record.error, 1e-4, axis=0), 1e-4, axis=0)
    late = (record.time > 0.1) & (record.time < 9.9)
    np.testing.assert_allclose(
        (record.disturbance + record.force / mass)[late], expected[late], atol=1e-3
    )
    assert np.abs(record.disturbance[record.time > 10.0]).max() > 1.0


def test_a_period_that_is_too_long_loses_the_robot_and_is_refused():
    scenario = at_step(named("table1", "operation"), 0.1)
    with pytest.raises(ValueError, match="not lost"):
        simulate(scenario, Law(), every=1)


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
    records = run_cases(cases(), 2, lambda: None)
    rows, paper = reproduction(STEP, records, PROVENANCE).rows, PAPER
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
        peak = rows["sta"]["operation"][axis]
        assert rows["sta-implicit"]["operation"][axis] == pytest.approx(peak, rel=0.05)
