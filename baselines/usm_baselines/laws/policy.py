"""What all control laws share: gains, state, and how a law acts behind `predict`.

State is a plain array that the caller carries from call to call, in the manner of
Stable-Baselines3's recurrent policies.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_baselines.signals import Array, Signals, act, model_of, sense, shared_size, signals_of
from usm_baselines.space import Range
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

# Where the heading controller, which all laws share, is tuned.
HEADING_RANGE = Range(30.0, 300.0, "N m/rad")


class ScriptedPolicy:
    """A control law behind `predict`; subclasses give `law_size`, `positive` and `force`.

    Actions are not clipped: the environment saturates them, and what it has applied comes back in
    the next observation.

    Attributes:
        nominal: What the policy knows of the robot.
        gains: The law's gains, a named tuple with the field `heading_gain`, N m/rad.
        privileged: Whether it has to be given true state; never, here.
    """

    privileged = False
    # Numbers of state that the law keeps for each axis.
    law_size = 0
    # Gains that must not be 0.
    positive: tuple[str, ...] = ()

    def __init__(self, nominal: Nominal, gains: Any) -> None:
        """Keep nominal knowledge and gains.

        Raises:
            ValueError: If a gain is negative or not finite, or 0 though it is among `positive`.
        """
        for name, gain in gains._asdict().items():
            number = isinstance(gain, (int, float)) and np.isfinite(gain) and gain >= 0
            require(number, name, gain, "a finite number >= 0")
            require(gain > 0 or name not in self.positive, name, gain, "a number > 0")
        self.nominal = nominal
        self.gains = type(gains)(*map(float, gains))
        self._world, self._model = world_of(nominal.robot), model_of(nominal)
        # Before the law's own numbers stand those that all laws share.
        self._own = shared_size(self._model)

    @property
    def law_shape(self) -> tuple[int, ...]:
        """Shape of the law's state for one robot; by default `law_size` numbers for each axis."""
        return (self._model.axes, self.law_size)

    def law_state(self, state: Array) -> Array:
        """The law's own part of what `predict` returns, (batch, *law_shape), as a copy.

        What its numbers are, the law says in its docstring.
        """
        return state[:, self._own :].reshape(len(state), *self.law_shape).copy()

    @property
    def law_columns(self) -> NDArray[np.int64]:
        """Columns of what `predict` returns in which the law's own numbers stand, (*law_shape)."""
        columns = self._own + np.arange(math.prod(self.law_shape), dtype=np.int64)
        return columns.reshape(self.law_shape)

    def force(self, signals: Signals, law_state: Array) -> Array:
        """The force on the centre of mass, N, (batch, 2); the law's state is advanced in place.

        Args:
            signals: What the law works with.
            law_state: The law's own state, (batch, *law_shape), zero at the start.
        """
        raise NotImplementedError

    def predict(
        self,
        observation: ArrayLike,
        state: Array | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], Array]:
        """Act on one observation, or on each of a batch.

        Args:
            observation: Observation, (numbers,) or (batch, numbers).
            state: What the last call returned; None at the start.
            episode_start: Where an episode starts and the state is to be forgotten, bool, a scalar
                or (batch,).
            deterministic: Without effect: the laws are deterministic.

        Returns:
            Thruster commands over the limit, not clipped, (thrusters,) or (batch, thrusters), and
            the state for the next call.

        Raises:
            ValueError: If the shape of the observation or the state is wrong.
        """
        seen = np.asarray(observation, np.float32)
        numbers = self._model.scale.size
        require(
            seen.ndim in (1, 2) and seen.shape[-1] == numbers,
            "the observation's shape",
            seen.shape,
            f"({numbers},) or (batch, {numbers})",
        )
        batch = np.atleast_2d(seen)
        new_state = self._state(len(batch), state, episode_start)
        action = self._act(batch, new_state)
        return (action, new_state) if seen.ndim == 2 else (action[0], new_state)

    def _act(self, observation: NDArray[np.float32], state: Array) -> NDArray[np.float32]:
        size = len(observation)
        signals = signals_of(observation, self._model, self._world)
        sense(state, self._model, signals)
        law_state = self.law_state(state)
        force = self.force(signals, law_state)
        state[:, self._own :] = law_state.reshape(size, -1)
        action = np.empty((size, self._model.thrusters), np.float32)
        gain = float(self.gains.heading_gain)
        act(observation, state, self._model, signals.allocation, force, gain, action)
        return action

    def _state(self, size: int, state: Array | None, episode_start: ArrayLike | None) -> Array:
        numbers = self._own + math.prod(self.law_shape)
        if state is None:
            return np.zeros((size, numbers))
        new = np.array(state, np.float64)
        require(new.shape == (size, numbers), "state", new.shape, f"shape ({size}, {numbers})")
        if episode_start is not None:
            start = np.asarray(episode_start, bool)
            new[start if start.shape == (size,) else np.broadcast_to(start, (size,))] = 0.0
        return new
