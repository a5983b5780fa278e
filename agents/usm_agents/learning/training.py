"""Training of an agent on the residual task, from top to bottom.

A training that is interrupted, at any instruction, resumes from its last checkpoint as if
nothing had happened, bit for bit, and ends with the same files (`usm_agents.learning.checkpoint`).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym

from usm_agents.artifact.network import Network
from usm_agents.learning.checkpoint import (
    Progress,
    latest_checkpoint,
    read_checkpoint,
    traces,
    write_checkpoint,
    write_results,
)
from usm_agents.learning.description import describe
from usm_agents.learning.divergence import DivergedError, check_curve
from usm_agents.learning.learner import TrainingSetup, make_learner, settings_of
from usm_agents.learning.plan import TEST_EPISODES, Plan, write_plan
from usm_agents.learning.validation import (
    VALIDATION_EPISODES,
    Validation,
    best_of,
    held_out,
    in_words,
    metrics_of,
    score_unseen,
    validate,
)
from usm_agents.residual.env import ResidualVectorEnv
from usm_gym.envs.vector_env import TrackingVectorEnv
from usm_gym.support.files import holding
from usm_gym.support.seeding import TRAINING, stream
from usm_gym.support.validation import require

Report = Callable[[int, str], None]


def train(
    plan: Plan,
    folder: Path,
    report: Report,
    resume: bool = False,
    *,
    validation_episodes: int = VALIDATION_EPISODES,
    test_episodes: int = TEST_EPISODES,
) -> list[Validation]:
    """Train an agent, or go on training it, and leave the best one in the folder.

    Args:
        plan: What to train.
        folder: Where plan, learning curve, checkpoints and agent are kept.
        report: Called now and then with the steps done and a line on the last validation.
        resume: Whether to continue the training in the folder. Its checkpoint is code, which is
            run; without this, nothing in the folder is opened.
        validation_episodes: On how many held-out scenarios the agent is validated.
        test_episodes: On how many others the best agent is scored in the end.

    Returns:
        The learning curve: the validations, as `usm_agents.learning.validation` describes them.

    Raises:
        ValueError: If there is no such algorithm, if the folder holds files of a training but
            `resume` is not set, or if its checkpoint cannot be read.
        DivergedError: If the training diverges; its checkpoints are kept.
        BlockingIOError: If another process trains there.
    """
    settings_of(plan.algorithm)  # refuses one that does not exist before anything is written
    folder.mkdir(parents=True, exist_ok=True)
    with holding(folder):
        left = [] if resume else traces(folder)
        name = f"the content of {folder}"
        require(not left, name, ", ".join(left), "nothing of a training, or --resume")
        training = Training(plan, folder, report, validation_episodes, test_episodes)
        write_plan(plan, folder)  # now that nothing of it is refused
        training.run()
        return training.curve


def prepare(plan: Plan, folder: Path) -> TrainingSetup:
    """Make the robots, and choose the first episodes."""
    settings = settings_of(plan.algorithm)
    envs = gym.make_vec(
        plan.env,
        num_envs=settings["robots"],
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
        conditions=plan.conditions,
        base=plan.base,
        **plan.task,
    )
    assert isinstance(envs, ResidualVectorEnv)
    assert isinstance(envs.unwrapped, TrackingVectorEnv)
    random = stream(plan.seed, TRAINING)
    episode_seed = int(random.integers(2**31))
    # First episodes of all lengths, so that afterwards the robots are at all times of an episode.
    drawn = [plan.scenario(random) for _ in range(envs.num_envs)]
    lengths = [float(random.integers(1, int(scenario.duration) + 1)) for scenario in drawn]
    first_episodes = [
        dataclasses.replace(scenario, duration=length)
        for scenario, length in zip(drawn, lengths, strict=True)
    ]
    return TrainingSetup(
        algorithm=plan.algorithm,
        settings=settings,
        seed=plan.seed,
        envs=envs,
        episode_seed=episode_seed,
        first_episodes=first_episodes,
        draw=plan.scenario,
        truth=envs.unwrapped.truth,
        folder=folder,
    )


class Training:
    """Drives a learner, whatever it is, to the end of its plan.

    Attributes:
        curve: The validations so far.
    """

    def __init__(
        self, plan: Plan, folder: Path, report: Report, validation_episodes: int, test_episodes: int
    ) -> None:
        """Make the learner, and go back to the last checkpoint, if there is one."""
        self._plan, self._folder, self._report = plan, folder, report
        self._test_episodes = test_episodes
        self._setup = prepare(plan, folder)
        self._residual = self._setup.envs.residual
        self._scenarios = held_out(plan, self._residual, validation_episodes)
        self._learner = make_learner(self._setup)
        self._best: Network | None = None
        self.curve: list[Validation] = []
        self._line, self._due, seconds = "", 0, 0.0
        checkpoint = latest_checkpoint(folder)
        if checkpoint is not None:
            progress = read_checkpoint(checkpoint, self._learner)
            write_results(folder, progress)  # it may have been killed before it had done so
            self.curve, self._best = progress.curve, progress.best
            self._line = in_words(self.curve[-1])
            self._due = self._learner.steps + plan.interval
            seconds = self.curve[-1]["seconds"]
        self._began = time.monotonic() - seconds

    def run(self) -> None:
        """Learn to the end, and score the best agent on scenarios that are new to it.

        Raises:
            DivergedError: If the training diverges.
        """
        learner, plan = self._learner, self._plan
        if learner.steps >= plan.steps:
            return
        try:
            learner.learn(plan.steps, self._pause)
            self._validate()
        except DivergedError as error:
            kept = latest_checkpoint(self._folder)
            where = f"the last checkpoint is {kept}" if kept else "there is no checkpoint"
            raise DivergedError(
                f"the training has diverged after {learner.steps} steps: {error}; {where}"
            ) from error
        assert self._best is not None
        name = self._folder.name
        scores = score_unseen(plan, self._residual, self._best, self._test_episodes, name)
        self._keep({"sampled": scores})

    def _pause(self) -> None:
        """Validate and write a checkpoint, if it is time."""
        steps = self._learner.steps
        self._report(steps, self._line)
        if steps >= self._due:
            self._due = steps + self._plan.interval
            self._validate()
            self._keep({})

    def _validate(self) -> None:
        steps, network = self._learner.steps, self._learner.export()
        seconds = time.monotonic() - self._began
        validation = validate(self._residual, network, self._scenarios, steps, seconds)
        self.curve.append(validation)
        if best_of(self.curve) is validation:
            self._best = network
        metrics = metrics_of(validation)
        self._learner.log({f"validation/{name}": value for name, value in metrics.items()})
        self._line = in_words(validation)
        self._report(steps, self._line)
        check_curve(self.curve)

    def _keep(self, tested: dict[str, Any]) -> None:
        assert self._best is not None
        description = describe(
            self._plan, self._residual, self._setup.settings, self.curve, tested, self._folder.name
        )
        progress = Progress(self.curve, self._best, description)
        write_checkpoint(self._folder, self._learner, progress)
        write_results(self._folder, progress)
