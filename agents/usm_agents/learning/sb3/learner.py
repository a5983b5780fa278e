"""Algorithms of Stable-Baselines3 as learners."""

from __future__ import annotations

import pickle
import random
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import set_random_seed

from usm_agents.artifact.network import Network
from usm_agents.learning.divergence import check_weights
from usm_agents.learning.learner import TrainingSetup
from usm_agents.learning.sb3.models import CLASSES, REWARD, make_model, network_of
from usm_agents.learning.sb3.vec_env import SB3VecEnv

MODEL, REPLAY, STATES = "model.zip", "replay.pickle", "states.pickle"


class SB3Learner:
    """An algorithm of Stable-Baselines3, on one thread; a `Learner`."""

    def __init__(self, setup: TrainingSetup) -> None:
        """Make the model, whose actions are nearly zero."""
        # With one thread, sums are added in the same order on every machine.
        torch.set_num_threads(1)
        set_random_seed(setup.seed)
        self._setup = setup
        prices = {name: setup.settings[name] for name in REWARD}
        self._vec_env = SB3VecEnv(setup.envs, **prices)
        self._vec_env.action_space.seed(setup.seed)
        self._model = make_model(setup.algorithm, setup.settings, self._vec_env)
        self._started = False
        # Of a checkpoint that was read, until learning goes on.
        self._random_states: Any = None

    @property
    def steps(self) -> int:
        """Control periods learned from so far, over all robots."""
        return self._model.num_timesteps

    def learn(self, steps: int, pause: Callable[[], None]) -> None:
        """Learn until so many control periods are done and the rollout has ended; see `Learner`."""
        first, self._started = not self._started, True
        if first:
            self._vec_env.seed(self._setup.episode_seed)
            self._vec_env.set_options(
                [{"scenario": episode} for episode in self._setup.first_episodes]
            )
        self._model.set_logger(configure(str(self._setup.folder), ["tensorboard"]))

        def before_rollout() -> None:
            # Smooth exploration has been drawn by now: before a checkpoint is written here, and
            # once more after it is read. What follows is drawn from the states of the checkpoint.
            if self._random_states is not None:
                _set_random_states(self._random_states)
                self._random_states = None
            self._check()
            pause()
            if self._model.use_sde:
                self._model.policy.reset_noise(self._vec_env.num_envs)  # type: ignore[operator]

        try:
            self._model.learn(
                steps - self.steps,
                callback=BeforeRollout(before_rollout),
                reset_num_timesteps=first,
            )
        except ValueError:
            self._check()  # torch refuses distributions of what is no number
            raise
        self._check()

    def export(self) -> Network:
        """Copy the part of the model that acts."""
        return network_of(self._setup.algorithm, self._model)

    def log(self, numbers: Mapping[str, float]) -> None:
        """Write numbers to the log for TensorBoard, with those of the algorithm since the last."""
        for name, number in numbers.items():
            self._model.logger.record(name, number)
        self._model.logger.dump(self.steps)

    def save(self, checkpoint: Path) -> None:
        """Write model, replay buffer, robots and random states, as pickles for the most part."""
        self._model.save(checkpoint / MODEL)
        if hasattr(self._model, "save_replay_buffer"):
            with open(checkpoint / REPLAY, "wb") as file:
                self._model.save_replay_buffer(file)
        # What a recurrent policy remembers of the episodes in progress, its model does not save.
        lstm_states = getattr(self._model, "_last_lstm_states", None)
        states = self._vec_env.snapshot(), lstm_states, _random_states()
        (checkpoint / STATES).write_bytes(pickle.dumps(states))

    def restore(self, checkpoint: Path) -> None:
        """Go back to what `save` wrote, which is code and is run."""
        self._model = CLASSES[self._setup.algorithm].load(
            checkpoint / MODEL, env=self._vec_env, device="cpu", force_reset=False
        )
        if (checkpoint / REPLAY).exists():
            self._model.load_replay_buffer(checkpoint / REPLAY, truncate_last_traj=False)  # type: ignore[attr-defined]
        states = pickle.loads((checkpoint / STATES).read_bytes())
        robots, lstm_states, self._random_states = states
        self._vec_env.restore(robots)
        if lstm_states is not None:
            self._model._last_lstm_states = lstm_states  # type: ignore[attr-defined]
        self._started = True

    def _check(self) -> None:
        check_weights(weight.detach().numpy() for weight in self._model.policy.parameters())


class BeforeRollout(BaseCallback):
    """Calls a function before every rollout."""

    def __init__(self, function: Callable[[], None]) -> None:
        """Take the function."""
        super().__init__()
        self._function = function

    def _on_rollout_start(self) -> None:
        self._function()

    def _on_step(self) -> bool:
        return True


def _random_states() -> tuple[Any, Any, torch.Tensor]:
    """The states of the global streams from which Stable-Baselines3 draws."""
    return random.getstate(), np.random.get_state(), torch.get_rng_state()  # noqa: NPY002


def _set_random_states(states: tuple[Any, Any, torch.Tensor]) -> None:
    python, numpy, torchs = states
    random.setstate(python)
    np.random.set_state(numpy)  # noqa: NPY002
    torch.set_rng_state(torchs)
