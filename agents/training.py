"""Training of an agent on the residual task, from top to bottom.

An interrupted training goes on from its last checkpoint as if nothing had happened, to the bit.
Checkpoints are Stable-Baselines3's files and pickles: for one's own machine, not to be passed on.
What is passed on is the agent (`agents.artifact`).
"""

from __future__ import annotations

import dataclasses
import pickle
import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed

from agents.algorithms import (
    CLASSES,
    REWARD_SCALE,
    ROBOTS,
    SETTINGS,
    make_model,
    network_of,
)
from agents.artifact import write_agent
from agents.plan import TEST_EPISODES, TEST_SEED, Plan, write_plan
from agents.residual import ResidualPolicy
from agents.residual_env import ResidualVectorEnv
from agents.sb3_vec_env import SB3VecEnv
from agents.selection import unseen
from baselines.scoring import shared_nominal
from usm_gym.conditions import FIELD
from usm_gym.evaluation import evaluate
from usm_gym.files import write_json
from usm_gym.provenance import provenance
from usm_gym.robot import Robot
from usm_gym.seeding import TRAINING, VALIDATION, stream
from usm_gym.validation import require

CURVE, STATE, MODEL, REPLAY = "curve.json", "state", "model.zip", "replay"
# Held-out scenarios of the training distribution, the same for all trainings.
VALIDATION_EPISODES = 32
# A training has diverged when so many validations in a row are so many times worse than the best.
COLLAPSE_COUNT, COLLAPSE_RATIO = 3, 5.0
# And when a weight is larger than this.
LARGEST_WEIGHT = 1e6

VALIDATED = ("max_error_x", "max_error_y", "thrust_variation")

Report = Callable[[int, str], None]


class DivergedError(ValueError):
    """A training that has diverged."""


def train(plan: Plan, folder: Path, report: Report) -> list[dict[str, Any]]:
    """Train an agent, or go on training it, and leave the best one in the folder.

    Args:
        plan: What to train.
        folder: Where plan, learning curve, checkpoints and agent are kept.
        report: Called now and then with the steps done and a line on the last validation.

    Returns:
        The learning curve: what each validation found.

    Raises:
        DivergedError: If the training diverges; its checkpoints are kept.
    """
    # With one thread, sums are added in the same order on every machine.
    torch.set_num_threads(1)
    write_plan(plan, folder)
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
    model.set_logger(configure(str(folder), ["tensorboard"]))
    remaining = plan.steps - model.num_timesteps
    if remaining > 0:
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
        self._best: Any = None
        self._scores: dict[str, Any] = {}
        self.curve: list[dict[str, Any]] = []

    def _on_rollout_start(self) -> None:
        self.check_weights(self.model)
        self._report(self.num_timesteps, self._line)
        if self.num_timesteps >= self._next:
            self._next = self.num_timesteps + self._plan.interval
            self._validate()
            self._write_checkpoint()

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self.check_weights(self.model)
        self._validate()
        self._test()
        self._write_checkpoint()

    def check_weights(self, model: BaseAlgorithm) -> None:
        """Stop if a weight has grown out of all bounds, or is no longer a number.

        Raises:
            DivergedError: If so.
        """
        if not all((each.abs() < LARGEST_WEIGHT).all() for each in model.policy.parameters()):
            raise self._diverged(model.num_timesteps, f"a weight is beyond {LARGEST_WEIGHT:g}")

    def resume(self, checkpoint: Path) -> BaseAlgorithm:
        """Load the model of a checkpoint and put everything else back as it was."""
        cls = CLASSES[self._plan.algorithm]
        model = cls.load(checkpoint / MODEL, env=self._face, device="cpu", force_reset=False)
        if (checkpoint / REPLAY).exists():
            model.load_replay_buffer(checkpoint / REPLAY, truncate_last_traj=False)  # type: ignore[attr-defined]
        state = pickle.loads((checkpoint / STATE).read_bytes())
        if state["memory"] is not None:
            model._last_lstm_states = state["memory"]  # type: ignore[attr-defined]
        self._face.restore(state["envs"])
        self.curve, self._best = state["curve"], state["best"]
        self._seconds = self.curve[-1]["seconds"]
        self._next = model.num_timesteps + self._plan.interval
        self._line = _line(self.curve[-1])
        random.setstate(state["python"])
        np.random.set_state(state["numpy"])  # noqa: NPY002 (where SB3 draws from)
        torch.set_rng_state(state["torch"])
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

    def _write_checkpoint(self) -> None:
        part = self._folder / "checkpoint.part"
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir()
        self.model.save(part / MODEL)
        if hasattr(self.model, "save_replay_buffer"):
            with open(part / REPLAY, "wb") as file:
                self.model.save_replay_buffer(file)
        state = {
            "envs": self._face.snapshot(),
            "memory": getattr(self.model, "_last_lstm_states", None),
            "curve": self.curve,
            "best": self._best,
            "python": random.getstate(),
            "numpy": np.random.get_state(),  # noqa: NPY002
            "torch": torch.get_rng_state(),
        }
        (part / STATE).write_bytes(pickle.dumps(state))
        done = self._folder / f"checkpoint-{self.num_timesteps:010d}"
        shutil.rmtree(done, ignore_errors=True)
        part.rename(done)
        for other in checkpoints(self._folder)[:-1]:
            shutil.rmtree(other)
        write_json(self._folder / CURVE, self.curve)
        self._write_agent()

    def _write_agent(self) -> None:
        plan, (point, network) = self._plan, self._best
        recorded = plan.record()
        residual = self._envs.residual
        gains = getattr(residual.base, "gains", None)
        description = {
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
        write_agent(self._folder, description, network)


def checkpoints(folder: Path) -> list[Path]:
    """Complete checkpoints, the latest last."""
    return sorted(folder.glob("checkpoint-*"))


def latest_checkpoint(folder: Path) -> Path | None:
    """The last complete checkpoint, if there is one."""
    found = checkpoints(folder)
    return found[-1] if found else None


def _error(point: dict[str, Any]) -> float:
    return float(point["max_error_x"] + point["max_error_y"])


def _line(point: dict[str, Any]) -> str:
    x, y = (1e3 * point[f"max_error_{axis}"] for axis in "xy")
    return f"{x:.2f} / {y:.2f} mm at {point['thrust_variation']:.0f} N/s"
