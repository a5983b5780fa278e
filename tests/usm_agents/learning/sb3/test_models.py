"""The network of an agent acts as the model of Stable-Baselines3 that was trained."""

import gymnasium as gym
import numpy as np
import pytest
import torch
from usm_agents.learning.sb3.models import CLASSES, make_model, network_of
from usm_agents.learning.sb3.vec_env import SB3VecEnv
from usm_agents.learning.settings import SETTINGS


@pytest.mark.parametrize("algorithm", list(CLASSES))
def test_a_network_is_what_the_model_does(algorithm):
    envs = gym.make_vec(
        "usm_agents:USM-OperationResidual-v0",
        num_envs=16,
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
    )
    model = make_model(algorithm, SETTINGS[algorithm], SB3VecEnv(envs))
    with torch.no_grad():
        for each in model.policy.parameters():
            each.mul_(3.0)
    random, network = np.random.default_rng(0), network_of(algorithm, model)
    their_state, our_state = None, None
    for start in (np.ones(100, bool), np.zeros(100, bool), random.random(100) < 0.5):
        seen = random.normal(size=(100, network.inputs)).astype(np.float32)
        expected, their_state = model.predict(seen, their_state, start, deterministic=True)
        found, our_state = network.predict(seen, our_state, start)
        np.testing.assert_allclose(found, expected, atol=1e-6)
        assert np.abs(found).max() > 1e-4
