"""What all control laws share: gains, state, and how a law acts behind `predict`.

State is a plain array that the caller carries from call to call, in the manner of
Stable-Baselines3's recurrent policies.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_baselines.allocation import ALLOCATIONS, PSEUDO_INVERSE, within
from usm_baselines.estimation.navigator import ACCELERATION_NOISE, DISTURBANCE_NOISE, Navigator
from usm_baselines.estimation.plant_navigator import PlantNavigator
from usm_baselines.estimation.prediction import Predictor, tell
from usm_baselines.signals import Array, Signals, act, model_of, sense, shared_size, signals_of
from usm_baselines.space import Gain, chosen_gains
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

# The gain of the heading controller, which all laws share: it is tuned for none of them, so that
# none buys position with heading.
HEADING_GAIN = Gain(100.0, "N m/rad", "heading gain k_psi")


class Percept(NamedTuple):
    """What a law knows of a batch of robots before it acts.

    Attributes:
        signals: What was measured and estimated.
        state: The law's state, brought to the present, (batch, numbers).
    """

    signals: Signals
    state: Array


def corrected(signals: Signals, correction: Array | None) -> Signals:
    """Signals with what is to be added to the estimates, (batch, axes, 3), if anything is."""
    if correction is None:
        return signals
    return signals._replace(
        y=signals.y + correction[:, :, 0],
        rate=signals.rate + correction[:, :, 1],
        disturbance=signals.disturbance + correction[:, :, 2],
    )


def as_batch(observation: ArrayLike, numbers: int) -> tuple[NDArray[np.float32], bool]:
    """A batch of observations, (batch, numbers), and whether it was given as a single one.

    Raises:
        ValueError: If its shape is wrong.
    """
    seen = np.asarray(observation, np.float32)
    require(
        seen.ndim in (1, 2) and seen.shape[-1] == numbers,
        "the observation's shape",
        seen.shape,
        f"({numbers},) or (batch, {numbers})",
    )
    return seen.reshape(-1, numbers), seen.ndim == 1


class ScriptedPolicy:
    """A control law behind `predict`; subclasses give `Gains`, `state` and `control`.

    Actions are not clipped: the environment saturates them, and what it has applied comes back in
    the next observation.

    Attributes:
        nominal: What the policy knows of the robot.
        gains: The law's gains, one of its `Gains`.
        predictor: What estimates for the law by the nominal plant, or by one that it identifies;
            None if nothing does.
        privileged: Whether it has to be given true state; never, here.
    """

    privileged = False
    # The law's gains: a `NamedTuple` of `Gain`, with the field `heading_gain`.
    Gains: type[Any]
    # Names of the numbers that the law keeps per axis, in order.
    state: tuple[str, ...] = ()
    # Those among them that the residual task shows to its agent.
    shown: tuple[str, ...] = ()
    # What navigates, if something does.
    navigator: type[Navigator] | type[PlantNavigator] = PlantNavigator
    # Whether the law models the thrusters' lag itself.
    knows_lag = False

    def __init__(
        self,
        nominal: Nominal,
        *,
        lag: bool = False,
        navigated: bool = False,
        allocation: str = PSEUDO_INVERSE,
        **gains: float,
    ) -> None:
        """Take gains other than the defaults by name.

        Args:
            nominal: What the policy knows of the robot.
            lag: Whether the applied force that the law is fed lags behind the commands as it
                nominally does; without it, it is the command itself, as in the paper.
            navigated: Whether a navigator estimates the error and its rate for the law; without it,
                the law takes the last position as it was measured.
            allocation: How force and moment are shared out among the thrusters, one of
                `allocation.ALLOCATIONS`.
            gains: Gains other than the defaults, by name.

        Raises:
            ValueError: If a gain is not finite, is negative, or is 0 and has to be positive; or if
                the law foresees the motion and nothing foresees that of the robot.
        """
        self.nominal = nominal
        self.gains = chosen_gains(self.Gains, gains)
        self._world, self._model = world_of(nominal.robot), model_of(nominal, lag)
        # Before the law's own numbers stand those that all laws share.
        self._shared = shared_size(self._model)
        self._navigator = self.navigator(nominal, *self.densities) if navigated else None
        self._own = self._shared + (self._navigator.size if self._navigator else 0)
        self.predictor: Predictor | None = None
        if isinstance(self._navigator, PlantNavigator):
            self.predictor = self._navigator.predictor
        require(not (lag and self.knows_lag), "lag", lag, "False for a law that models it")
        require(allocation in ALLOCATIONS, "allocation", allocation, ", ".join(ALLOCATIONS))
        self._within_limits = allocation != PSEUDO_INVERSE

    @property
    def densities(self) -> tuple[float, float]:
        """Spectral densities of the noise that a navigator assumes, see `Navigator`."""
        return ACCELERATION_NOISE, DISTURBANCE_NOISE

    @property
    def predictor_columns(self) -> slice:
        """Columns of what `predict` returns that hold the state of the predictor, if there is one.

        They begin with (e, v, d) of each axis.
        """
        first = self._own if self._navigator is None else self._shared
        return slice(first, first + (self.predictor.size if self.predictor else 0))

    @property
    def columns(self) -> dict[str, NDArray[np.int64]]:
        """Columns of what `predict` returns that hold the numbers of `state`, by name, (axes,)."""
        first = self._own + len(self.state) * np.arange(self._model.axes, dtype=np.int64)
        return {name: first + index for index, name in enumerate(self.state)}

    def state_of(self, state: Array) -> dict[str, Array]:
        """The law's own numbers in what `predict` returns, by name, all (batch, axes)."""
        return {name: state[:, column] for name, column in self.columns.items()}

    @cached_property
    def law_shape(self) -> tuple[int, ...]:
        """Shape of what the law keeps of one robot, the numbers of `state` first."""
        return (self._model.axes, len(self.state))

    def estimate(self, signals: Signals, memory: Array, state: Array) -> None:
        """Fill in the estimates among the signals, if the law acts on any.

        Args:
            signals: What the law works with.
            memory: Memory of the navigator, moved on in place.
            state: What the law keeps, (batch, *law_shape).
        """
        if self._navigator is not None:
            self._navigator.estimate(signals, self._model.mass, memory)
        elif self.predictor is not None:
            self.predictor.estimate(signals, state)
            tell(signals, self._model.mass, state)

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Fill in the force on the centre of mass, N, and advance the law's state.

        Args:
            signals: What the law works with.
            state: What the law keeps, (batch, *law_shape), zero at the start.
            force: Where to write the force, (batch, axes).
        """
        raise NotImplementedError

    def predict(
        self,
        observation: ArrayLike,
        state: Array | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
        *,
        correction: Array | None = None,
    ) -> tuple[NDArray[np.float32], Array]:
        """Act on one observation or on a batch.

        Args:
            observation: Observation, (numbers,) or (batch, numbers).
            state: What the last call returned; None at the start.
            episode_start: Where an episode starts and the state is dropped, bool, a scalar
                or (batch,).
            deterministic: Without effect: the laws are deterministic.
            correction: What to add to the estimates that a law with a predictor acts on: of error,
                m, its rate, m/s, and what the plant leaves out, m/s^2, (batch, axes, 3). The filter
                behind them stays as it is.

        Returns:
            Thruster commands over the limit, not clipped, (thrusters,) or (batch, thrusters), and
            the state for the next call.

        Raises:
            ValueError: If the shape of the observation or the state is wrong, or the law has
                no predictor.
        """
        fitting = correction is None or self.predictor is not None
        require(fitting, "correction", correction, "None for this law, which has no predictor")
        seen, single = as_batch(observation, self._model.scale.size)
        known = self.perceive(seen, state, episode_start)
        action, new_state = self.decide(known, correction)
        return (action[0] if single else action), new_state

    def perceive(
        self, observation: NDArray[np.float32], state: Array | None, start: ArrayLike | None
    ) -> Percept:
        """The first half of `predict`: take in a batch of observations, and estimate.

        Args:
            observation: Observations, (batch, numbers).
            state: What the last call returned; None at the start.
            start: Where an episode starts, bool, a scalar or (batch,).
        """
        size = len(observation)
        state = self._state(size, state, start)
        navigated = self._navigator is not None
        signals = signals_of(observation, self._model, self._world, navigated)
        sense(state, self._model, signals)
        own = state[:, self._own :].copy().reshape(size, *self.law_shape)
        self.estimate(signals, state[:, self._shared : self._own], own)
        state[:, self._own :] = own.reshape(size, -1)
        return Percept(signals, state)

    def decide(
        self, known: Percept, correction: Array | None = None
    ) -> tuple[NDArray[np.float32], Array]:
        """The second half: act on what is known, which stays as it is.

        Args:
            known: What `perceive` returned.
            correction: As of `predict`.

        Returns:
            Commands, (batch, thrusters), and the state for the next call.
        """
        signals, state = corrected(known.signals, correction), known.state.copy()
        size = len(state)
        own = state[:, self._own :].copy().reshape(size, *self.law_shape)
        force = np.empty_like(signals.y)
        self.control(signals, own, force)
        state[:, self._own :] = own.reshape(size, -1)
        action = np.empty((size, self._model.thrusters), np.float32)
        gain, model = self.gains.heading_gain, self._model
        act(signals.observation, state, model, signals.allocation, force, gain, action)
        if self._within_limits:
            limit = model.scale[model.thruster_limit] * signals.observation[:, model.thruster_limit]
            action = within(action, limit, model.dead_band, signals.allocation, model.axes)
        return action, state

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
