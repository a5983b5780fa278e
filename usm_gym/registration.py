"""The environments' entries in Gymnasium's registry."""

from __future__ import annotations

import gymnasium as gym

from usm_gym.task.scenario import MODES
from usm_gym.task.spatial_scenario import SPATIAL_MODES


def id_of(mode: str, kind: str = "") -> str:
    """The id of the environment of a mode, `USM-Operation3D-v0` for "operation3d".

    Args:
        mode: The mode.
        kind: What stands behind the mode, such as "Residual".
    """
    return f"USM-{mode.capitalize().replace('3d', '3D')}{kind}-v0"


def register_environments() -> None:
    """Register the environments, which truncate episodes themselves.

    They are `USM-Operation-v0` and `USM-Torpedo-v0`, and in space `USM-Operation3D-v0` and
    `USM-Torpedo3D-v0`.
    """
    for mode in MODES:
        gym.register(
            id=id_of(mode),
            entry_point="usm_gym.envs.usm:USMEnv",
            vector_entry_point="usm_gym.envs.usm:USMVectorEnv",
            kwargs={"mode": mode},
        )
    for spatial_mode in SPATIAL_MODES:
        gym.register(
            id=id_of(spatial_mode),
            entry_point="usm_gym.envs.usm3d:USM3DEnv",
            vector_entry_point="usm_gym.envs.usm3d:USM3DVectorEnv",
            kwargs={"mode": spatial_mode},
        )
