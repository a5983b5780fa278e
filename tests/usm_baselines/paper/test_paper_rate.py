"""Plant and law in one loop, at the paper's step."""

import dataclasses

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from usm_baselines.paper.paper_rate import Law, simulate
from usm_baselines.paper.reproduction import at_step

from usm_gym.robot import Robot
from usm_gym.task.sampling import named


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


def test_the_joint_torque_is_what_the_controllers_make_of_the_angles():
    """At a step at which the joints, with a corner at 60 rad/s, are well resolved."""
    h, table1 = 1e-4, at_step(named("table1", "operation"), 1e-4)
    motion = dataclasses.replace(table1.inspection, times=(0.3, 0.6), deflections=(0.98, -0.98))
    scenario = dataclasses.replace(table1, inspection=motion, duration=0.9, settle_time=0.1)
    record = simulate(scenario, Law(), every=1)
    joints = -np.diff(record.theta, axis=1)
    asked = np.where(record.time < 0.6 - h / 2, 0.98, -0.98) * (record.time > 0.3 - h / 2)
    bends = np.arange(joints.shape[1]) >= joints.shape[1] - motion.bending_joints
    errors = asked[:, None] * bends / motion.bending_joints - joints
    torque = 9000.0 * errors - 150.0 * np.gradient(joints, h, axis=0)
    peak = np.abs(torque).max(axis=1)
    smooth = np.ones(record.time.size, bool)  # but for the jumps, which differences blur
    for jump in motion.times:
        smooth &= np.abs(record.time - jump) > 1e-3
    np.testing.assert_allclose(record.joint_torque[smooth], peak[smooth], atol=0.01 * peak.max())
    assert record.joint_torque.max() == pytest.approx(peak.max(), rel=0.02)
    coarse = simulate(scenario, Law(), every=100)
    assert (coarse.joint_torque == record.joint_torque.reshape(-1, 100).max(axis=1)).all()


def test_a_period_that_is_too_long_loses_the_robot_and_is_refused():
    scenario = at_step(named("table1", "operation"), 0.1)
    with pytest.raises(ValueError, match="not lost"):
        simulate(scenario, Law(), every=1)
