"""The residual task: a learned correction of the thrust that a base policy commands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike, NDArray

from baselines.policy import Policy
from baselines.registry import make
from usm_gym.env import USMEnv, checked_action
from usm_gym.observation import ObservationLayout
from usm_gym.scenario import Mode
from usm_gym.validation import require

Array = NDArray[np.float32]

# The base's command is shown to the agent within this bound, in units of the thruster limit.
BASE_COMMAND_BOUND = 10.0


def residual_observation(observation: Array, base_action: Array) -> Array:
    """What the agent sees: the plain observation, then the base's command before saturation.

    Args:
        observation: Plain observations, (..., numbers).
        base_action: The base's thruster commands over the limit, (..., thrusters).
    """
    command = np.clip(base_action, -BASE_COMMAND_BOUND, BASE_COMMAND_BOUND)
    return np.concatenate([observation, command], axis=-1, dtype=np.float32)


def residual_space(layout: ObservationLayout) -> gym.Space[Array]:
    """The observation space of the residual task."""
    bound = np.full(layout.thrusters, BASE_COMMAND_BOUND, np.float32)
    high = np.concatenate([layout.bound, bound])
    return gym.spaces.Box(-high, high, dtype=np.float32)


def combine(
    observation: Array,
    base_action: Array,
    residual: Array,
    residual_scale: float,
    layout: ObservationLayout,
) -> Array:
    """The command sent to the thrusters: base plus residual, to be saturated once, by the plant.

    Args:
        observation: Plain observations, (..., numbers), which tell the thruster limit.
        base_action: The base's commands over the limit, not clipped, (..., thrusters).
        residual: The agent's action in [-1, 1], (..., thrusters).
        residual_scale: Largest residual, N.
        layout: Layout of the plain observation.
    """
    part = layout.slices["thruster_limit"]
    limit = observation[..., part].astype(np.float64) * layout.scale[part]
    share = np.clip(residual, -1.0, 1.0) * (residual_scale / limit)
    return (base_action + share).astype(np.float32)


class ResidualEnv(gym.Wrapper[Array, Array, Array, Array], gym.utils.RecordConstructorArgs):
    """An environment in which a base policy acts and the agent corrects it.

    The base sees the plain observation, as it would alone. The action, `Box(-1, 1)`, is a residual
    thruster force in units of `residual_scale`; base and residual are added, saturated once, and
    what was applied is what the next observation reports. A residual of zero gives the base's
    episode to the bit. The observation is the plain one followed by the base's command before
    saturation, in units of the thruster limit, clipped to +-10. Reward, start, end and info are the
    plain environment's.
    """

    def __init__(
        self, env: gym.Env[Array, Array], base: str | Policy = "sta", residual_scale: float = 6.0
    ) -> None:
        """Wrap an environment.

        Args:
            env: A plain environment of this package.
            base: The base policy, by id or itself.
            residual_scale: Largest residual force of a thruster, N.

        Raises:
            ValueError: If the base is unknown or the scale not positive.
        """
        gym.utils.RecordConstructorArgs.__init__(self, base=base, residual_scale=residual_scale)
        gym.Wrapper.__init__(self, env)
        require(
            np.isfinite(residual_scale) and residual_scale > 0,
            "residual_scale",
            residual_scale,
            "a force > 0 N",
        )
        self._plain: USMEnv = env.unwrapped  # type: ignore[assignment]
        self._scale = float(residual_scale)
        self._make_base = lambda: make(base, env) if isinstance(base, str) else base
        self._make_base()  # so that an unknown base is refused here
        self.observation_space = residual_space(self._plain.layout)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode of the plain environment and of the base."""
        observation, info = self.env.reset(seed=seed, options=options)
        # Made anew, because the scenario may have brought its own control period.
        self._base = self._make_base()
        self._state: Any = None
        return self._observe(observation, start=True), info

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Add a residual to the base's command for one control period."""
        residual = checked_action(action, self.action_space.shape or ())
        command = combine(
            self._observation, self._action, residual, self._scale, self._plain.layout
        )
        observation, reward, terminated, truncated, info = self.env.step(command)
        seen = self._observe(observation, start=False)
        return seen, float(reward), terminated, truncated, info

    def snapshot(self) -> tuple[Any, ...]:
        """Copy the whole state, the base's included."""
        return self._plain.snapshot(), self._observation, self._action, self._state

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Return to a snapshot."""
        plain, self._observation, self._action, self._state = snapshot
        self._plain.restore(plain)

    def _observe(self, observation: Array, start: bool) -> Array:
        self._observation = observation
        self._action, self._state = self._base.predict(
            observation, self._state, np.array([start]), deterministic=True
        )
        return residual_observation(observation, self._action)


class ResidualPolicy:
    """Base policy and agent as one policy of the plain environment.

    Attributes:
        privileged: Never, here.
    """

    privileged = False

    def __init__(
        self, base: Policy, agent: Policy, residual_scale: float, layout: ObservationLayout
    ) -> None:
        """Join the two.

        Args:
            base: The base policy.
            agent: What was trained on the residual task, with `predict`.
            residual_scale: Largest residual force of a thruster, N, as in training.
            layout: Layout of the plain observation.
        """
        self._base, self._agent = base, agent
        self._scale, self._layout = residual_scale, layout

    def predict(
        self,
        observation: ArrayLike,
        state: tuple[Any, Any] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[Array, tuple[Any, Any]]:
        """Act on one observation or a batch; see `ScriptedPolicy.predict`."""
        seen = np.asarray(observation, np.float32)
        base_state, agent_state = state or (None, None)
        action, base_state = self._base.predict(seen, base_state, episode_start, True)
        residual, agent_state = self._agent.predict(
            residual_observation(seen, action), agent_state, episode_start, deterministic
        )
        command = combine(seen, action, np.asarray(residual), self._scale, self._layout)
        return command, (base_state, agent_state)


def make_residual_env(
    mode: Mode,
    base: str = "sta",
    residual_scale: float = 6.0,
    conditions: str | Mapping[str, Any] = "field",
    robot: Mapping[str, Any] | None = None,
    render_mode: str | None = None,
) -> ResidualEnv:
    """Make the residual task of a mode; arguments as of `ResidualEnv` and `USMEnv`."""
    return ResidualEnv(USMEnv(mode, conditions, robot, render_mode), base, residual_scale)
