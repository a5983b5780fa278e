"""What all control laws share: from the observation to signals, from a wrench to the action.

A law sees the tracking error, the applied force and the reference, and answers with a force on the
centre of mass; heading control and thruster allocation are the same for all. State is a plain array
that the caller carries from call to call, in the manner of Stable-Baselines3's recurrent policies.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.space import Range
from usm_gym.kernels.compile import compiled
from usm_gym.kernels.elementary import sincos
from usm_gym.nominal import Nominal
from usm_gym.observation import ObservationLayout
from usm_gym.plant.measure import (
    HEADING_ERROR,
    JOINT_ANGLES,
    POSITION_ERROR,
    REFERENCE_ACCELERATION,
    REFERENCE_VELOCITY,
    TAIL_ANGLE,
    THRUSTER_COMMAND,
    THRUSTER_LIMIT,
    value,
)
from usm_gym.plant.thrusters import allocate, allocation_matrix
from usm_gym.validation import require

Array = NDArray[np.float64]

# Where the heading controller, which all laws share, is tuned.
HEADING_RANGE = Range(30.0, 300.0, "N m/rad")


class Policy(Protocol):
    """Anything that acts: Stable-Baselines3's `predict`, for one observation or a batch."""

    def predict(
        self,
        observation: Any,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[Any, Any]:
        """Return the action, and the state to pass to the next call."""
        ...


class Model(NamedTuple):
    """Nominal knowledge in the form that kernels take.

    Attributes:
        starts: First index of each entry of the observation.
        scale: Physical value over observed value of each number.
        links: Number of links.
        l: Half the length of a link, m.
        thruster_links: Zero-based link of each thruster.
        thruster_is_normal: Whether each thruster pushes across its link.
        mass: Total mass m_t, kg.
        h: Control period, s.
    """

    starts: NDArray[np.int64]
    scale: Array
    links: int
    l: float
    thruster_links: NDArray[np.int64]
    thruster_is_normal: NDArray[np.bool_]
    mass: float
    h: float


class Signals(NamedTuple):
    """What a control law works with, for a batch of robots.

    Attributes:
        started: 0.0 at the first call of an episode, else 1.0, (batch,).
        y: Measured position error, m, (batch, 2).
        u: Applied force over the mass less the reference's acceleration, m/s^2, (batch, 2).
        velocity: Velocity of the reference, m/s, (batch, 2).
        acceleration: Acceleration of the reference, m/s^2, (batch, 2).
        allocation: Allocation matrices, (batch, 3, thrusters).
        observation: All that is measured, to be read with `value`, (batch, numbers).
    """

    started: Array
    y: Array
    u: Array
    velocity: Array
    acceleration: Array
    allocation: Array
    observation: NDArray[np.float32]


def model_of(nominal: Nominal) -> Model:
    """The nominal knowledge for kernels."""
    robot = nominal.robot
    layout = ObservationLayout(robot.links, len(robot.thrusters))
    return Model(
        starts=layout.starts,
        scale=layout.scale,
        links=robot.links,
        l=robot.half_length,
        thruster_links=robot.thruster_links,
        thruster_is_normal=robot.thruster_is_normal,
        mass=robot.total_mass,
        h=nominal.control_period,
    )


@compiled
def sense(state, model, signals):
    """Fill in the signals from the observations among them and the shared part of the state.

    The applied force is the last command after saturation, projected with the link angles at the
    time of that command, which the state has kept.
    """
    thrusters = model.thruster_links.size
    sine, cosine = np.empty(model.links), np.empty(model.links)
    for b in range(signals.observation.shape[0]):
        seen = signals.observation[b]
        signals.started[b] = state[b, 0]
        limit = value(seen, model, THRUSTER_LIMIT, 0)
        for axis in range(2):
            force = 0.0
            for j in range(thrusters):
                command = value(seen, model, THRUSTER_COMMAND, j) * limit
                force += state[b, 1 + axis * thrusters + j] * command
            acceleration = value(seen, model, REFERENCE_ACCELERATION, axis)
            signals.y[b, axis] = value(seen, model, POSITION_ERROR, axis)
            signals.velocity[b, axis] = value(seen, model, REFERENCE_VELOCITY, axis)
            signals.acceleration[b, axis] = acceleration
            signals.u[b, axis] = force / model.mass - acceleration
        theta = value(seen, model, TAIL_ANGLE, 0)
        sine[0], cosine[0] = sincos(theta)
        for i in range(model.links - 1):
            theta -= value(seen, model, JOINT_ANGLES, i)
            sine[i + 1], cosine[i + 1] = sincos(theta)
        T = signals.allocation[b]
        allocation_matrix(sine, cosine, model.l, model.thruster_links, model.thruster_is_normal, T)


@compiled
def act(observation, state, model, allocation, force, heading_gain, action):
    """Fill in the actions that make the forces (N) and a proportional heading moment."""
    thrusters = model.thruster_links.size
    forces = np.empty(thrusters)
    for b in range(observation.shape[0]):
        seen, T = observation[b], allocation[b]
        moment = -heading_gain * value(seen, model, HEADING_ERROR, 0)
        allocate(T, force[b, 0], force[b, 1], moment, forces)
        limit = value(seen, model, THRUSTER_LIMIT, 0)
        state[b, 0] = 1.0
        for j in range(thrusters):
            action[b, j] = forces[j] / limit
            state[b, 1 + j] = T[0, j]
            state[b, 1 + thrusters + j] = T[1, j]


def room_for_signals(observation: NDArray[np.float32], thrusters: int) -> Signals:
    """Signals of a batch that `sense` has to fill in."""
    size = len(observation)
    y, u, velocity, acceleration = np.empty((4, size, 2))
    allocation = np.empty((size, 3, thrusters))
    return Signals(np.empty(size), y, u, velocity, acceleration, allocation, observation)


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
        self._model = model_of(nominal)
        self._thrusters = len(nominal.robot.thrusters)
        # Before the law's own numbers stand those that all laws share.
        self._own = 1 + 2 * self._thrusters

    @property
    def law_shape(self) -> tuple[int, ...]:
        """Shape of the law's state for one robot; by default `law_size` numbers for each axis."""
        return (2, self.law_size)

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
        signals = room_for_signals(observation, self._thrusters)
        sense(state, self._model, signals)
        law_state = self.law_state(state)
        force = self.force(signals, law_state)
        state[:, self._own :] = law_state.reshape(size, -1)
        action = np.empty((size, self._thrusters), np.float32)
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
