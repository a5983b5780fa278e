"""The residual task: a learned correction of what a base policy commands or believes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray
from usm_baselines.contender import contender
from usm_baselines.estimation.estimator import Estimate, Estimator, foreseen
from usm_baselines.estimation.foresight import NAMES
from usm_baselines.estimation.prediction import believed
from usm_baselines.head import HeadPercept
from usm_baselines.policy import Percept, ScriptedPolicy, corrected
from usm_baselines.signals import model_of, softness_of

from usm_agents.residual.action import (
    LARGEST_CORRECTION,
    LARGEST_RATE,
    LARGEST_TURN,
    LARGEST_VELOCITY,
    LEAST_DEVIATION,
    RESIDUAL_SCALE,
    ActionKind,
    body_of,
    check_arguments,
    deciding_of,
    numbers_of,
    usual_action,
    usual_base,
)
from usm_agents.residual.observation import DEVIATIONS, FAR, SHORT
from usm_agents.residual.observer import ResidualObserver
from usm_gym.kernels.compile import compiled
from usm_gym.plant.thrusters import allocate
from usm_gym.policy import Policy
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]


class Memory(NamedTuple):
    """What the residual task keeps from one control instant to the next, the batch first.

    Attributes:
        limit: Thruster limits, N, (batch,).
        allocation: Allocation matrices, (batch, forces and moments, thrusters).
        base_action: The base's commands over the limits, not clipped, (batch, commands); none
            where the base acts after the agent.
        base_state: State of the base.
        estimator_state: State of the estimator beside it, (batch, numbers).
        frames: Earlier frames of the observation, physical values, (batch, numbers).
        action: The agent's last action, (batch, actions).
        known: What a base that acts after the agent knows before, else None.
    """

    limit: NDArray[np.float64]
    allocation: NDArray[np.float64]
    base_action: Array
    base_state: Any
    estimator_state: NDArray[np.float64]
    frames: NDArray[np.float64]
    action: Array
    known: Percept | HeadPercept | None


@compiled
def correct_all(base_action, allocation, limit, residual, wrench, softness, command):  # type: ignore[no-untyped-def]
    """Fill in the commands over the limits, (batch, commands): the base's and a residual's.

    Residuals are wrenches, forces in N before moments in N m, which the thrusters make with least
    norm, or forces of the thrusters, N. A wrench of forces alone has no moment.
    """
    rows = allocation.shape[1]
    forces, work = np.empty(allocation.shape[2]), np.empty((2 * rows + 1, rows))
    wanted = np.zeros(rows)
    for b in range(len(command)):
        if wrench:
            wanted[: residual.shape[1]] = residual[b]
            allocate(allocation[b], wanted, rows, softness, work, forces)
        else:
            forces[:] = residual[b]
        for j in range(forces.size):
            command[b, j] = base_action[b, j] + forces[j] / limit[b]
        for j in range(forces.size, command.shape[1]):
            command[b, j] = base_action[b, j]


class Residual:
    """Base policy and residual, for a batch of robots: what single, vector and policy share.

    Attributes:
        nominal: What is known of the robot.
        layout: Layout of the agent's observation.
        actions: How many numbers an action has.
        correction: The largest corrections of error, rate and disturbance, m, m/s, m/s^2, (3,).
    """

    def __init__(
        self,
        nominal: Nominal,
        base: str | Policy | None = None,
        residual_scale: float = RESIDUAL_SCALE,
        action: ActionKind | None = None,
        omit: Sequence[str] = (),
        frames: int = 1,
        position_noise: float | None = None,
    ) -> None:
        """Make the base.

        Args:
            nominal: What is known of the robot.
            base: The base policy: a name as `--policies` takes it, or the policy itself; by default
                "sta", and "rates-sta" where it has to move the joints, too.
            residual_scale: Largest residual force per axis or per thruster, N, and largest
                residual moment, N m; 1e-6 to 1000.
            action: What the agent's answer is added to: the "force" on the centre of mass, the
                "wrench" or the forces of the "thrusters" that the base commands, the "estimates"
                that it acts on, or the velocities that it wants of the "head"; or what stands in
                place of the rates of the "joints" that it commands. By default that of the
                "head" where the base moves joints, else the "force".
            omit: Entries of the observation that the agent is not shown, by name.
            frames: How many observations the agent sees at once, the latest last, 1 to 100.
            position_noise: Standard deviation of a measured position by which errors are scaled for
                the agent, m; by default that of the nominal knowledge.

        Raises:
            ValueError: If the base is unknown or an argument not allowed.
        """
        action = action or usual_action(nominal)
        check_arguments(residual_scale, action, frames)
        self.nominal, body = nominal, body_of(nominal)
        self.base = base = _made(usual_base(nominal) if base is None else base, nominal)
        self._scale, self._action = float(residual_scale), action
        plain = world_of(body.robot).layout
        self._body_size = plain.size
        self._softness = softness_of(model_of(body))
        self._limit = plain.slices["thruster_limit"].start
        self._limit_scale = plain.scale[self._limit]
        self._deciding = deciding_of(base, action)
        # A base whose estimates another agent corrects: this one is shown what that base believes.
        self._believing: Residual | None = None
        if isinstance(base, ResidualPolicy) and base.residual.corrects:
            self._believing = base.residual
        self.actions = numbers_of(nominal, action)
        self._estimator = Estimator(body)
        noise = nominal.position_noise if position_noise is None else position_noise
        length = max(SHORT, DEVIATIONS * noise)
        if action == "joints":  # at first the head is far from where it should be
            length *= FAR
        self._observer = ResidualObserver(
            base,
            nominal.robot,
            self.actions,
            length,
            tuple(omit),
            frames,
            action,
        )
        self.layout = self._observer.layout
        self.correction = max(noise, LEAST_DEVIATION) * np.array(LARGEST_CORRECTION)
        axes = len(world_of(nominal.robot).axes)
        self._velocities = np.where(np.arange(self.actions) < axes, LARGEST_VELOCITY, LARGEST_TURN)

    @property
    def corrects(self) -> bool:
        """Whether the agent corrects the estimates that the base acts on."""
        return self._action == "estimates"

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
            memory: What `command` returned; None at the start, of all episodes then.
            start: Where an episode starts, (batch,).

        Returns:
            Observations, (batch, layout.size), and what to keep.
        """
        size = observation.shape[0]
        if memory is None:
            start = np.ones(size, bool)
            base_state, filtered = None, None
            action = np.zeros((size, self.actions), np.float32)
            past = np.empty((size, self._observer.earlier))
        else:
            base_state, filtered = memory.base_state, memory.estimator_state
            action, past = memory.action, memory.frames
        known: Percept | HeadPercept | None = None
        if self._deciding is not None:
            known = self._deciding.perceive(observation, base_state, start)
            base_action, base_state = np.empty((size, 0), np.float32), known.state
        else:
            base_action, base_state = self.base.predict(observation, base_state, start, True)
            base_action = np.ascontiguousarray(base_action, np.float32)
        if self._believing is not None:
            estimate, filtered = self._believing.estimate(base_state[0]), np.empty((size, 0))
        else:
            body = np.ascontiguousarray(observation[:, : self._body_size])
            estimate, filtered = self._estimator.update(body, filtered, start)
        seen, frames = self._observer.update(
            observation, estimate, base_action, base_state, action, past, start
        )
        limit = observation[:, self._limit] * self._limit_scale
        allocation = estimate.signals.allocation
        return seen, Memory(
            limit, allocation, base_action, base_state, filtered, frames, action, known
        )

    def command(self, memory: Memory, action: Array) -> tuple[Array, Memory]:
        """Add residuals to the base's commands; the plant saturates the sum, once.

        Args:
            memory: What `observe` returned.
            action: The agent's actions, (batch, actions); values beyond [-1, 1] saturate.

        Returns:
            Commands over the limits, (batch, commands), and what to keep.
        """
        action = np.minimum(np.maximum(action, -1.0), 1.0)
        if self._deciding is not None:
            command, base_state = self._decide(memory.known, action)
            return command, memory._replace(action=action, base_state=base_state)
        command = np.empty(memory.base_action.shape, np.float32)
        residual = self._scale * action.astype(np.float64)
        as_wrench = self._action != "thrusters"
        correct_all(
            memory.base_action,
            memory.allocation,
            memory.limit,
            residual,
            as_wrench,
            self._softness,
            command,
        )
        return command, memory._replace(action=action)

    def estimate(self, memory: Memory) -> Estimate:
        """What the base acted on, its estimates corrected, and what its plant foresees by that.

        Args:
            memory: What `command` returned, the action being "estimates".
        """
        law, known = self._deciding, memory.known
        assert isinstance(law, ScriptedPolicy)
        assert law.predictor is not None
        assert isinstance(known, Percept)
        signals = corrected(known.signals, self._correction(memory.action))
        state = believed(signals, known.state[:, law.predictor_columns])
        return foreseen(law.predictor, signals, state)

    def _decide(self, known: Any, action: Array) -> tuple[Array, Any]:
        """Let a base that acts after the agent act: its commands, and its state."""
        law: Any = self._deciding
        if self._action == "estimates":
            return law.decide(known, self._correction(action))  # type: ignore[no-any-return]
        if self._action == "head":
            return law.decide(known, self._velocities * action)  # type: ignore[no-any-return]
        command, base_state = law.decide(known)
        command[:, -self.actions :] = LARGEST_RATE * action
        return command, base_state

    def _correction(self, action: Array) -> NDArray[np.float64]:
        return self.correction * action.reshape(len(action), -1, len(NAMES))


class ResidualPolicy:
    """Base policy and agent as one policy of the plain environment.

    Attributes:
        residual: The residual task.
        nominal: What the policy knows of the robot.
        base: The base policy.
        privileged: Never, here.
    """

    privileged = False

    def __init__(
        self,
        residual: Residual | gym.Env[Any, Any] | gym.vector.VectorEnv[Any, Any, Any],
        agent: Policy,
    ) -> None:
        """Join the two.

        Args:
            residual: The residual task as in training, or its environment, single or vector.
            agent: What was trained on it, with `predict`; a model of Stable-Baselines3 will do.

        Raises:
            ValueError: If `residual` is neither.
        """
        self.residual, self._agent = _task(residual), agent
        self.nominal, self.base = self.residual.nominal, self.residual.base

    def predict(
        self,
        observation: ArrayLike,
        state: tuple[Memory, Any] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[Memory, Any]]:
        """Act on one observation or a batch; see `ScriptedPolicy.predict`.

        Raises:
            ValueError: If the agent answers with other actions than those of the task.
        """
        plain = np.asarray(observation, np.float32)
        batch = np.atleast_2d(plain)
        memory, agent_state = state or (None, None)
        start = np.full(len(batch), memory is None)
        if episode_start is not None:
            start |= np.asarray(episode_start, bool)
        seen, memory = self.residual.observe(batch, memory, start)
        action, agent_state = self._agent.predict(seen, agent_state, start, deterministic)
        action, fitting = np.asarray(action, np.float32), (len(batch), self.residual.actions)
        require(action.shape == fitting, "the agent's action", action.shape, f"shape {fitting}")
        command, memory = self.residual.command(memory, action)
        return (command if plain.ndim == 2 else command[0]), (memory, agent_state)


def _made(base: str | Policy, nominal: Nominal) -> Policy:
    """The base policy, if only its name is given."""
    if not isinstance(base, str):
        return base
    named = contender(base)
    require(not named.privileged, "base", base, "a policy that is not given true state")
    return named.make(nominal)


def _task(env: Any) -> Residual:
    """The residual task of an environment, whatever it is wrapped in."""
    inner = env
    while not hasattr(inner, "residual") and hasattr(inner, "env"):
        inner = inner.env
    task = getattr(inner, "residual", inner)
    require(isinstance(task, Residual), "residual", env, "an environment of the residual task")
    assert isinstance(task, Residual)
    return task
