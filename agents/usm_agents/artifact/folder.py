"""Files of trained agents: a folder with `agent.json` and `policy.safetensors`.

Neither can hold code, so that loading an agent from anywhere runs nothing of it.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict, TypeAdapter
from safetensors import SafetensorError
from safetensors.numpy import load, save
from usm_baselines.contender import Contender, fingerprint
from usm_baselines.families import Family
from usm_baselines.gains import Gain
from usm_baselines.registry import POSITION_ONLY, entry, make, register
from usm_baselines.tiers import TIERS, tier_of

from usm_agents.artifact.network import Activation, Network, Output, Recurrence
from usm_agents.residual.action import ActionKind, Frames, ResidualScale
from usm_agents.residual.task import Residual, ResidualPolicy
from usm_gym.manipulator import Manipulator, bare
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.support.files import read_bytes, read_json, sync_folder, write_bytes, write_json
from usm_gym.support.validation import (
    Count,
    UsageError,
    explaining,
    in_one_line,
    require,
    validated,
)
from usm_gym.task.conditions import conditions_of
from usm_gym.task.modes import AnyMode, in_space, of_head
from usm_gym.task.nominal import Nominal

DESCRIPTION, WEIGHTS = "agent.json", "policy.safetensors"
NEW_WEIGHTS = "policy.new.safetensors"  # for the moment between writing them and moving them
RECURRENCE = "recurrence_"  # begins the names of its arrays
LARGEST_WEIGHTS = 256 * 2**20  # bytes
PRETRAINED = Path(__file__).with_name("pretrained")
# What agents are told besides what their base is, by their estimator and their observation.
TOLD = ("lag", "noise", "delays", "nominal plant", "joint references")


@validated
class Agent:
    """What `agent.json` says.

    Attributes:
        summary: What it is, in a line.
        mode: The mode, in the plane or in space.
        conditions: Under which it was trained.
        base: Id of the base policy.
        gains: All gains of the base, by name, -1e12 to 1e12.
        residual_scale: Largest residual, 1e-6 to 1000 N and N m.
        action: What the action is.
        omit: Entries of the observation that it is not shown.
        frames: How many observations it sees at once, 1 to 100.
        layout: Fingerprint of the observation's layout.
        activation: Of the hidden layers.
        output: Of the last layer.
        weights: SHA-256 of the file of weights.
        algorithm: By which it was trained.
        seed: Seed of the training, 0 to 4294967295.
        steps: After how many steps, 0 to 1e12.
        training: Settings, versions and the command of the training.
        scores: Scores with their provenance.
        memory_period: That of the recurrence, if there is one, 1 to 1000 control periods.
        base_weights: The `weights` of a base that is an agent itself, else empty.
    """

    summary: str
    mode: AnyMode
    conditions: dict[str, Any]
    base: str
    gains: dict[str, Gain]
    residual_scale: ResidualScale
    action: ActionKind
    omit: tuple[str, ...]
    frames: Frames
    layout: str
    activation: Activation
    output: Output
    weights: str
    algorithm: str
    seed: Annotated[int, Strict(), Field(ge=0, le=2**32 - 1)]
    steps: Annotated[int, Strict(), Field(ge=0, le=10**12)]
    training: dict[str, Any]
    scores: dict[str, Any]
    memory_period: Annotated[Count, Field(le=1000)] = 1
    base_weights: str = ""


_ADAPTER = TypeAdapter(Agent)


def write_agent(folder: Path, description: Mapping[str, Any], network: Network) -> None:
    """Write an agent; `description` has the fields of `Agent`, less those of the network.

    A reader sees the old agent or the new one, also in between or after a kill: the description
    decides which, by the hash of its weights.
    """
    arrays: dict[str, NDArray[np.float32]] = {}
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        arrays[f"weight_{k}"], arrays[f"bias_{k}"] = weight, bias
    if network.recurrence is not None:
        memory = network.recurrence._asdict()
        description = {**description, "memory_period": memory.pop("period")}
        arrays |= {RECURRENCE + name: array for name, array in memory.items()}
    data = save(arrays)
    agent = Agent(
        **description,
        activation=network.activation,
        output=network.output,
        weights=hashlib.sha256(data).hexdigest(),
    )
    folder.mkdir(parents=True, exist_ok=True)
    write_bytes(folder / NEW_WEIGHTS, data)
    write_json(folder / DESCRIPTION, _ADAPTER.dump_python(agent, mode="json"))
    os.replace(folder / NEW_WEIGHTS, folder / WEIGHTS)
    sync_folder(folder)


def read_agent(folder: Path) -> tuple[Agent, Network]:
    """Read an agent; nothing of it is run.

    Raises:
        ValueError: If the folder holds no agent, or one that was changed or cut short.
        OSError: If it cannot be read.
    """
    agent = _description(folder)
    while (data := _weights(folder, agent.weights)) is None:
        before, agent = agent, _description(folder)
        if agent == before:  # it was not written anew while it was read
            found = hashlib.sha256(_read_weights(folder / WEIGHTS)).hexdigest()
            require(False, f"SHA-256 of {folder / WEIGHTS}", found, agent.weights)
    try:
        return agent, _network(agent, load(data))
    except KeyError as error:  # a type of numbers, or the name of an array
        raise UsageError(
            f"{folder / WEIGHTS} is no network: {error}; allowed: weights and biases, float32"
        ) from error
    except (SafetensorError, TypeError, ValueError) as error:
        raise UsageError(f"{folder / WEIGHTS} is no network: {in_one_line(error)}") from error


def _description(folder: Path) -> Agent:
    with explaining(f"{folder / DESCRIPTION} is no agent"):
        return _ADAPTER.validate_python(read_json(folder / DESCRIPTION, links=False))


def _weights(folder: Path, expected: str) -> bytes | None:
    """The weights that are meant, wherever `write_agent` has them at the moment."""
    for name in (WEIGHTS, NEW_WEIGHTS, WEIGHTS):
        with suppress(FileNotFoundError):
            data = _read_weights(folder / name)
            if hashlib.sha256(data).hexdigest() == expected:
                return data
    return None


def _read_weights(file: Path) -> bytes:
    return read_bytes(file, LARGEST_WEIGHTS, links=False)


def _network(agent: Agent, arrays: dict[str, NDArray[np.float32]]) -> Network:
    recurrence = {
        name.removeprefix(RECURRENCE): array
        for name, array in arrays.items()
        if name.startswith(RECURRENCE)
    }
    layers = range((len(arrays) - len(recurrence)) // 2)
    return Network(
        tuple(arrays[f"weight_{k}"] for k in layers),
        tuple(arrays[f"bias_{k}"] for k in layers),
        agent.activation,
        agent.output,
        Recurrence(**recurrence, period=agent.memory_period) if recurrence else None,
    )


def make_agent(nominal: Nominal, folder: str) -> ResidualPolicy:
    """Make the policy of an agent's folder.

    Raises:
        ValueError: If it cannot be read, or its observation is no longer laid out as in training,
            or its base is an agent that has been trained anew since.
        OSError: If it cannot be read.
    """
    agent, network = read_agent(Path(folder))
    kind = "a robot in space" if in_space(agent.mode) else "the planar robot"
    kind += " whose joints the policy moves" if of_head(agent.mode) else ""
    spatial = isinstance(bare(nominal.robot), SpatialRobot)
    steered = isinstance(nominal.robot, Manipulator)
    same = (in_space(agent.mode), of_head(agent.mode)) == (spatial, steered)
    require(same, "robot", nominal.robot, f"{kind}, with which {folder} was trained")
    weights = weights_of(agent.base)
    require(agent.base_weights == weights, f"base_weights of {folder}", agent.base_weights, weights)
    base = make(agent.base, nominal, **agent.gains)
    residual = Residual(
        nominal,
        base,
        agent.residual_scale,
        agent.action,
        agent.omit,
        agent.frames,
        # What the numbers of its network mean does not change with the place.
        conditions_of(agent.conditions).position_noise,
    )
    require(
        agent.layout == residual.layout.fingerprint,
        f"observation layout of {folder}",
        agent.layout,
        f"{residual.layout.fingerprint}, that of this version",
    )
    sizes = (network.inputs, network.outputs)
    fitting = (residual.layout.size, residual.actions)
    require(sizes == fitting, f"inputs and outputs of {folder}", sizes, str(fitting))
    return ResidualPolicy(residual, network)


def weights_of(id: str) -> str:
    """The SHA-256 of the weights of a shipped agent; empty for the id of another policy."""
    folder = PRETRAINED / id
    return _description(folder).weights if folder.is_dir() else ""


def told_with(base: str) -> str:
    """What an agent on a base policy is told besides the measured position and the reference.

    What an agent was trained without, by its `omit`, is not left out here.
    """
    known = entry(base).told.split(", ")
    return ", ".join(dict.fromkeys([*TOLD, *(each for each in known if each != POSITION_ONLY)]))


def made_for(conditions: dict[str, Any], mode: AnyMode) -> str:
    """The tier that conditions of a training in a mode are, as `Contender.tuned_for` has it."""
    tier = tier_of(conditions_of(conditions), mode)
    return tier if tier in TIERS or of_head(mode) else ""


def agent_contender(folder: str) -> Contender:
    """The agent of a folder as a contender.

    Raises:
        ValueError: If the folder holds no agent.
        OSError: If it cannot be read.
    """
    agent, _ = read_agent(Path(folder))
    sources = fingerprint("usm_gym", "usm_baselines", "usm_agents")
    description = (Path(folder) / DESCRIPTION).read_text(encoding="utf-8")
    identity = json.dumps([agent.weights, description, sources])
    factory, told = partial(make_agent, folder=folder), told_with(agent.base)
    return Contender(
        folder,
        factory,
        told=told,
        identity=identity,
        tuned_for=made_for(agent.conditions, agent.mode),
    )


def register_shipped() -> None:
    """Register the shipped agents under the names of their folders."""
    for description in sorted(PRETRAINED.glob(f"*/{DESCRIPTION}")):
        folder = description.parent
        agent = json.loads(description.read_text(encoding="utf-8"))
        factory = partial(make_agent, folder=str(folder))
        told = told_with(agent["base"])
        tuned_for = made_for(agent["conditions"], agent["mode"])
        register(
            folder.name,
            factory,
            agent["summary"],
            told=told,
            tuned_for=tuned_for,
            family=Family.LEARNED,
            moves_joints=of_head(agent["mode"]),
        )
