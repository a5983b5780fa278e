"""Models of Stable-Baselines3 for the residual task, and the networks that act in them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from sb3_contrib import TQC, RecurrentPPO
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise, VectorizedActionNoise
from stable_baselines3.common.vec_env import VecEnv
from torch import nn

from usm_agents.artifact.network import Network, Recurrence

CLASSES: dict[str, type[BaseAlgorithm]] = {
    "ppo": PPO,
    "smooth-ppo": PPO,
    "recurrent-ppo": RecurrentPPO,
    "sac": SAC,
    "td3": TD3,
    "tqc": TQC,
}
# Settings that say what the reward is, and not how it is learned from.
REWARD = ("reward_scale", "variation_price")
ON_POLICY = ("ppo", "smooth-ppo", "recurrent-ppo")


@dataclass(frozen=True)
class LinearDecay:
    """A learning rate that falls linearly to a tenth over the training."""

    start: float

    def __call__(self, remaining: float) -> float:
        """The rate when this share of the training remains."""
        return self.start * (0.1 + 0.9 * remaining)


def make_model(algorithm: str, settings: Mapping[str, Any], env: VecEnv) -> BaseAlgorithm:
    """Make a model whose deterministic actions are nearly zero, so that the base acts as it is.

    Args:
        algorithm: A name of `CLASSES`.
        settings: As in `usm_agents.learning.settings`.
        env: Robots on the residual task.
    """
    arguments: dict[str, Any] = dict(settings)
    for name in ("robots", *REWARD):
        del arguments[name]
    policy: dict[str, Any] = {"net_arch": list(arguments.pop("hidden"))}
    kind = "MlpPolicy"
    if algorithm == "recurrent-ppo":
        kind, policy["lstm_hidden_size"] = "MlpLstmPolicy", arguments.pop("units")
    if algorithm in ON_POLICY:
        policy["activation_fn"] = nn.Tanh
        policy["log_std_init"] = arguments.pop("log_std_init")
        arguments["learning_rate"] = LinearDecay(arguments["learning_rate"])
    if algorithm == "td3":
        assert isinstance(env.action_space, Box)
        zero = np.zeros(env.action_space.shape)
        noise = NormalActionNoise(zero, zero + arguments.pop("noise"))
        arguments["action_noise"] = VectorizedActionNoise(noise, env.num_envs)
    model = CLASSES[algorithm](kind, env, policy_kwargs=policy, device="cpu", **arguments)
    with torch.no_grad():
        last = _layers(algorithm, model)[-1]
        last.weight.mul_(0.01)
        last.bias.zero_()
    return model


def network_of(algorithm: str, model: Any) -> Network:
    """Copy the part of a model that acts, deterministically, without torch."""
    layers = _layers(algorithm, model)
    on_policy = algorithm in ON_POLICY
    return Network(
        tuple(layer.weight.detach().numpy().T.copy() for layer in layers),
        tuple(layer.bias.detach().numpy().copy() for layer in layers),
        "tanh" if on_policy else "relu",
        "clip" if on_policy else "tanh",
        _recurrence(model.policy.lstm_actor) if algorithm == "recurrent-ppo" else None,
    )


def _recurrence(lstm: nn.LSTM) -> Recurrence:
    given, kept, one, other = (weight.detach().numpy() for weight in lstm.parameters())
    return Recurrence(given.T.copy(), kept.T.copy(), one + other)


def _layers(algorithm: str, model: Any) -> list[nn.Linear]:
    policy = model.policy
    if algorithm in ON_POLICY:
        modules = [*policy.mlp_extractor.policy_net, policy.action_net]
    elif algorithm == "td3":
        modules = [*policy.actor.mu]
    else:
        modules = [*policy.actor.latent_pi, policy.actor.mu]
    return [module for module in modules if isinstance(module, nn.Linear)]
