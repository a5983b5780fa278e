"""Training of an agent on the residual task, from top to bottom.

A training that is interrupted, at whatever instruction, goes on from its last checkpoint as if
nothing had happened, to the bit, and ends with the same files (`usm_agents.learning.checkpoint`).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed
from usm_baselines.benchmark.scoring import shared_nominal

from usm_agents.learning.algorithms import (
    CLASSES,
    REWARD_SCALE,
    ROBOTS,
    SETTINGS,
    make_model,
    network_of,
)
from usm_agents.learning.checkpoint import (
    Point,
    State,
    latest_checkpoint,
    read_checkpoint,
    show,
    traces,
    write_checkpoint,
)
from usm_agents.learning.plan import TEST_EPISODES, TEST_SEED, Plan, write_plan
from usm_agents.learning.sb3_vec_env import SB3VecEnv
from usm_agents.residual.env import ResidualVectorEnv
from usm_agents.residual.task import ResidualPolicy
from usm_gym.evaluation import evaluate
from usm_gym.robot import Robot
from usm_gym.suites import unseen
from usm_gym.support.files import holding
from usm_gym.support.provenance import provenance
from usm_gym.support.seeding import TRAINING, VALIDATION, stream
from usm_gym.support.validation import UsageError, require
from usm_gym.task.conditions import FIELD

# Held-out scenarios of the training distribution, the same for all trainings.
VALIDATION_EPISODES = 32
# A training has diverged when so many validations in a row are so many times worse than the best.
COLLAPSE_COUNT, COLLAPSE_RATIO = 3, 5.0
# And when a weight is larger than this.
LARGEST_WEIGHT = 1e6

VALIDATED = ("max_error_x", "max_error_y", "thrust_variation")

Report = Callable[[int, str], None]


class DivergedError(UsageError):
    """A training that has diverged."""


def train(plan: Plan, folder: Path, report: Report, resume: bool = False) -> list[Point]:
    """Train an agent, or go on training it, and leave the best one in the folder.

    Args:
        plan: What to train.
        folder: Where plan, learning curve, checkpoints and agent are kept.
        report: Called now and then with the steps done and a line on the last validation.
        resume: Whether to go on with the training in the folder. Its checkpoint is code, which is
            run; without this, nothing in the folder is opened.

    Returns:
        The learning curve: what each validation found.

    Raises:
        ValueError: If the folder holds anything of a training and none is to be resumed, or if its
            checkpoint cannot be read.
        DivergedError: If the training diverges; its checkpoints are kept.
        BlockingIOError: If another process trains there.
    """
    # With one thread, sums are added in the same order on every machine.
    torch.set_num_threads(1)
    folder.mkdir(parents=True, exist_ok=True)
    with holding(folder):
        found = [] if resume else traces(folder)
        name = f"the content of {folder}"
        require(not found, name, ", ".join(found), "nothing of a training, or --resume")
        write_plan(plan, folder)
        return _train(plan, folder, report)


def _train(plan: Plan, folder: Path, report: Report) -> list[Point]:
    envs = gym.make_vec(
        plan.env,
        num_envs=ROBOTS[plan.algorithm],
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
        conditions=plan.conditions,
        base=plan.base,
        **plan.task,
    )
    assert isinstance(envs, ResidualVectorEnv)
    face = SB3VecEnv(envs, REWARD_SCALE)
    keeper = Keeper(plan, folder, envs, face, report)
    checkpoint = latest_checkpoint(folder)
    model = begin(plan, face) if checkpoint is None else keeper.resume(checkpoint)
    remaining = plan.steps - model.num_timesteps
    if remaining > 0:
        model.set_logger(configure(str(folder), ["tensorboard"]))
        try:
            model.learn(remaining, callback=keeper, reset_num_timesteps=checkpoint is None)
        except ValueError:
            keeper.check_weights(model)  # torch refuses distributions that are none
            raise
    return keeper.curve


def begin(plan: Plan, face: SB3VecEnv) -> BaseAlgorithm:
    """Make the model and choose the first episodes."""
    set_random_seed(plan.seed)
    face.action_space.seed(plan.seed)
    model = make_model(plan.algorithm, face)
    random = stream(plan.seed, TRAINING)
    face.seed(int(random.integers(2**31)))
    # First episodes of all lengths, so that afterwards the robots are at all times of an episode.
    first = [plan.scenario(random) for _ in range(face.num_envs)]
    lengths = [float(random.integers(1, int(each.duration) + 1)) for each in first]
    face.set_options(
        [
            {"scenario": dataclasses.replace(each, duration=length)}
            for each, length in zip(first, lengths, strict=True)
        ]
    )
    return model


class Keeper(BaseCallback):
    """Validates, keeps checkpoints and the best agent, and stops a training that diverges.

    Attributes:
        curve: What each validation found.
    """

    def __init__(
        self, plan: Plan, folder: Path, envs: ResidualVectorEnv, face: SB3VecEnv, report: Report
    ) -> None:
        """Prepare for a training that begins."""
        super().__init__()
        self._plan, self._folder, self._envs, self._face = plan, folder, envs, face
        self._report = report
        self._scenarios = [
            plan.scenario(stream(0, VALIDATION, i)) for i in range(VALIDATION_EPISODES)
        ]
        require(
            shared_nominal(Robot(), self._scenarios) == envs.residual.nominal,
            "conditions",
            plan.conditions,
            "one nominal knowledge for all scenarios",
        )
        self._next = 0
        self._line = ""
        self._began, self._seconds = time.monotonic(), 0.0
        self._best: Any = None  # a point of the curve, and the network that was validated there
        self._scores: dict[str, Any] = {}
        self.curve: list[Point] = []

    def _on_rollout_start(self) -> None:
        self.check_weights(self.model)
        self._report(self.num_timesteps, self._line)
        if self.num_timesteps >= self._next:
            self._next = self.num_timesteps + self._plan.interval
            self._validate()
            self._keep()

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self.check_weights(self.model)
        self._validate()
        self._test()
        self._keep()

    def check_weights(self, model: BaseAlgorithm) -> None:
        """Stop if a weight has grown out of all bounds, or is no longer a number.

        Raises:
            DivergedError: If so.
        """
        if not all((each.abs() < LARGEST_WEIGHT).all() for each in model.policy.parameters()):
            raise self._diverged(model.num_timesteps, f"a weight is beyond {LARGEST_WEIGHT:g}")

    def resume(self, checkpoint: Path) -> BaseAlgorithm:
        """Load the model of a checkpoint, which is code, and put everything else back as it was."""
        model, state = read_checkpoint(checkpoint, CLASSES[self._plan.algorithm], self._face)
        show(self._folder, state)  # in case the training was killed before it had done so
        self._face.restore(state.envs)
        self.curve, self._best = state.curve, state.best
        self._seconds = self.curve[-1]["seconds"]
        self._next = model.num_timesteps + self._plan.interval
        self._line = _line(self.curve[-1])
        return model

    def _validate(self) -> None:
        network = network_of(self._plan.algorithm, self.model)
        scores = evaluate(ResidualPolicy(self._envs.residual, network), self._scenarios)
        means = {name: float(scores.per_episode[name].mean()) for name in VALIDATED}
        point = {
            "steps": self.num_timesteps,
            "seconds": self._seconds + time.monotonic() - self._began,
            **means,
            "failures": int(scores.failed.sum()),
        }
        self.curve.append(point)
        for name, value in means.items():
            self.logger.record(f"validation/{name}", value)
        self.logger.dump(self.num_timesteps)
        self._line = _line(point)
        self._report(self.num_timesteps, self._line)
        if self._best is None or _error(point) < _error(self._best[0]):
            self._best = (point, network)
        limit = COLLAPSE_RATIO * _error(self._best[0])
        last = self.curve[-COLLAPSE_COUNT:]
        if len(last) == COLLAPSE_COUNT and all(_error(each) > limit for each in last):
            reason = f"the error is {COLLAPSE_RATIO:g} times the best and more"
            raise self._diverged(self.num_timesteps, reason)

    def _test(self) -> None:
        """Score the best agent on scenarios that chose nothing."""
        plan, (_, network) = self._plan, self._best
        scenarios = unseen(plan.mode, FIELD, TEST_SEED, TEST_EPISODES)
        summary = evaluate(ResidualPolicy(self._envs.residual, network), scenarios).summary()
        del summary["per_episode"]
        command = plan.test_command(self._folder.name)
        self._scores["sampled"] = {"command": command, **summary}

    def _diverged(self, steps: int, reason: str) -> DivergedError:
        kept = latest_checkpoint(self._folder)
        where = f"the last checkpoint is {kept}" if kept else "there is no checkpoint"
        return DivergedError(f"the training has diverged after {steps} steps: {reason}; {where}")

    def _keep(self) -> None:
        state = State(self._face.snapshot(), self.curve, self._best, self._description())
        write_checkpoint(self._folder, self.model, state)
        show(self._folder, state)

    def _description(self) -> dict[str, Any]:
        """What the best agent is, as `write_agent` takes it."""
        plan, (point, _) = self._plan, self._best
        recorded = plan.record()
        residual = self._envs.residual
        gains = getattr(residual.base, "gains", None)
        return {
            "summary": f"{plan.algorithm.upper()} residual on {plan.base}",
            "mode": plan.mode,
            "conditions": recorded["conditions"],
            "base": plan.base.partition("@")[0],
            "gains": gains._asdict() if gains else {},
            **plan.task,
            "layout": residual.layout.fingerprint,
            "algorithm": plan.algorithm,
            "seed": plan.seed,
            "steps": point["steps"],
            "training": {
                "plan": recorded,
                "settings": SETTINGS[plan.algorithm]
                | {"robots": ROBOTS[plan.algorithm], "reward_scale": REWARD_SCALE},
                "curve": self.curve,
                "command": plan.command(self._folder.name),
                "provenance": provenance({"seed": plan.seed}),
            },
            "scores": {"validation": point, **self._scores},
        }


def _error(point: Point) -> float:
    return float(point["max_error_x"] + point["max_error_y"])


def _line(point: Point) -> str:
    x, y = (1e3 * point[f"max_error_{axis}"] for axis in "xy")
    return f"{x:.2f} / {y:.2f} mm at {point['thrust_variation']:.0f} N/s"
