"""Learned residual thrust on top of the scripted policies.

Importing this package registers the residual tasks and the shipped agents; it does not import
torch.
"""

import gymnasium as gym

from usm_agents.artifact.folder import register_shipped
from usm_agents.residual.task import ResidualPolicy
from usm_gym.registration import id_of
from usm_gym.task.modes import ALL_MODES

__all__ = ["ResidualPolicy"]

for _mode in ALL_MODES:
    gym.register(
        id=id_of(_mode, "Residual"),
        entry_point="usm_agents.residual.env:make_residual_env",
        vector_entry_point="usm_agents.residual.env:make_residual_vector_env",
        kwargs={"mode": _mode},
    )

register_shipped()
