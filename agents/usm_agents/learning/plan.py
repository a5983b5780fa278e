"""What a training is: the plan of one agent, which its folder and its file keep."""

from __future__ import annotations

import dataclasses
import json
import shlex
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
from pydantic import Field, Strict, TypeAdapter

from usm_agents.learning.learner import algorithms
from usm_agents.residual.action import RESIDUAL_SCALE, ActionKind, Frames, ResidualScale
from usm_gym.support.files import read_bytes, write_json
from usm_gym.support.validation import Count, UsageError, in_one_line, require, validated
from usm_gym.task.conditions import FIELD, IN_SPACE, Conditions, preset_of
from usm_gym.task.modes import AnyMode, AnyScenario, presets_of, sample_of

PLAN = "plan.json"
# The scenarios on which an agent is scored in the end, as `usm evaluate` samples them.
TEST_SEED, TEST_EPISODES = 7, 100
# Fields of a plan, and of an agent's description, that are arguments of the residual task.
TASK = ("residual_scale", "action", "omit", "frames")


# What numpy's global stream, from which Stable-Baselines3 draws, takes.
Seed = Annotated[int, Strict(), Field(ge=0, le=2**32 - 1)]
Steps = Annotated[Count, Field(le=10**12)]


@validated
class Plan:
    """What is trained, and how long.

    Attributes:
        algorithm: "ppo", "smooth-ppo", "recurrent-ppo", "sac", "td3", "tqc" or "estimator", or a
            name that is registered with `usm_agents.learning.learner`, or "module:name" of one that
            the module registers; the module is imported when the training begins.
        env: Id of a residual task.
        base: Base policy: an id, or an id with a file of gains.
        residual_scale: Largest residual, 1e-6 to 1000 N and N m.
        action: What the action is: "force", "wrench", "thrusters", "estimates", "head" or "joints".
        omit: Entries of the observation that the agent is not shown.
        frames: How many observations it sees at once, 1 to 100.
        conditions: Conditions from which scenarios are sampled.
        seed: Seed of everything random, 0 to 4294967295.
        steps: Control periods to train on, over all robots, 1 to 1e12.
        interval: Steps between checkpoints, at which the agent is also validated, 1 to 1e12.
    """

    algorithm: str = "ppo"
    env: str = "usm_agents:USM-OperationResidual-v0"
    base: str = "sta"
    residual_scale: ResidualScale = RESIDUAL_SCALE
    action: ActionKind = "force"
    omit: tuple[str, ...] = ()
    frames: Frames = 1
    conditions: Conditions = FIELD
    seed: Seed = 0
    steps: Steps = 1_000_000
    interval: Steps = 100_000

    def __post_init__(self) -> None:
        """Refuse what cannot be trained."""
        require(
            self.algorithm in algorithms() or all(self.algorithm.rpartition(":")),
            "algorithm",
            self.algorithm,
            f"{', '.join(algorithms())}, or module:name",
        )
        known = [id for id in gym.registry if id.endswith("Residual-v0")]
        require(self.env.removeprefix("usm_agents:") in known, "env", self.env, ", ".join(known))
        fitting = self.algorithm != "estimator" or self.action == "estimates"
        require(fitting, "action", self.action, "estimates, for the algorithm estimator")
        require(":" not in self.base, "base", self.base, "an id, or an id with a file of gains")

    @property
    def mode(self) -> AnyMode:
        """The mode of the task."""
        mode: AnyMode = gym.registry[self.env.removeprefix("usm_agents:")].kwargs["mode"]
        return mode

    @property
    def task(self) -> dict[str, Any]:
        """What the residual task is, but for its base."""
        return {name: getattr(self, name) for name in TASK}

    def record(self) -> dict[str, Any]:
        """The plan as JSON has it."""
        record: dict[str, Any] = _PLAN.dump_python(self, mode="json")
        return record

    def command(self, output: str) -> str:
        """The command that does it."""
        words = ["usm", "train"]
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if value == field.default:
                continue
            if isinstance(value, tuple):
                value = ",".join(value)
            if isinstance(value, Conditions):
                value = self._conditions()
            words += [f"--{field.name.replace('_', '-')}", str(value)]
        return shlex.join([*words, "--output", output])

    def test_command(self, agent: str) -> str:
        """The command that scores the agent as the training does in the end."""
        words = ["usm", "evaluate", "--policies", agent, "--mode", self.mode]
        if self.conditions != presets_of(self.mode)["field"]:
            words += ["--conditions", self._conditions()]
        return shlex.join([*words, "--seed", str(TEST_SEED), "--episodes", str(TEST_EPISODES)])

    def _conditions(self) -> str:
        """The conditions as `--conditions` takes them."""
        if preset := preset_of(self.conditions):
            return preset.removesuffix(IN_SPACE)
        field = presets_of(self.mode)["field"]
        changed, usual = self.record()["conditions"].items(), dataclasses.asdict(field)
        return json.dumps({k: v for k, v in changed if v != _listed(usual[k])})

    def scenario(self, random: np.random.Generator) -> AnyScenario:
        """Draw a scenario of the training distribution."""
        return sample_of(self.mode, self.conditions, random)


_PLAN = TypeAdapter(Plan)


def write_plan(plan: Plan, folder: Path) -> None:
    """Leave the plan in the folder of its training."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / PLAN, plan.record())


def read_plan(folder: Path) -> Plan:
    """The plan of a training that was begun.

    Raises:
        ValueError: If the folder holds none.
    """
    try:
        return _PLAN.validate_json(read_bytes(folder / PLAN))
    except (OSError, ValueError) as error:
        raise UsageError(f"{folder} holds no training: {in_one_line(error)}") from error


def _listed(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
