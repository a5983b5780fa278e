"""The residual task: a learned correction of the thrust that a base policy commands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, get_args

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from agents.residual_observation import BASE_STATES, ResidualLayout, ResidualObserver
from baselines.contender import contender
from baselines.estimator import Estimator
from baselines.policy import Policy
from baselines.super_twisting import SuperTwisting
from usm_gym.env import USMEnv, checked_action
from usm_gym.nominal import Nominal
from usm_gym.observation import ObservationLayout
from usm_gym.plant.compile import compiled
from usm_gym.plant.thrusters import allocate
from usm_gym.scenario import Mode
from usm_gym.validation import require
from usm_gym.vector_env import USMVectorEnv

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]

ActionKind = Literal["wrench", "thrusters"]
RESIDUAL_SCALE = 6.0


class Memory(NamedTuple):
    """What the residual task keeps from one control instant to the next, the batch first.

    Attributes:
        limit: Thruster limits, N, (batch, 1).
        allocation: Allocation matrices, (batch, 3, thrusters).
        base_action: The base's commands over the limit, not clipped, (batch, thrusters).
        base_state: State of the base.
        observer_state: State of the residual task's observer, (batch, numbers).
        action: The agent's last action, (batch, actions).
    """

    limit: NDArray[np.float64]
    allocation: NDArray[np.float64]
    base_action: Array
    base_state: Any
    observer_state: NDArray[np.float64]
    action: Array


@compiled
def allocate_all(allocation, wrench, forces):  # type: ignore[no-untyped-def]
    """Fill in the thruster forces of least norm that make wrenches, (batch, thrusters)."""
    for b in range(len(wrench)):
        allocate(allocation[b], wrench[b, 0], wrench[b, 1], wrench[b, 2], forces[b])


class Residual:
    """Base policy and residual, for a batch of robots: all that single, vector and policy share.

    Attributes:
        nominal: What is known of the robot.
        layout: Layout of the agent's observation.
        actions: How many numbers an action has.
    """

    def __init__(
        self,
        nominal: Nominal,
        base: str | Policy = "sta",
        residual_scale: float = RESIDUAL_SCALE,
        action: ActionKind = "wrench",
    ) -> None:
        """Make the base; arguments as of `ResidualEnv`."""
        kinds = get_args(ActionKind)
        require(action in kinds, "action", action, " or ".join(kinds))
        number = isinstance(residual_scale, (int, float)) and np.isfinite(residual_scale)
        require(number and residual_scale > 0, "residual_scale", residual_scale, "a force > 0 N")
        if isinstance(base, str):
            named = contender(base)
            require(not named.privileged, "base", base, "a policy that is not given true state")
            base = named.make(nominal)
        self.nominal = nominal
        self.base = base
        self._scale, self._action = float(residual_scale), action
        plain = ObservationLayout(nominal.robot.links, len(nominal.robot.thrusters))
        self._limit_part = plain.slices["thruster_limit"]
        self._limit_scale = plain.scale[self._limit_part]
        self.actions = 3 if action == "wrench" else plain.thrusters
        self._observer = ResidualObserver(base, plain, self.actions, Estimator(nominal))
        self.layout = self._observer.layout

    @property
    def action_space(self) -> gym.Space[Array]:
        """The action space."""
        return gym.spaces.Box(-1.0, 1.0, (self.actions,), np.float32)

    def observe(
        self, observation: Array, memory: Memory | None, start: Flags
    ) -> tuple[Array, Memory]:
        """Let the base act, and make the agent's observations.

        Args:
            observation: Plain observations, (batch, numbers).
            memory: What `command` returned; None at the start.
            start: Where an episode starts, (batch,).

        Returns:
            Observations, (batch, layout.size), and what to keep.
        """
        base_state, state = None, None
        action = np.zeros((len(observation), self.actions), np.float32)
        if memory is not None:
            base_state, state = memory.base_state, memory.observer_state
            action[~start] = memory.action[~start]
        base_action, base_state = self.base.predict(observation, base_state, start, True)
        base_action = np.asarray(base_action, np.float32)
        seen, signals, state = self._observer.update(
            observation, base_action, base_state, action, state, start
        )
        limit = observation[:, self._limit_part] * self._limit_scale
        return seen, Memory(limit, signals.allocation, base_action, base_state, state, action)

    def command(self, memory: Memory, action: Array) -> tuple[Array, Memory]:
        """Add residuals to the base's commands; the plant saturates the sum, once.

        Args:
            memory: What `observe` returned.
            action: The agent's actions, (batch, actions); values beyond [-1, 1] saturate.

        Returns:
            Thruster commands over the limit, (batch, thrusters), and what to keep.
        """
        action = np.clip(action, -1.0, 1.0)
        forces = self._scale * action.astype(np.float64)
        if self._action == "wrench":
            wrench, forces = forces, np.empty(memory.base_action.shape)
            allocate_all(memory.allocation, wrench, forces)
        command = (memory.base_action + forces / memory.limit).astype(np.float32)
        return command, memory._replace(action=action)


class ResidualEnv(gym.Wrapper[Array, Array, Array, Array], gym.utils.RecordConstructorArgs):
    """An environment in which a base policy acts and the agent corrects it.

    The base sees the plain observation, as it would alone. Base and residual are added and
    saturated once; what was applied is what the next observation reports, to the base's observer
    too. A residual of zero gives the base's episode to the bit. Reward, start, end and info are
    the plain environment's.

    ## Action

    `Box(-1, 1)` in units of `residual_scale`. "wrench": force in x and y (N, global frame) and
    moment (N m) on the centre of mass, shared out to the thrusters with least norm. "thrusters":
    force of each thruster (N).

    ## Observation

    `Box(float32)`: what the base knows, the states of a Kalman filter beside it, and the joint
    motion in a few numbers; physical value over scale, cut off at its bound. On the base "sta":

    OBSERVATION_TABLE
    """

    def __init__(
        self,
        env: gym.Env[Array, Array],
        base: str | Policy = "sta",
        residual_scale: float = RESIDUAL_SCALE,
        action: ActionKind = "wrench",
    ) -> None:
        """Wrap an environment.

        Args:
            env: A plain environment of this package.
            base: The base policy: a name as `--policies` takes it, or the policy itself.
            residual_scale: Largest residual force in each axis or of each thruster, N, and largest
                residual moment, N m.
            action: "wrench" or "thrusters".

        Raises:
            ValueError: If the base is unknown or an argument not allowed.
        """
        gym.utils.RecordConstructorArgs.__init__(
            self, base=base, residual_scale=residual_scale, action=action
        )
        gym.Wrapper.__init__(self, env)
        self._plain: USMEnv = env.unwrapped  # type: ignore[assignment]
        self._arguments = (base, residual_scale, action)
        self._residual = Residual(self._plain.nominal, *self._arguments)
        self.observation_space = self._residual.layout.space
        self.action_space = self._residual.action_space

    @property
    def residual(self) -> Residual:
        """What the task adds to the plain environment."""
        return self._residual

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode of the plain environment and of the base."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._residual = _made_for(self._plain.nominal, self._residual, self._arguments)
        seen, self._memory = self._residual.observe(observation[np.newaxis], None, np.array([True]))
        return seen[0], info

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Add a residual to the base's command for one control period."""
        residual = checked_action(action, (self._residual.actions,))[np.newaxis]
        command, memory = self._residual.command(self._memory, residual)
        observation, reward, terminated, truncated, info = self.env.step(command[0])
        seen, self._memory = self._residual.observe(
            observation[np.newaxis], memory, np.array([False])
        )
        return seen[0], float(reward), terminated, truncated, info

    def snapshot(self) -> tuple[Any, Memory]:
        """Copy the whole state, the base's included."""
        return self._plain.snapshot(), self._memory

    def restore(self, snapshot: tuple[Any, Memory]) -> None:
        """Return to a snapshot."""
        plain, self._memory = snapshot
        self._plain.restore(plain)


# The class docstring is the specification; its table comes from the one that the code uses.
ResidualEnv.__doc__ = (ResidualEnv.__doc__ or "").replace(
    "OBSERVATION_TABLE",
    ResidualLayout(5, 3, tuple(BASE_STATES[SuperTwisting].values()))
    .table()
    .replace("\n", "\n    "),
)


class ResidualVectorEnv(
    gym.vector.VectorWrapper[Array, Array, Array, Array, Any], gym.utils.RecordConstructorArgs
):
    """The residual task of many robots; each behaves as in `ResidualEnv`, to the bit."""

    def __init__(
        self,
        env: USMVectorEnv,
        base: str | Policy = "sta",
        residual_scale: float = RESIDUAL_SCALE,
        action: ActionKind = "wrench",
    ) -> None:
        """Wrap a vector environment; arguments as of `ResidualEnv`."""
        gym.utils.RecordConstructorArgs.__init__(
            self, base=base, residual_scale=residual_scale, action=action
        )
        gym.vector.VectorWrapper.__init__(self, env)
        self._plain = env
        self._arguments = (base, residual_scale, action)
        self._residual = Residual(env.nominal, *self._arguments)
        self.single_observation_space = self._residual.layout.space
        self.single_action_space = self._residual.action_space
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)
        self.action_space = batch_space(self.single_action_space, env.num_envs)
        self._memory: Memory | None = None

    @property
    def residual(self) -> Residual:
        """What the task adds to the plain environment."""
        return self._residual

    def reset(
        self,
        *,
        seed: Any = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Start the episodes of all robots, or of those in `options["reset_mask"]`."""
        observation, info = self.env.reset(seed=seed, options=options)
        which = np.ones(self.num_envs, bool)
        if options and options.get("reset_mask") is not None:
            which = options["reset_mask"]
        if which.all():
            self._residual = _made_for(self._plain.nominal, self._residual, self._arguments)
            self._seen, self._memory = self._residual.observe(observation, None, which)
        else:
            assert self._memory is not None
            seen, memory = self._residual.observe(observation, self._memory, which)
            self._seen = _chosen(which, seen, self._seen)
            pairs = zip(memory, self._memory, strict=True)
            self._memory = Memory(*(_chosen(which, new, old) for new, old in pairs))
        self._done = np.zeros(self.num_envs, bool)
        return self._seen.copy(), info

    def snapshot(self) -> tuple[Any, ...]:
        """Copy the whole state, the base's included."""
        return self._plain.snapshot(), self._memory, self._seen, self._done

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Return to a snapshot."""
        plain, self._memory, self._seen, self._done = snapshot
        self._plain.restore(plain)
        self._residual = _made_for(self._plain.nominal, self._residual, self._arguments)

    def step(self, actions: Array) -> tuple[Array, Any, Any, Any, dict[str, Any]]:
        """Add residuals to the base's commands for one control period."""
        if self._memory is None:
            raise gym.error.ResetNeeded("call reset() before anything else")
        residual = checked_action(actions, (self.num_envs, self._residual.actions))
        command, memory = self._residual.command(self._memory, residual)
        observation, rewards, terminated, truncated, info = self.env.step(command)
        # Next-step autoreset: the step of those that were done was their reset.
        start = self._done
        done = terminated | truncated
        if self._plain.autoreset_mode is AutoresetMode.SAME_STEP:
            start = done
            if done.any():
                last = observation.copy()
                for index in np.flatnonzero(done).tolist():
                    last[index] = info["final_obs"][index]
                seen, _ = self._residual.observe(last, memory, np.zeros(self.num_envs, bool))
                for index in np.flatnonzero(done).tolist():
                    info["final_obs"][index] = seen[index]
        else:
            self._done = done
        self._seen, self._memory = self._residual.observe(observation, memory, start)
        return self._seen.copy(), rewards, terminated, truncated, info


class ResidualPolicy:
    """Base policy and agent as one policy of the plain environment.

    Attributes:
        nominal: What the policy knows of the robot.
        privileged: Never, here.
    """

    privileged = False

    def __init__(self, residual: Residual, agent: Policy) -> None:
        """Join the two.

        Args:
            residual: The residual task as in training.
            agent: What was trained on it, with `predict`.
        """
        self.nominal = residual.nominal
        self._residual, self._agent = residual, agent

    def predict(
        self,
        observation: ArrayLike,
        state: tuple[Memory, Any] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[Memory, Any]]:
        """Act on one observation or a batch; see `ScriptedPolicy.predict`."""
        plain = np.asarray(observation, np.float32)
        batch = np.atleast_2d(plain)
        memory, agent_state = state or (None, None)
        start = np.full(len(batch), memory is None)
        if episode_start is not None:
            start |= np.asarray(episode_start, bool)
        seen, memory = self._residual.observe(batch, memory, start)
        action, agent_state = self._agent.predict(seen, agent_state, start, deterministic)
        command, memory = self._residual.command(memory, np.asarray(action, np.float32))
        return (command if plain.ndim == 2 else command[0]), (memory, agent_state)


def make_residual_env(
    mode: Mode,
    base: str = "sta",
    residual_scale: float = RESIDUAL_SCALE,
    action: ActionKind = "wrench",
    conditions: str | Mapping[str, Any] = "field",
    robot: Mapping[str, Any] | None = None,
    render_mode: str | None = None,
) -> ResidualEnv:
    """Make the residual task of a mode; arguments as of `ResidualEnv` and `USMEnv`."""
    env = USMEnv(mode, conditions, robot, render_mode)
    return ResidualEnv(env, base, residual_scale, action)


def make_residual_vector_env(
    num_envs: int,
    mode: Mode,
    base: str = "sta",
    residual_scale: float = RESIDUAL_SCALE,
    action: ActionKind = "wrench",
    **arguments: Any,
) -> ResidualVectorEnv:
    """Make the residual task of many robots; other arguments as of `USMVectorEnv`."""
    return ResidualVectorEnv(
        USMVectorEnv(num_envs, mode, **arguments), base, residual_scale, action
    )


def _made_for(nominal: Nominal, current: Residual, arguments: tuple[Any, ...]) -> Residual:
    # A scenario may bring a control period, noise or joint gains of its own.
    return current if current.nominal == nominal else Residual(nominal, *arguments)


def _chosen(which: Flags, new: Any, old: Any) -> Any:
    if old is None:  # a policy without state
        return new
    return np.where(which.reshape(-1, *[1] * (new.ndim - 1)), new, old)
