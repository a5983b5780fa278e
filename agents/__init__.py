"""Learned residual thrust on top of the scripted policies, and the `usm` command.

Importing this package registers the residual tasks; it does not import torch.
"""

import gymnasium as gym

from usm_gym.scenario import MODES

for _mode in MODES:
    gym.register(
        id=f"USM-{_mode.capitalize()}Residual-v0",
        entry_point="agents.residual:make_residual_env",
        kwargs={"mode": _mode},
    )
