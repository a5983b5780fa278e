"""The trainings of a study, and the agents that are shipped of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter
from usm_baselines.registry import ids

from usm_agents.artifact.folder import read_agent, write_agent
from usm_agents.learning.checkpoint import CURVE, traces
from usm_agents.learning.plan import Plan, read_plan
from usm_agents.learning.training import train
from usm_agents.study.plans import AGENTS, PLANS, SEEDS
from usm_agents.study.results import CurvePoint
from usm_gym.support import parallel
from usm_gym.support.files import read_json
from usm_gym.support.validation import UsageError, explaining, require

# Where shipped agents are in a checkout, in which they are registered by their names.
SHIPPED = "agents/usm_agents/artifact/pretrained"


@dataclasses.dataclass(frozen=True)
class StudyTraining:
    """A training of the study.

    Attributes:
        name: Name of the agent or ablation.
        plan: What is trained.
        folder: Where.
    """

    name: str
    plan: Plan
    folder: Path

    @property
    def begun(self) -> bool:
        """Whether the folder holds this training, or its beginning; no checkpoint is opened.

        Raises:
            ValueError: If it holds a training of another plan, or one without a plan.
        """
        if not traces(self.folder):
            return False
        name = self.folder.name
        had, has = read_plan(self.folder).command(name), self.plan.command(name)
        require(had == has, f"the training in {self.folder}", had, has)
        return True

    @property
    def done(self) -> bool:
        """Whether the training has come to its end.

        Raises:
            ValueError: If the folder holds another one; see `begun`.
        """
        if not (self.begun and (self.folder / CURVE).exists()):
            return False
        return self.curve[-1].steps >= self.plan.steps

    @property
    def curve(self) -> tuple[CurvePoint, ...]:
        """The learning curve, as far as it goes.

        Raises:
            ValueError: If the file holds none.
        """
        path = self.folder / CURVE
        with explaining(f"{path} is not a learning curve"):
            return _CURVE.validate_python(read_json(path))


_CURVE = TypeAdapter(Annotated[tuple[CurvePoint, ...], Field(min_length=1)])


def planned(
    names: Sequence[str], seeds: int, folder: Path, steps: int | None = None
) -> list[StudyTraining]:
    """The trainings of the study, seed by seed, so that an early stop leaves some of all.

    Args:
        names: Names of agents and ablations.
        seeds: How many seeds, from 0 on, and per name no more than in `SEEDS`.
        folder: Folder of the study.
        steps: How many steps a training takes; without it, as its plan says.

    Raises:
        ValueError: If a name is unknown, or the base of an agent is another one that is not
            shipped yet.
    """
    listed = []
    for name in names:
        require(name in PLANS, "--only", name, ", ".join(PLANS))
        require_base(name)
    for seed in range(seeds):
        for name in names:
            if seed >= SEEDS[name]:
                continue
            plan = dataclasses.replace(PLANS[name], seed=seed, steps=steps or PLANS[name].steps)
            listed.append(StudyTraining(name, plan, folder / "runs" / f"{name}-{seed}"))
    return listed


def has_base(name: str) -> bool:
    """Whether the base of an agent is there: one that is an agent of the study has to be shipped.

    A base is a registered policy, so that what is trained on it is what users get.
    """
    base = PLANS[name].base
    return base not in AGENTS or base in ids()


def require_base(name: str) -> None:
    """Refuse an agent whose base is not there."""
    if not has_base(name):
        base = PLANS[name].base
        raise UsageError(
            f"the base of {name} is {base}, which is not shipped: first "
            f"usm study residual --only {base} --ship {SHIPPED}"
        )


def train_all(
    chosen: Sequence[StudyTraining], workers: int, report: Callable[[StudyTraining], object]
) -> None:
    """Train what is not trained yet; an interrupted training resumes.

    Only a training of the very same plan resumes: its checkpoint is code, which is run.

    Raises:
        ValueError: If a folder holds another training; then none has begun.
    """
    waiting = []
    for training in chosen:
        if training.done:
            report(training)
        else:
            waiting.append(training)
    for index, _ in parallel.results(train_one, [(training,) for training in waiting], workers):
        report(waiting[index])


def train_one(training: StudyTraining) -> None:
    """Carry out one training."""
    train(training.plan, training.folder, lambda steps, line: None, resume=training.begun)


def require_alike(chosen: Sequence[StudyTraining]) -> None:
    """Refuse trainings of one name that differ in more than their seed.

    Raises:
        ValueError: If the settings, the base's gains or the base's weights are not the same.
    """
    known: dict[str, dict[str, object]] = {}
    for training in chosen:
        agent, _ = read_agent(training.folder)
        trained = {
            "settings": agent.training["settings"],
            "gains": agent.gains,
            "base_weights": agent.base_weights,
        }
        first = known.setdefault(training.name, trained)
        require(trained == first, f"what {training.folder} was trained with", trained, f"{first}")


def ship(chosen: Sequence[StudyTraining], folder: Path, command: str) -> None:
    """Put every agent, as its seed 0, under its own name into a folder.

    Args:
        chosen: The trainings.
        folder: Where; every agent has a folder of its own there.
        command: The command of the study.
    """
    for training in chosen:
        if training.name not in AGENTS or training.plan.seed != 0:
            continue
        agent, network = read_agent(training.folder)
        given = ("activation", "output", "weights")
        description = {
            field.name: getattr(agent, field.name)
            for field in dataclasses.fields(agent)
            if field.name not in given
        }
        trained = agent.training["provenance"]
        description["training"] = {
            **agent.training,
            "command": training.plan.command(training.name),
            "provenance": {**trained, "command": command},
        }
        tested = {**agent.scores["sampled"], "command": training.plan.test_command(training.name)}
        description["scores"] = {**agent.scores, "sampled": tested}
        write_agent(folder / training.name, description, network)
