"""The environments' entries in Gymnasium's registry."""

from __future__ import annotations

import gymnasium as gym

from usm_gym.task.scenario import MODES


def register_environments() -> None:
    """Register `USM-Operation-v0` and `USM-Torpedo-v0`; they truncate episodes themselves."""
    for mode in MODES:
        gym.register(
            id=f"USM-{mode.capitalize()}-v0",
            entry_point="usm_gym.envs.usm:USMEnv",
            vector_entry_point="usm_gym.envs.usm:USMVectorEnv",
            kwargs={"mode": mode},
        )
