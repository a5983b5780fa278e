"""Learned residual thrust on top of the scripted policies, and the commands of `usm`.

Importing this package registers the residual tasks and the shipped agents; it does not import
torch.
"""

import gymnasium as gym

from agents.artifact import register_shipped
from agents.residual import ResidualPolicy
from usm_gym.scenario import MODES

__all__ = ["ResidualPolicy"]

for _mode in MODES:
    gym.register(
        id=f"USM-{_mode.capitalize()}Residual-v0",
        entry_point="agents.residual_env:make_residual_env",
        vector_entry_point="agents.residual_env:make_residual_vector_env",
        kwargs={"mode": _mode},
    )

register_shipped()
