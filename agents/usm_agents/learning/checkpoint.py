"""Checkpoints of a training: its whole state, and all that its folder shows of it.

A checkpoint appears in one move. Agent and learning curve are part of it and are written from it,
never the other way round: a training that was killed in between writes them again when it goes on.

A checkpoint consists of Stable-Baselines3's files and pickles, and a pickle is code: whoever reads
one runs what its author wanted. What is passed on is the agent (`usm_agents.artifact.folder`).
"""

from __future__ import annotations

import pickle
import random
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from usm_agents.artifact.folder import DESCRIPTION, write_agent
from usm_agents.artifact.network import Network
from usm_agents.learning.plan import PLAN
from usm_gym.support.files import move_folder, naming, remove_folder, write_json
from usm_gym.support.validation import UsageError, in_one_line

CURVE, STATE, MODEL, REPLAY = "curve.json", "state", "model.zip", "replay"
PART = "checkpoint.part"
# Patterns of the names of all that a training leaves in its folder.
TRACES = (PLAN, "checkpoint*", CURVE, DESCRIPTION, "policy*.safetensors", "events.out.tfevents*")

Point = dict[str, Any]


@dataclass(frozen=True)
class State:
    """A training between two rollouts, but for its model and for what draws random numbers.

    Attributes:
        envs: The robots in the middle of their episodes, as `SB3VecEnv.snapshot` gives them.
        curve: What each validation found.
        best: The best validation and the network that was validated.
        description: Of the agent with that network, as `write_agent` takes it.
    """

    envs: tuple[Any, ...]
    curve: list[Point]
    best: tuple[Point, Network]
    description: dict[str, Any]


def traces(folder: Path) -> list[str]:
    """Names of what a training has left in a folder; nothing of it is opened."""
    return sorted({file.name for pattern in TRACES for file in folder.glob(pattern)})


def checkpoints(folder: Path) -> list[Path]:
    """Complete checkpoints, the latest last."""
    found = {file.name.partition("-")[2]: file for file in folder.glob("checkpoint-*")}
    return [found[steps] for steps in sorted(filter(str.isdecimal, found), key=int)]


def latest_checkpoint(folder: Path) -> Path | None:
    """The last complete checkpoint, if there is one."""
    found = checkpoints(folder)
    return found[-1] if found else None


def write_checkpoint(folder: Path, model: BaseAlgorithm, state: State) -> None:
    """Write the checkpoint of a training into its folder."""
    part = folder / PART
    remove_folder(part)
    part.mkdir()
    memory = getattr(model, "_last_lstm_states", None)
    chance = random.getstate(), np.random.get_state(), torch.get_rng_state()  # noqa: NPY002
    with naming(part):
        model.save(part / MODEL)
        if hasattr(model, "save_replay_buffer"):
            with open(part / REPLAY, "wb") as file:
                model.save_replay_buffer(file)
        (part / STATE).write_bytes(pickle.dumps((state, memory, chance)))
    move_folder(part, folder / f"checkpoint-{model.num_timesteps:010d}")


def read_checkpoint(
    checkpoint: Path, kind: type[BaseAlgorithm], face: VecEnv
) -> tuple[BaseAlgorithm, State]:
    """Read a checkpoint, which is code and is run; randomness goes on from where it was.

    Raises:
        ValueError: If it is damaged, or of another version.
    """
    try:
        model = kind.load(checkpoint / MODEL, env=face, device="cpu", force_reset=False)
        if (checkpoint / REPLAY).exists():
            model.load_replay_buffer(checkpoint / REPLAY, truncate_last_traj=False)  # type: ignore[attr-defined]
        state, memory, chance = pickle.loads((checkpoint / STATE).read_bytes())
        assert vars(state).keys() == {field.name for field in fields(State)}
    except Exception as error:  # whatever becomes of the pickles of another version
        reason = f"{type(error).__name__}: {in_one_line(error)}"
        raise UsageError(f"{checkpoint} is damaged, or of another version ({reason})") from error
    if memory is not None:
        model._last_lstm_states = memory  # type: ignore[attr-defined]
    python, numpy, torchs = chance
    random.setstate(python)
    np.random.set_state(numpy)  # noqa: NPY002 (where SB3 draws from)
    torch.set_rng_state(torchs)
    return model, state


def show(folder: Path, state: State) -> None:
    """Let the folder show what a checkpoint says, and rid it of earlier ones.

    The curve comes last: once it has a point, everything else that belongs to it is there.
    """
    write_agent(folder, state.description, state.best[1])
    remove_folder(folder / PART)
    for earlier in checkpoints(folder)[:-1]:
        remove_folder(earlier)
    write_json(folder / CURVE, state.curve)
