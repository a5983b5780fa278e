"""The residual task: its base to the bit, saturation once, and PPO on top of it."""

import subprocess
import sys
import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import baselines
import usm_gym
from agents.residual import ResidualPolicy

ID = "agents:USM-OperationResidual-v0"


def test_checkers_have_no_complaint():
    for check in (check_env, check_env_sb3):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            # The wrapper is the environment here; unwrapping it would check the plain one.
            warnings.filterwarnings("ignore", message=".*different from the unwrapped version.*")
            check(gym.make(ID, disable_env_checker=True).env.env)


@pytest.mark.parametrize("base", ["sta", "pd"])
def test_a_zero_residual_is_the_base_to_the_bit(base):
    plain, residual = gym.make("USM-Operation-v0"), gym.make(ID, base=base)
    policy = baselines.make(base, plain)
    observation, _ = plain.reset(seed=2)
    residual.reset(seed=2)
    state = None
    for _ in range(2000):
        action, state = policy.predict(observation, state)
        observation, reward, *_, info = plain.step(action)
        seen, its_reward, *_, its_info = residual.step(np.zeros(5, np.float32))
        assert (seen[:90] == observation).all()
        assert its_reward == reward
    assert its_info == info


def test_base_and_residual_are_saturated_once():
    env = gym.make(ID, residual_scale=6.0)
    observation, _ = env.reset(seed=0)
    for _ in range(200):
        base = observation[90:]
        residual = env.action_space.sample()
        observation, *_ = env.step(residual)
        wanted = np.clip(base + residual * np.float32(6.0 / 20.0), -1.0, 1.0)
        part = env.unwrapped.layout.slices["thruster_command"]
        np.testing.assert_allclose(observation[part], wanted, atol=2e-7)


def test_a_snapshot_holds_the_base_too():
    env = gym.make(ID, disable_env_checker=True).env
    env.reset(seed=1)
    actions = np.random.default_rng(0).uniform(-1, 1, (60, 5)).astype(np.float32)
    for action in actions[:30]:
        env.step(action)
    snapshot = env.snapshot()
    first = [env.step(action)[0] for action in actions[30:]]
    env.restore(snapshot)
    second = [env.step(action)[0] for action in actions[30:]]
    assert (np.array(first) == np.array(second)).all()


def test_arguments_survive_the_spec_and_bad_ones_are_refused():
    env = gym.make(ID, base="pd", residual_scale=3.0, conditions="rough")
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    first, second = env.reset(seed=0)[0], again.reset(seed=0)[0]
    assert (first == second).all()
    with pytest.raises(ValueError, match="policy is 'nobody'"):
        gym.make(ID, base="nobody")
    with pytest.raises(ValueError, match="residual_scale is -1"):
        gym.make(ID, residual_scale=-1.0)


@pytest.mark.parametrize("id", ["USM-Operation-v0", ID])
def test_ppo_learns_and_its_model_is_scored(id, tmp_path):
    env = gym.make(id)
    PPO("MlpPolicy", env, n_steps=1280, seed=0, device="cpu").learn(5000).save(tmp_path / "model")
    policy = PPO.load(tmp_path / "model", device="cpu")
    if id == ID:
        layout = env.unwrapped.layout
        policy = ResidualPolicy(baselines.make("sta", env), policy, 6.0, layout)
    scores = usm_gym.evaluate(policy, usm_gym.suite("operation")[:2])
    assert np.isfinite(scores.per_episode["max_error_x"]).all()


def test_importing_agents_does_not_import_torch():
    code = "import sys, agents, agents.main; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
