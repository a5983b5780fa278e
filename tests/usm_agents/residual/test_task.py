"""An agent of the residual task is scored together with its base."""

import dataclasses

import gymnasium as gym
import numpy as np
import pytest
import usm_agents
import usm_baselines
from usm_agents.residual.task import Residual, ResidualPolicy

import usm_gym

ID = "usm_agents:USM-OperationResidual-v0"


class Still:
    """An agent that corrects nothing."""

    def __init__(self, actions=2):
        self.actions = actions

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.zeros((len(observation), self.actions), np.float32), state


def test_a_zero_residual_scores_as_the_base():
    scenarios = usm_gym.suite("operation")[:3]
    nominal = scenarios[0].nominal
    ours = usm_gym.evaluate(ResidualPolicy(Residual(nominal), Still()), scenarios)
    base = usm_gym.evaluate(usm_baselines.make("sta", nominal), scenarios)
    for name, values in base.per_episode.items():
        assert (ours.per_episode[name] == values).all()


def test_actions_of_another_task_are_refused():
    nominal = usm_gym.suite("operation")[0].nominal
    policy = ResidualPolicy(Residual(nominal, action="force"), Still(3))
    with pytest.raises(ValueError, match=r"action is \(1, 3\); allowed: shape \(1, 2\)"):
        policy.predict(np.zeros(94, np.float32))


def test_a_model_of_the_task_is_scored_with_its_base():
    stable_baselines3 = pytest.importorskip("stable_baselines3")
    env = gym.make(ID)
    model = stable_baselines3.PPO("MlpPolicy", env, seed=0, device="cpu")
    scenario = dataclasses.replace(usm_gym.suite("operation")[0], duration=1.0, settle_time=0.2)
    seen, info = env.reset(options={"scenario": scenario})
    truncated = False
    while not truncated:
        action, _ = model.predict(seen, deterministic=True)
        seen, _, _, truncated, info = env.step(action)
    envs = gym.make_vec(ID, num_envs=2, vectorization_mode="vector_entry_point")
    for task in (env, envs, envs.residual):
        scores = usm_gym.evaluate(usm_agents.ResidualPolicy(task, model), [scenario] * 2)
        for axis in "xy":
            expected = [info[f"max_error_{axis}"]] * 2
            # The network's last bits depend on how many robots it acts for.
            np.testing.assert_allclose(scores.per_episode[f"max_error_{axis}"], expected, rtol=1e-3)
    with pytest.raises(
        ValueError, match=r"is \(51,\); allowed: \(94,\); .* usm_agents.ResidualPolicy"
    ):
        usm_gym.evaluate(model, [scenario])
    with pytest.raises(ValueError, match="allowed: an environment of the residual task"):
        usm_agents.ResidualPolicy(env.unwrapped, model)
