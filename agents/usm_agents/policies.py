"""Policies as a user names them: those of `usm_baselines`, and agents by their folders."""

from __future__ import annotations

from pathlib import Path

from usm_baselines.contender import Contender, contender

from usm_agents.artifact.folder import agent_contender


def named(name: str) -> Contender:
    """The policy of a name as `--policies` takes it; the folder of an agent is one, too.

    Raises:
        ValueError: If there is none.
        OSError: If a file cannot be read.
    """
    return agent_contender(name) if Path(name).is_dir() else contender(name)
