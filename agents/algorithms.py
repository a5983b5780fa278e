"""The algorithms that train agents, and the settings of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from sb3_contrib import TQC
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise, VectorizedActionNoise
from stable_baselines3.common.vec_env import VecEnv
from torch import nn

from agents.network import Activation, Network

# Rewards are multiplied by this in training, so that returns are of order one.
REWARD_SCALE = 0.1
# Robots side by side: for PPO a rollout is many robots by few steps, so that little time is spent
# between steps; the others learn after each step of all.
ROBOTS = {"ppo": 256, "sac": 32, "td3": 32, "tqc": 32}


@dataclass(frozen=True)
class Falling:
    """A learning rate that falls linearly to a tenth over the training."""

    start: float

    def __call__(self, remaining: float) -> float:
        """The rate when this share of the training remains."""
        return self.start * (0.1 + 0.9 * remaining)


def ppo(env: VecEnv) -> BaseAlgorithm:
    """PPO: small exploration around the base, which a new network leaves as it is."""
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=64,
        batch_size=1024,
        n_epochs=6,
        learning_rate=Falling(5e-4),
        gamma=0.97,
        gae_lambda=0.95,
        target_kl=0.03,
        policy_kwargs={"net_arch": [128, 128], "activation_fn": nn.Tanh, "log_std_init": -1.5},
        device="cpu",
    )
    _near_zero(model.policy.action_net)
    return model


OFF_POLICY: dict[str, Any] = {
    "learning_rate": 5e-4,
    "buffer_size": 300_000,
    "learning_starts": 10_000,
    "batch_size": 512,
    "gamma": 0.97,
    "train_freq": 1,
    "gradient_steps": 4,
    "device": "cpu",
}


def sac(env: VecEnv) -> BaseAlgorithm:
    """SAC."""
    model = SAC("MlpPolicy", env, ent_coef="auto_0.01", policy_kwargs=_hidden(), **OFF_POLICY)
    _near_zero(model.actor.mu)
    return model


def tqc(env: VecEnv) -> BaseAlgorithm:
    """TQC: SAC with truncated quantile critics."""
    model = TQC("MlpPolicy", env, ent_coef="auto_0.01", policy_kwargs=_hidden(), **OFF_POLICY)
    _near_zero(model.actor.mu)
    return model


def td3(env: VecEnv) -> BaseAlgorithm:
    """TD3, exploring with independent noise."""
    assert isinstance(env.action_space, Box)
    actions = env.action_space.shape[0]
    noise = NormalActionNoise(np.zeros(actions), np.full(actions, 0.2))
    model = TD3(
        "MlpPolicy",
        env,
        action_noise=VectorizedActionNoise(noise, env.num_envs),
        policy_kwargs=_hidden(),
        **OFF_POLICY,
    )
    _near_zero(model.actor.mu[-2])
    return model


ALGORITHMS: dict[str, Callable[[VecEnv], BaseAlgorithm]] = {
    "ppo": ppo,
    "sac": sac,
    "td3": td3,
    "tqc": tqc,
}
CLASSES: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3, "tqc": TQC}


def network_of(algorithm: str, model: Any) -> Network:
    """The part of a model that acts, deterministically, without torch."""
    policy = model.policy
    if algorithm == "ppo":
        layers = [*policy.mlp_extractor.policy_net, policy.action_net]
    elif algorithm == "td3":
        layers = [*policy.actor.mu]
    else:
        layers = [*policy.actor.latent_pi, policy.actor.mu]
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    activation: Activation = "tanh" if isinstance(layers[1], nn.Tanh) else "relu"
    return Network(
        tuple(layer.weight.detach().numpy().T.copy() for layer in linear),
        tuple(layer.bias.detach().numpy().copy() for layer in linear),
        activation,
        "clip" if algorithm == "ppo" else "tanh",
    )


def _hidden() -> dict[str, Any]:
    return {"net_arch": [128, 128]}  # a new one for each model, which writes into it


def _near_zero(layer: Any) -> None:
    with torch.no_grad():
        layer.weight.mul_(0.01)
        layer.bias.zero_()
