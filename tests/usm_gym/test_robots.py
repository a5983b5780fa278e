"""A scenario names its robot, and so fixes an episode completely."""

import json
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from support import oracle

import usm_gym
from usm_gym import Robot, Scenario, Thruster, robots
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import sample

SMALL = Robot(
    links=4, thrusters=(Thruster(2, "axial"), Thruster(1, "normal"), Thruster(4, "normal"))
)


@pytest.fixture
def small(monkeypatch):
    """The name of a small robot."""
    monkeypatch.setattr(robots, "_robots", dict(robots._robots))
    robots.register_robot("small", SMALL)
    return "small"


def test_a_name_has_one_robot(small):
    robots.register_robot(small, SMALL)
    with pytest.raises(ValueError, match="name is 'small'; allowed: one that no other robot has"):
        robots.register_robot(small, Robot())
    assert robots.robot_of(small) is SMALL
    assert robots.robot_of(None) == robots.robot_of("paper") == Robot()
    with pytest.raises(ValueError, match="robot is 'snake'; allowed: paper, small"):
        robots.robot_of("snake")


def test_a_scenario_is_read_back_with_its_robot(small):
    for robot in (small, SMALL, "paper"):
        scenario = sample("operation", PRESETS["field"], np.random.default_rng(0), robot)
        again = Scenario.from_dict(json.loads(json.dumps(scenario.to_dict())))
        assert again == scenario
        assert again.body == robots.robot_of(robot)
    assert "robot" not in scenario.to_dict()  # files from before robots had names stay as they are
    assert replace(scenario, robot=Robot()) == scenario
    with pytest.raises(ValueError, match="robot"):
        Scenario.from_dict({"robot": "snake"})


def test_suites_of_several_robots_are_scored_in_one_evaluation(small):
    draw = np.random.default_rng(1)
    drawn = [sample("torpedo", PRESETS["ideal"], draw, robot) for robot in (small, "paper") * 2]
    scenarios = [replace(scenario, duration=3.0, settle_time=1.0) for scenario in drawn]

    fleets = (Robot(), 5), (SMALL, 3)

    class Still:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            thrusters = {usm_gym.world.world_of(robot).layout.size: n for robot, n in fleets}
            return np.zeros((len(observation), thrusters[observation.shape[1]])), None

    robots._robots.pop(small)  # as in another process, which knows no such name
    together = usm_gym.evaluate(Still(), scenarios)
    alone = [usm_gym.evaluate(Still(), [scenario]) for scenario in scenarios]
    for name, values in together.per_episode.items():
        assert values.tolist() == [one.per_episode[name][0] for one in alone]


def test_an_environment_has_the_robot_of_its_scenarios(small):
    env = gym.make("USM-Operation-v0", robot=small)
    env.reset(seed=0)
    assert env.unwrapped.scenario.robot == SMALL
    assert env.unwrapped.nominal.robot == SMALL
    env.reset(options={"scenario": {"duration": 1.0, "inspection": {"bending_joints": 1}}})
    assert env.unwrapped.scenario.robot == SMALL
    with pytest.raises(ValueError, match=r"the scenario's robot is 'paper'; allowed: .* small"):
        env.reset(options={"scenario": usm_gym.suite("operation")[0]})


def test_robots_that_share_no_nominal_knowledge_make_no_policy():
    envs = gym.make_vec("USM-Operation-v0", num_envs=2, vectorization_mode="vector_entry_point")
    louder = replace(PRESETS["field"], position_noise=1e-3)
    scenario = usm_gym.suite("operation")[0]
    envs.reset(options={"scenario": [scenario, scenario.under(louder)]})
    with pytest.raises(ValueError, match="scenarios is '2 kinds'; allowed: one nominal knowledge"):
        usm_baselines.make("sta", envs)


def test_what_training_may_be_told_is_true_and_no_policy_sees_it():
    step = {"control_period": 1e-3, "physics_step": 1e-3, "thruster_time_constant": 0.0}
    mode = {"vectorization_mode": "vector_entry_point", "conditions": step}
    envs = gym.make_vec("USM-Operation-v0", num_envs=3, **mode).unwrapped
    envs.reset(seed=0)
    for _ in range(50):
        before = envs.simulation.read("velocity")
        *_, info = envs.step(envs.action_space.sample())
    truth = envs.truth()
    assert not set(truth) & set(info)
    robot, theta = Robot(), envs.simulation.read("theta")
    acceleration = (truth["velocity"] - before) / 1e-3
    for k, scenario in enumerate(envs.simulation.scenarios):
        coefficients = np.array(robot.hydrodynamic_coefficients) * scenario.water.coefficients
        np.testing.assert_array_equal(truth["coefficients"][k], coefficients)
        np.testing.assert_array_equal(truth["water_velocity"][k], scenario.water.current)
        pushes = oracle.input_matrix(robot, theta[k])[robot.links :, robot.links - 1 :]
        thrust = pushes @ envs.simulation.read("command")[k] / robot.total_mass
        expected = acceleration[k] - thrust
        np.testing.assert_allclose(truth["disturbance"][k], expected, rtol=1e-6, atol=1e-3)


def test_infinity_saturates_as_any_number_beyond_the_limit():
    envs = [gym.make("USM-Torpedo-v0") for _ in range(2)]
    for env, size in zip(envs, (np.inf, 7.0), strict=True):
        env.reset(seed=1)
        seen = env.step(np.array([size, -size, 0.5, -0.5, size]))[0]
    np.testing.assert_array_equal(seen, envs[0].unwrapped.simulation.observation[0])
    assert envs[0].unwrapped.simulation.read("command")[0].tolist() == [20, -20, 10, -10, 20]
