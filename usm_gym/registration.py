"""The environments' entries in Gymnasium's registry."""

from __future__ import annotations

import gymnasium as gym

from usm_gym.task.head_scenario import HEAD_MODES, SPATIAL_HEAD_MODES
from usm_gym.task.modes import AnyMode
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

    They are `USM-Operation-v0`, `USM-Torpedo-v0` and `USM-Head-v0`, and in space
    `USM-Operation3D-v0`, `USM-Torpedo3D-v0` and `USM-Head3D-v0`.
    """
    classes: dict[str, tuple[AnyMode, ...]] = {
        "usm:USM": MODES,
        "usm3d:USM3D": SPATIAL_MODES,
        "head:Head": HEAD_MODES,
        "head3d:Head3D": SPATIAL_HEAD_MODES,
    }
    for name, modes in classes.items():
        for mode in modes:
            gym.register(
                id=id_of(mode),
                entry_point=f"usm_gym.envs.{name}Env",
                vector_entry_point=f"usm_gym.envs.{name}VectorEnv",
                kwargs={"mode": mode},
            )
