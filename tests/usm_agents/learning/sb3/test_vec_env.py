"""The native vector environment as Stable-Baselines3 sees it."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import usm_baselines
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv
from usm_agents.learning.sb3.vec_env import SB3VecEnv

import usm_gym

ID = "USM-Operation-v0"
HARD = {"thruster_limit": 3.0, "current_limit": 0.3}


def vec_env(count, reward=None, id=ID, **arguments):
    envs = gym.make_vec(
        id,
        num_envs=count,
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
        **arguments,
    )
    return SB3VecEnv(envs, **(reward or {}))


@pytest.mark.parametrize("id", [ID, "USM-Operation3D-v0"])
def test_it_behaves_as_sb3s_own_over_monitored_environments(id):
    envs = vec_env(3, id=id, conditions=HARD)
    reference = DummyVecEnv([lambda: Monitor(gym.make(id, conditions=HARD))] * 3)
    for each in (envs, reference):
        each.seed(5)
    assert (envs.reset() == reference.reset()).all()
    assert envs.reset_infos == reference.reset_infos
    ends = 0
    shape = 900, 3, *envs.action_space.shape
    for action in np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32):
        ours, theirs = envs.step(action), reference.step(action)
        for a, b in zip(ours[:3], theirs[:3], strict=True):
            assert (a == b).all()
        for info, expected, done in zip(ours[3], theirs[3], ours[2], strict=True):
            if not done:
                assert info == {}
                continue
            ends += 1
            assert info.keys() == expected.keys()
            assert (info["terminal_observation"] == expected["terminal_observation"]).all()
            assert info["episode"]["r"] == pytest.approx(expected["episode"]["r"], abs=1e-5)
            for key in ("TimeLimit.truncated", "error_x", "max_error_y", "diverged"):
                assert info[key] == expected[key]
            assert info["episode"]["l"] == expected["episode"]["l"]
    assert ends >= 3


def test_a_time_limit_is_told_from_a_loss():
    envs = vec_env(2)
    policy = usm_baselines.make("sta", envs)
    observations, state = envs.reset(), None
    for _ in range(2000):
        actions, state = policy.predict(observations, state)
        observations, _, done, infos = envs.step(actions)
    assert done.all()
    assert all(info["TimeLimit.truncated"] and info["diverged"] == 0 for info in infos)


def test_attributes_methods_and_options():
    envs = vec_env(3)
    assert envs.get_attr("nominal", indices=[0, 2]) == [envs.get_attr("nominal")[0]] * 2
    envs.set_attr("note", 7)
    assert envs.get_attr("note") == [7, 7, 7]
    assert envs.env_method("close_extras", indices=1) == [None]
    assert envs.env_is_wrapped(Monitor) == [True] * 3
    suite = usm_gym.suite("operation")
    envs.set_options([{"scenario": scenario} for scenario in suite[:3]])
    envs.reset()
    assert envs.get_attr("simulation")[0].scenarios == suite[:3]
    envs.reset()
    assert envs.get_attr("simulation")[0].scenarios != suite[:3]


def test_evaluate_policy_scores_a_scripted_policy():
    envs = vec_env(4)
    envs.seed(0)
    rewards, lengths = evaluate_policy(
        usm_baselines.make("sta", envs), envs, n_eval_episodes=4, return_episode_rewards=True
    )
    assert lengths == [2000] * 4
    assert min(rewards) > -8000


@pytest.mark.slow
def test_ppo_trains_on_it():
    envs = vec_env(16)
    model = PPO("MlpPolicy", envs, n_steps=64, batch_size=256, n_epochs=2, seed=0, device="cpu")
    model.learn(4096)
    scores = usm_gym.evaluate(model, usm_gym.suite("operation")[:2])
    assert np.isfinite(scores.per_episode["max_error_x"]).all()


@pytest.mark.slow
def test_a_model_with_its_environment_is_scored_by_several_workers():
    model = PPO("MlpPolicy", "usm_gym:USM-Operation-v0", device="cpu", seed=0)
    assert model.get_env().render_mode == "rgb_array"
    short = [replace(each, duration=1.0, settle_time=0.5) for each in usm_gym.suite("operation")]
    one, two = (usm_gym.evaluate(model, short[:2], workers=workers) for workers in (1, 2))
    for name, values in one.per_episode.items():
        np.testing.assert_allclose(two.per_episode[name], values, rtol=1e-3)


def test_the_residual_task_is_one_too():
    envs = gym.make_vec(
        "usm_agents:USM-OperationResidual-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
        conditions=HARD,
    )
    scaled, plain = SB3VecEnv(envs, reward_scale=0.1), vec_env(3, conditions=HARD)
    policy = usm_baselines.make("sta", plain)
    for each in (scaled, plain):
        each.seed(5)
    scaled.reset()
    observations, state, done = plain.reset(), None, np.ones(3, bool)
    ends = 0
    for _ in range(700):
        actions, state = policy.predict(observations, state, done)
        observations, rewards, done, infos = plain.step(actions)
        seen, its_rewards, its_done, its_infos = scaled.step(np.zeros((3, 2), np.float32))
        np.testing.assert_allclose(its_rewards, 0.1 * rewards, rtol=1e-6)
        assert (its_done == done).all()
        for index in np.flatnonzero(done):
            ends += 1
            assert its_infos[index]["episode"]["r"] == infos[index]["episode"]["r"]
            assert its_infos[index]["terminal_observation"].shape == seen[index].shape
    assert ends >= 3


def test_what_commands_change_by_has_its_price():
    plain = vec_env(3, conditions=HARD)
    priced = vec_env(3, {"reward_scale": 0.5, "variation_price": 0.01}, conditions=HARD)
    for each in (plain, priced):
        each.seed(5)
        each.reset()
    limit, period = HARD["thruster_limit"], plain.get_attr("nominal")[0].control_period
    before, ends, taken = np.zeros((3, 5)), 0, []
    free = np.ones(3, bool)  # in the first step of an episode, and in the last one
    actions = np.random.default_rng(0).uniform(-2, 2, (500, 3, 5)).astype(np.float32)
    for k, action in enumerate(actions):
        if k == 150:
            snapshot = priced.snapshot()
        _, rewards, done, _ = plain.step(action)
        taken.append(priced.step(action)[1])
        command = limit * action.clip(-1.0, 1.0)
        variation = np.abs(command - before).mean(axis=1) / period
        expected = 0.5 * (rewards - np.where(free | done, 0.0, 0.01 * variation))
        np.testing.assert_allclose(taken[-1], expected, rtol=1e-5)
        before, free = command, done
        ends += done.sum()
    assert ends >= 3
    priced.restore(snapshot)
    replayed = [priced.step(action)[1] for action in actions[150:]]
    assert (np.array(replayed) == np.array(taken[150:])).all()


def test_other_environments_are_refused():
    envs = gym.make_vec(ID, num_envs=2, vectorization_mode="vector_entry_point")
    with pytest.raises(ValueError, match="autoreset_mode is 'NextStep'"):
        SB3VecEnv(envs)
    with pytest.raises(ValueError, match="a TrackingVectorEnv"):
        SB3VecEnv(gym.make_vec("CartPole-v1", num_envs=2, vectorization_mode="vector_entry_point"))
