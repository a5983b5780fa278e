"""What trains an agent: the protocol of learners, and the registry of those that plans may name.

A learner is made from a `TrainingSetup`, learns, and exports a network. `train` does the rest: it
validates, keeps the best agent, writes checkpoints, and stops a training that diverges. A learner
of your own is registered under a name, by which a plan asks for it:

    register("mine", MyLearner, {"robots": 64, "ridge": 1e-3})
    train(Plan(algorithm="mine"), Path("mine"), report)

A plan that asks for `my_module:mine` has `my_module` imported, which registers `mine`, before the
training begins. So such a plan works in a process that knows nothing of the learner yet.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from usm_baselines.contender import imported

from usm_agents.artifact.network import Network
from usm_agents.learning.settings import SETTINGS
from usm_agents.residual.env import ResidualVectorEnv
from usm_gym.support.validation import is_whole, require
from usm_gym.task.modes import AnyScenario

Truth = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class TrainingSetup:
    """What a learner is made from.

    The first episodes are begun by the learner, by `envs.reset(seed=setup.episode_seed,
    options={"scenario": setup.first_episodes})`. Those that follow begin within the step that ends
    one (`autoreset_mode="SameStep"`).

    Attributes:
        algorithm: The name by which the plan asks for the learner.
        settings: The settings that the name was registered with.
        seed: Seed of everything that the learner draws.
        envs: The robots, on the residual task. The agent will see nothing but what it observes.
        episode_seed: Seed of the scenarios that follow the first ones.
        first_episodes: One per robot, of all lengths, so that the robots are at different
            times of their episodes from then on.
        draw: Draws a scenario of the training distribution from a stream.
        truth: Gives what no policy can observe, by name, for the robots as `envs` last returned
            them, in SI units, (robots, numbers). On the tasks of this package: "error",
            "velocity", and what `World.truth` gives.
        folder: The folder of the training, for logs that TensorBoard reads.
    """

    algorithm: str
    settings: Mapping[str, Any]
    seed: int
    envs: ResidualVectorEnv
    episode_seed: int
    first_episodes: Sequence[AnyScenario]
    draw: Callable[[np.random.Generator], AnyScenario]
    truth: Callable[[], Truth]
    folder: Path


class Learner(Protocol):
    """What learns to act on the residual task, made by `factory(setup)`."""

    @property
    def steps(self) -> int:
        """Control periods learned from so far, over all robots."""

    def learn(self, steps: int, pause: Callable[[], None]) -> None:
        """Learn until `steps` control periods are done, or a little more.

        Args:
            steps: How many in all, those before a checkpoint included.
            pause: To call before every rollout, or other iteration: then the learner may be asked
                to export, log and save.

        Raises:
            DivergedError: If what it learns grows out of all bounds.
        """

    def export(self) -> Network:
        """Copy what has been learned so far: the agent without the learner."""

    def log(self, numbers: Mapping[str, float]) -> None:
        """Write numbers, by name, to a log of the learner's own, if it keeps one."""

    def save(self, checkpoint: Path) -> None:
        """Write everything that `restore` needs into a folder, `envs.snapshot()` included."""

    def restore(self, checkpoint: Path) -> None:
        """Go back to what `save` wrote; learning continues as if it had not been interrupted."""


Factory = Callable[[TrainingSetup], Learner]


@dataclass(frozen=True)
class Algorithm:
    """A registered way to train.

    Attributes:
        factory: Makes the learner; or "module:name" of what does, which is imported when needed.
        settings: Its settings, "robots" among them; agent.json records them.
    """

    factory: Factory | str
    settings: Mapping[str, Any]


_algorithms: dict[str, Algorithm] = {}


def register(name: str, factory: Factory | str, settings: Mapping[str, Any]) -> None:
    """Register a learner under a name, which plans may then ask for.

    Args:
        name: The name.
        factory: Makes the learner from a `TrainingSetup`; or "module:name" of what does.
        settings: Its settings, as JSON can hold them. "robots" says how many it learns from.

    Raises:
        ValueError: If the name is taken, or the number of robots is missing.
    """
    require(name not in _algorithms, "name", name, "a name that is not taken")
    robots = settings.get("robots")
    require(is_whole(robots, 1), "settings['robots']", robots, "1 or more")
    _algorithms[name] = Algorithm(factory, settings)


def algorithms() -> list[str]:
    """Names of all registered learners, in the order of registration."""
    return list(_algorithms)


def settings_of(algorithm: str) -> Mapping[str, Any]:
    """The settings that a name was registered with; as in a plan, it may begin with a module.

    Raises:
        ValueError: If there is no learner of that name, or the module cannot be imported.
    """
    return _algorithm(algorithm).settings


def make_learner(setup: TrainingSetup) -> Learner:
    """Make the learner that a setup names."""
    factory = _algorithm(setup.algorithm).factory
    make: Factory = resolve_name(factory) if isinstance(factory, str) else factory
    return make(setup)


def _algorithm(name: str) -> Algorithm:
    module, colon, registered = name.rpartition(":")
    known = algorithms()
    if colon:
        imported(module, f"algorithm {name}")
        known = [own for own in algorithms() if own not in SETTINGS]
    allowed = ", ".join(known) or f"a name that {module} registers"
    require(registered in known, "algorithm", name, allowed)
    return _algorithms[registered]


for _name, _settings in SETTINGS.items():
    _learner = (
        "supervised.learner:EstimatorLearner" if _name == "estimator" else "sb3.learner:SB3Learner"
    )
    register(_name, f"usm_agents.learning.{_learner}", _settings)
