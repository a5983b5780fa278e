"""The seam between body and task: a toy world goes through everything, and nothing knows it."""

from itertools import pairwise

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from support.ball import Ball, BallScenario

import usm_gym
from usm_gym.simulation import Simulation
from usm_gym.statistics import compare
from usm_gym.task.metrics import axes_of

SCENARIOS = [BallScenario(speed=0.05 + 0.01 * k, noise_seed=k) for k in range(10)]


def test_a_simulation_drives_any_world():
    simulation = Simulation(SCENARIOS)
    assert simulation.error.shape == (10, 3)
    assert simulation.attitude_error.shape == (10, 0)
    start = simulation.snapshot()
    runs = []
    for _ in range(2):
        for _ in range(20):
            simulation.step(np.full((10, 3), [2.0, 0.1, -2.0]))  # beyond saturation
        np.testing.assert_array_equal(simulation.read("command")[:, 0], 20.0)
        runs.append((simulation.observation.copy(), simulation.error.copy()))
        simulation.restore(start)
    for one, other in pairwise(runs):
        assert all(map(np.array_equal, one, other))
    x, y, z = runs[0][1].T
    assert (x > y).all()
    assert (y > z).all()
    with pytest.raises(ValueError, match="robot"):
        simulation.start(0, BallScenario(robot=Ball(mass=2.0)))


def test_the_checkers_have_nothing_to_say(checkers):
    for check in checkers:
        check(gym.make("Ball-v0").unwrapped)


@pytest.mark.parametrize("threads", [1, 2])
def test_many_have_the_bits_of_one(threads):
    mode = {"vectorization_mode": "vector_entry_point", "autoreset_mode": "SameStep"}
    envs = gym.make_vec("Ball-v0", num_envs=9, threads=threads, **mode)
    ones = [gym.make("Ball-v0") for _ in range(9)]
    seen = envs.reset(seed=5)[0]
    for k, env in enumerate(ones):
        np.testing.assert_array_equal(env.reset(seed=5 + k)[0], seen[k])
    draw = np.random.default_rng(0)
    for _ in range(50):
        actions = draw.uniform(-0.3, 0.3, (9, 3)).astype(np.float32)
        seen, rewards, *_, info = envs.step(actions)
        for k, env in enumerate(ones):
            one, reward, _, _, known = env.step(actions[k])
            np.testing.assert_array_equal(one, seen[k])
            assert reward == rewards[k]
            assert known["max_error_z"] == info["max_error_z"][k]


def test_the_same_laws_hold_three_axes():
    env = gym.make("Ball-v0")
    scores = {id: usm_gym.evaluate(usm_baselines.make(id, env), SCENARIOS) for id in ("sta", "pd")}
    for one in scores.values():
        assert axes_of(one.per_episode) == ("x", "y", "z")
        assert not one.failed.any()
        assert all(values.max() < 0.03 for values in errors_of(one))
    assert "heading_error" not in scores["sta"].per_episode
    found = compare(scores["pd"].objective(), scores["sta"].objective())
    assert found.second < found.first


def errors_of(scores):
    return [scores.per_episode[f"max_error_{axis}"] for axis in "xyz"]


def test_a_law_that_foresees_the_robot_says_so_where_none_can():
    for id in ("lqg-joints", "mpc", "adaptive", "informed"):
        with pytest.raises(ValueError, match="robot is"):
            usm_baselines.make(id, BallScenario().nominal)
