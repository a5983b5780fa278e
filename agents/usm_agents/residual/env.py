"""The residual task as an environment, for one robot and for many."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from usm_baselines.laws.super_twisting import SuperTwisting

from usm_agents.residual.observation import PLANAR_POSTURE, ResidualLayout, base_entries
from usm_agents.residual.task import Array, Flags, Memory, Residual
from usm_gym.envs.env import TrackingEnv, checked_action
from usm_gym.envs.head import HeadEnv, HeadVectorEnv
from usm_gym.envs.head3d import Head3DEnv, Head3DVectorEnv
from usm_gym.envs.usm import USMEnv, USMVectorEnv
from usm_gym.envs.usm3d import USM3DEnv, USM3DVectorEnv
from usm_gym.envs.vector_env import TrackingVectorEnv
from usm_gym.task.head_scenario import HeadScenario, SpatialHeadScenario
from usm_gym.task.modes import AnyMode, kind_of
from usm_gym.task.nominal import Nominal
from usm_gym.task.scenario import Scenario
from usm_gym.task.spatial_scenario import SpatialScenario


class ResidualEnv(gym.Wrapper[Array, Array, Array, Array], gym.utils.RecordConstructorArgs):
    """An environment in which a base policy acts and the agent corrects it.

    The base sees the plain observation, as it would alone. Base and residual are added and
    saturated once; what was applied is what the next observation reports, to the base's observer
    too. A residual of zero gives the base's episode bit for bit. Reward, start, end and info are
    the plain environment's.

    ## Action

    `Box(-1, 1)` in units of `residual_scale`. "force": force along the axes (N, global frame) on
    the centre of mass, without a moment, shared out to the thrusters with least norm. "wrench": the
    same with moments (N m) about the angles that are controlled. "thrusters": forces of the
    thrusters (N). "estimates": what is added to error, rate and disturbance in each axis, in units
    of the largest corrections; the base then acts after the agent, which is shown neither its force
    and moment nor its own last action. Where the head follows a path, also "head": what is added to
    the velocities wanted of it in each axis, and in the plane of its direction, in units of
    0.03 m/s and 0.1 rad/s; and "joints": rates of the joints in place of the base's, in units of
    a fifth of their limit. There "head" is the default.

    ## Observation

    `Box(float32)`: what the base knows, what the navigator estimates and the nominal plant
    foresees, and the joint motion in a few numbers; physical value over scale, cut off at its
    bound. In the plane, in `field` and on the base "sta":

    OBSERVATION_TABLE
    """

    def __init__(
        self,
        env: gym.Env[Array, Array],
        **residual: Any,
    ) -> None:
        """Wrap an environment.

        Args:
            env: A plain environment of this package.
            residual: Arguments of `Residual`: base, residual_scale, action, omit, frames,
                position_noise.

        Raises:
            ValueError: If the base is unknown or an argument not allowed.
        """
        gym.utils.RecordConstructorArgs.__init__(self, **residual)
        gym.Wrapper.__init__(self, env)
        self._plain: TrackingEnv = env.unwrapped  # type: ignore[assignment]
        # The agent's scales stay what they are when a scenario brings another noise.
        self._arguments = {"position_noise": self._plain.nominal.position_noise, **residual}
        self._residual = Residual(self._plain.nominal, **self._arguments)
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
        self._residual = _made_for(self._plain.nominal, self._residual, self._arguments)


# The class docstring is the specification; its table comes from the one that the code uses.
ResidualEnv.__doc__ = (ResidualEnv.__doc__ or "").replace(
    "OBSERVATION_TABLE",
    ResidualLayout(("x", "y"), 1, 5, 2, base_entries(SuperTwisting.shown, 2), PLANAR_POSTURE)
    .table()
    .replace("\n", "\n    "),
)


class ResidualVectorEnv(
    gym.vector.VectorWrapper,  # generic at run time only since Gymnasium 1.4
    gym.utils.RecordConstructorArgs,
):
    """The residual task of many robots; each behaves as in `ResidualEnv`, bit for bit."""

    def __init__(
        self,
        env: TrackingVectorEnv,
        **residual: Any,
    ) -> None:
        """Wrap a vector environment; arguments as of `ResidualEnv`."""
        gym.utils.RecordConstructorArgs.__init__(self, **residual)
        gym.vector.VectorWrapper.__init__(self, env)
        self._plain = env
        self._arguments = {"position_noise": env.nominal.position_noise, **residual}
        self._residual = Residual(env.nominal, **self._arguments)
        env.require_same_nominal()
        self.single_observation_space = self._residual.layout.space
        self.single_action_space = self._residual.action_space
        self.observation_space = batch_space(self.single_observation_space, env.num_envs)
        self.action_space = batch_space(self.single_action_space, env.num_envs)
        self._memory: Memory | None = None
        self._done = np.zeros(self.num_envs, bool)

    @property
    def residual(self) -> Residual:
        """What the task adds to the plain environment."""
        return self._residual

    @property
    def memory(self) -> Memory:
        """What the task keeps of the robots now."""
        if self._memory is None:
            raise gym.error.ResetNeeded("call reset() before anything else")
        return self._memory

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
            self._memory = _chosen(which, memory, self._memory)
        self._done = self._done & ~which
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
        memory = self.memory
        residual = checked_action(actions, (self.num_envs, self._residual.actions))
        command, memory = self._residual.command(memory, residual)
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


# The plain environments, of one robot and of many, by the class of their scenarios.
_PLAIN: dict[type, tuple[Any, Any]] = {
    Scenario: (USMEnv, USMVectorEnv),
    SpatialScenario: (USM3DEnv, USM3DVectorEnv),
    HeadScenario: (HeadEnv, HeadVectorEnv),
    SpatialHeadScenario: (Head3DEnv, Head3DVectorEnv),
}


def make_residual_env(
    mode: AnyMode,
    conditions: str | Mapping[str, Any] = "field",
    robot: Mapping[str, Any] | None = None,
    render_mode: str | None = None,
    **residual: Any,
) -> ResidualEnv:
    """Make the residual task of a mode; other arguments as of `Residual`."""
    single, _ = _PLAIN[kind_of(mode)]
    return ResidualEnv(single(mode, conditions, robot, render_mode), **residual)


def make_residual_vector_env(
    num_envs: int,
    mode: AnyMode,
    **arguments: Any,
) -> ResidualVectorEnv:
    """Make the residual task of many robots; arguments as of `USMVectorEnv` and `Residual`."""
    _, vector = _PLAIN[kind_of(mode)]
    names = list(inspect.signature(Residual).parameters)[1:]
    residual = {name: arguments.pop(name) for name in names if name in arguments}
    return ResidualVectorEnv(vector(num_envs, mode, **arguments), **residual)


def _made_for(nominal: Nominal, current: Residual, arguments: Mapping[str, Any]) -> Residual:
    # A scenario may bring a control period, noise or joint gains of its own.
    return current if current.nominal == nominal else Residual(nominal, **arguments)


def _chosen(which: Flags, new: Any, old: Any) -> Any:
    if isinstance(new, tuple):
        pairs = zip(new, old, strict=True)
        chosen = [_chosen(which, now, before) for now, before in pairs]
        return type(new)(*chosen) if hasattr(new, "_fields") else tuple(chosen)
    if old is None or isinstance(new, bool):  # a policy without state; what is the same for all
        return new
    return np.where(which.reshape(-1, *[1] * (new.ndim - 1)), new, old)
