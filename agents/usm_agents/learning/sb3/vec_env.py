"""Stable-Baselines3's `VecEnv` over the native vector environment."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from usm_agents.residual.env import ResidualVectorEnv
from usm_gym.envs.vector_env import TrackingVectorEnv
from usm_gym.support.validation import require


class SB3VecEnv(VecEnv):
    """The robots of a vector environment, or of the residual task on one, for Stable-Baselines3.

    Episodes restart within the step that ends them. The info of a step that ends an episode has
    everything: the environment's own keys, `terminal_observation`, `TimeLimit.truncated`, and
    `episode` with return `r`, length `l` and wall time `t` as `Monitor` gives them; other infos are
    empty, which is what keeps hundreds of robots fast. All robots share one environment, whose
    attributes and methods `get_attr`, `set_attr` and `env_method` reach, beneath the residual task.
    """

    def __init__(
        self,
        envs: gym.vector.VectorEnv[Any, Any, Any],
        reward_scale: float = 1.0,
        variation_price: float = 0.0,
    ) -> None:
        """Take a vector environment made with `autoreset_mode="SameStep"`.

        Args:
            envs: The environment.
            reward_scale: Factor on the rewards of steps; the returns in infos are left as they are.
            variation_price: What is taken from the reward of a step for each N/s by which the
                commands change in it, as the score has it (`usm_gym.task.metrics`).

        Raises:
            ValueError: If it is of another package, or does not restart episodes within a step.
        """
        plain = envs.unwrapped
        require(
            isinstance(plain, TrackingVectorEnv)
            and isinstance(envs, (TrackingVectorEnv, ResidualVectorEnv)),
            "envs",
            envs,
            "a USMVectorEnv or USM3DVectorEnv, or a ResidualVectorEnv",
        )
        assert isinstance(plain, TrackingVectorEnv)
        require(
            plain.autoreset_mode is AutoresetMode.SAME_STEP,
            "autoreset_mode",
            plain.autoreset_mode.value,
            f"{AutoresetMode.SAME_STEP.value!r}",
        )
        self._envs: Any = envs
        self._plain = plain
        self._reward_scale, self._variation_price = reward_scale, variation_price
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)
        self._began = time.time()
        self._returns = np.zeros(self.num_envs)
        self._lengths = np.zeros(self.num_envs, np.int64)

    def reset(self) -> np.ndarray[Any, Any]:
        """Start all episodes, with the seeds of `seed` and the options of `set_options`, if any."""
        scenarios = [options.get("scenario") for options in self._options]
        seed = self._seeds if any(value is not None for value in self._seeds) else None
        observations, infos = self._envs.reset(seed=seed, options={"scenario": scenarios})
        self.reset_infos = [_info_of(infos, index) for index in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        self._returns[:] = 0.0
        self._lengths[:] = 0
        self._command = self._commanded()
        return np.asarray(observations)

    def step_async(self, actions: np.ndarray[Any, Any]) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(
        self,
    ) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any], np.ndarray[Any, Any], list[Any]]:
        """Advance all robots by one control period."""
        observations, rewards, terminated, truncated, infos = self._envs.step(self._actions)
        self._returns += rewards
        self._lengths += 1
        done = terminated | truncated
        robot_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for index in np.flatnonzero(done).tolist():
            robot_infos[index] = {
                **_info_of(infos["final_info"], index),
                "terminal_observation": infos["final_obs"][index],
                "TimeLimit.truncated": bool(truncated[index]),
                "episode": {
                    "r": float(self._returns[index]),
                    "l": int(self._lengths[index]),
                    "t": round(time.time() - self._began, 6),
                },
            }
        if self._variation_price > 0.0:
            free = done | (self._lengths == 1)
            rewards = rewards - self._variation_price * self._variation(free)
        self._returns[done] = 0.0
        self._lengths[done] = 0
        rewards = self._reward_scale * rewards
        return observations, rewards.astype(np.float32), done, robot_infos

    def _variation(self, free: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """How fast the commands of each robot change, N/s; 0 where that is free.

        It is free in the first step of an episode, in which every law begins to push, and in the
        last one, after which the command in effect is the next episode's.
        """
        before, self._command = self._command, self._commanded()
        period = self._plain.simulation.scenarios[0].conditions.control_period  # that of all
        change = np.abs(self._command - before).mean(axis=1) / period
        return np.where(free, 0.0, change)

    def _commanded(self) -> np.ndarray[Any, Any]:
        """The commands in effect, N, (robots, thrusters)."""
        simulation = self._plain.simulation
        place = simulation.layout.slices["thruster_command"]
        over_limit = simulation.observation[:, place] * simulation.layout.scale[place]
        return np.asarray(over_limit * simulation.limit[:, np.newaxis])

    def snapshot(self) -> tuple[Any, ...]:
        """Copy the whole state."""
        return self._envs.snapshot(), self._returns.copy(), self._lengths.copy(), self._command

    def restore(self, snapshot: tuple[Any, ...]) -> None:
        """Return to a snapshot."""
        envs, returns, lengths, self._command = snapshot
        self._envs.restore(envs)
        self._returns[:], self._lengths[:] = returns, lengths

    def close(self) -> None:
        """Close the environment."""
        self._envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The environment's attribute, once per robot asked for."""
        return [getattr(self._envs.unwrapped, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set the environment's attribute, which all robots share."""
        require(
            len(list(self._get_indices(indices))) == self.num_envs, "indices", indices, "all robots"
        )
        setattr(self._envs.unwrapped, attr_name, value)

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Call the environment's method once; its answer, once per robot asked for."""
        answer = getattr(self._envs.unwrapped, method_name)(*method_args, **method_kwargs)
        return [answer for _ in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Only in `Monitor`, whose information is here without it."""
        return [wrapper_class is Monitor for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[np.ndarray[Any, Any] | None]:
        """Images of all robots, or none without the render mode "rgb_array"."""
        return list(self._envs.render() or ())


def _info_of(infos: dict[str, Any], index: int) -> dict[str, Any]:
    return {
        key: values[index].item()
        for key, values in infos.items()
        if not key.startswith("_") and not key.startswith("final_")
    }
