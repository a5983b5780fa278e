"""Checkpoints of a training: its whole state, and what its folder shows of it.

A checkpoint appears in one move. Agent and learning curve are part of it and are written from it,
never the other way round: a training that was killed in between writes them again when it resumes.

A checkpoint consists of pickles and of the learner's files, and a pickle is code: reading one runs
what its author wanted. What is passed on is the agent (`usm_agents.artifact.folder`).
"""

from __future__ import annotations

import pickle
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from usm_agents.artifact.folder import DESCRIPTION, write_agent
from usm_agents.artifact.network import Network
from usm_agents.learning.learner import Learner
from usm_agents.learning.plan import PLAN
from usm_agents.learning.validation import Validation
from usm_gym.support.files import move_folder, naming, remove_folder, write_json
from usm_gym.support.validation import UsageError, in_one_line

CURVE, PROGRESS = "curve.json", "progress.pickle"
PART = "checkpoint.part"
# Patterns of the names of the files that a training leaves in its folder.
TRACES = (PLAN, "checkpoint*", CURVE, DESCRIPTION, "policy*.safetensors", "events.out.tfevents*")


@dataclass(frozen=True)
class Progress:
    """How far a training has come, but for its learner.

    Attributes:
        curve: The validations so far.
        best: The network that the best of them validated.
        description: Of the agent with that network, as `write_agent` takes it.
    """

    curve: list[Validation]
    best: Network
    description: dict[str, Any]


def traces(folder: Path) -> list[str]:
    """Names of what a training has left in a folder; nothing of it is opened."""
    return sorted({file.name for pattern in TRACES for file in folder.glob(pattern)})


def checkpoints(folder: Path) -> list[Path]:
    """Complete checkpoints, the latest last."""
    by_steps = {file.name.partition("-")[2]: file for file in folder.glob("checkpoint-*")}
    return [by_steps[steps] for steps in sorted(filter(str.isdecimal, by_steps), key=int)]


def latest_checkpoint(folder: Path) -> Path | None:
    """The last complete checkpoint, if there is one."""
    complete = checkpoints(folder)
    return complete[-1] if complete else None


def write_checkpoint(folder: Path, learner: Learner, progress: Progress) -> None:
    """Write the checkpoint of a training into its folder."""
    part = folder / PART
    remove_folder(part)
    part.mkdir()
    with naming(part):
        learner.save(part)
        (part / PROGRESS).write_bytes(pickle.dumps(progress))
    move_folder(part, folder / f"checkpoint-{learner.steps:010d}")


def read_checkpoint(checkpoint: Path, learner: Learner) -> Progress:
    """Read a checkpoint, which is code and is run, and put the learner back to where it was.

    Raises:
        ValueError: If it is damaged, or of another version.
    """
    try:
        learner.restore(checkpoint)
        progress = pickle.loads((checkpoint / PROGRESS).read_bytes())
        assert vars(progress).keys() == {field.name for field in fields(Progress)}
    except Exception as error:  # whatever becomes of the pickles of another version
        reason = f"{type(error).__name__}: {in_one_line(error)}"
        raise UsageError(f"{checkpoint} is damaged, or of another version ({reason})") from error
    known: Progress = progress
    return known


def write_results(folder: Path, progress: Progress) -> None:
    """Write agent and learning curve as a checkpoint has them, and remove earlier checkpoints.

    The curve comes last: once it has a point, everything else that belongs to it is there.
    """
    write_agent(folder, progress.description, progress.best)
    remove_folder(folder / PART)
    for earlier in checkpoints(folder)[:-1]:
        remove_folder(earlier)
    write_json(folder / CURVE, progress.curve)
