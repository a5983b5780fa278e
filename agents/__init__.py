"""Learned residual thrust on top of the scripted policies, and the `usm` command.

Importing this package registers the residual tasks and the shipped agents; it does not import
torch.
"""

import sys

if sys.argv[:1] == ["-m"] and sys.orig_argv[-len(sys.argv)] == "agents":
    # `python -m agents` imports this package before its __main__.py, which listens to Ctrl-C.
    from usm_cli.interrupts import listen

    listen()

import gymnasium as gym

from agents.artifact import register_shipped
from usm_gym.scenario import MODES

for _mode in MODES:
    gym.register(
        id=f"USM-{_mode.capitalize()}Residual-v0",
        entry_point="agents.residual_env:make_residual_env",
        vector_entry_point="agents.residual_env:make_residual_vector_env",
        kwargs={"mode": _mode},
    )

register_shipped()
