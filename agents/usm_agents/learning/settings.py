"""Settings of the algorithms that train agents: learning rates, batches, layers, robots.

Names without a comment are arguments of Stable-Baselines3; what is not named has its default there.
"""

from __future__ import annotations

from typing import Any

# Rewards are multiplied by this in training, so that returns are of order one.
REWARD_SCALE = 0.1
# What is taken from them for each N/s of thrust variation, which the environment's reward leaves
# free and the objective, by which agents are chosen, does not.
VARIATION_PRICE = 1e-4

_PPO: dict[str, Any] = {
    "hidden": (128, 128),  # widths of the hidden layers
    "n_steps": 16,
    "batch_size": 1024,
    "n_epochs": 4,
    "learning_rate": 1e-3,  # at the start; falls linearly to a tenth over the training
    "gamma": 0.93,
    "gae_lambda": 0.9,
    "target_kl": 0.03,
    "log_std_init": -1.5,  # small exploration around the base
}
# Exploration that depends on what is seen and changes only now and then (gSDE; Raffin, Kober and
# Stulp, CoRL 2021). A heavy robot feels nothing of noise that is new in every period.
_SMOOTH = _PPO | {
    "use_sde": True,
    "sde_sample_freq": 8,
    "log_std_init": -3.3,  # of weights, and so of as much as above in all
    "gamma": 0.97,
    "gae_lambda": 0.95,
}
_RECURRENT = _PPO | {"hidden": (64,), "units": 64, "batch_size": 2048, "n_steps": 64}  # LSTM units
_REPLAY: dict[str, Any] = {
    "hidden": (64, 64),
    "learning_rate": 5e-4,
    "buffer_size": 300_000,
    "learning_starts": 10_000,
    "batch_size": 256,
    "gamma": 0.97,
    "train_freq": 1,
    "gradient_steps": 2,
}
# Robots swim side by side. For PPO a rollout is many robots by few steps, so that little time is
# spent between steps; the others learn after every step of all robots.
_REWARD = {"reward_scale": REWARD_SCALE, "variation_price": VARIATION_PRICE}
_MANY = {"robots": 256, **_REWARD}
_FEW = {"robots": 32, **_REWARD}

SETTINGS: dict[str, dict[str, Any]] = {
    "ppo": _PPO | _MANY,
    "smooth-ppo": _SMOOTH | _MANY,
    "recurrent-ppo": _RECURRENT | _MANY,
    "sac": _REPLAY | {"ent_coef": "auto_0.01"} | _FEW,
    "td3": _REPLAY | {"noise": 0.2} | _FEW,  # standard deviation, independent in each step
    "tqc": _REPLAY | {"ent_coef": "auto_0.01"} | _FEW,
    "estimator": {
        "robots": 128,
        "horizon": 5,  # control periods over which the label of the disturbance is averaged
        "kept": 12,  # rounds that are fitted
        # More, when there are few rounds yet, would fit what the corrected law no longer meets.
        "epochs": 8,
        "batch": 32,  # robots
        "memory_period": 5,  # control periods from one observation that the memory takes in on
        "window": 100,  # of these observations, through which gradients go
        "learning_rate": 2e-3,  # at the start; falls linearly to a tenth over the training
        "weight_decay": 0.1,
        "units": 64,  # LSTM units
        "reach": 50,  # of these observations, for which units remember at first at most
        "hidden": 64,
    },
}
