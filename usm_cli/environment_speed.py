"""Measures environment steps through Gymnasium's own interface."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
from usm_baselines.registry import make

from usm_cli.speed import Timing, resting, still_water

OPERATION, OPERATION_3D = "usm_gym:USM-Operation-v0", "usm_gym:USM-Operation3D-v0"


def single_timing(name: str, steps: int) -> Timing:
    """Time steps of one robot in the environment that `gym.make` makes, random thrust."""
    scenario = resting(1, still_water("operation"))[0]
    return _loop(name, gym.make(OPERATION), steps, 1, {"scenario": scenario})


def swimming_timing(name: str, id: str, steps: int) -> Timing:
    """Time the same with a policy that decides in every step."""
    env = gym.make(OPERATION)
    policy = make(id, env)
    observation, _ = env.reset(seed=0)
    state: Any = None

    def run() -> None:
        nonlocal observation, state
        for _ in range(steps):
            action, state = policy.predict(observation, state)
            observation, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                observation, _ = env.reset()
                state = None

    return Timing(name, run, steps)


def vector_timing(name: str, size: int, steps: int, threads: int = 1) -> Timing:
    """Time whole steps of the vector environment, per robot, within episodes.

    `start_timing` times the starts of episodes, whose number depends on the policy.
    """
    envs = _vector_env(size, threads=threads)
    options = {"scenario": resting(size, still_water("operation"))}
    return _loop(name, envs, steps, size, options)


def spatial_vector_timing(name: str, size: int, steps: int) -> Timing:
    """Time the same of the vector environment in space."""
    envs = _vector_env(size, OPERATION_3D)
    options = {"scenario": resting(size, still_water("operation3d"), mode="operation3d")}
    return _loop(name, envs, steps, size, options)


def swimming_vector_timing(name: str, id: str, size: int, steps: int) -> Timing:
    """Time whole steps of the vector environment with a policy that decides, per robot."""
    envs = _vector_env(size, autoreset_mode="SameStep")
    policy = make(id, envs)
    observation, _ = envs.reset(seed=0)
    state: Any = None
    ended: Any = None

    def run() -> None:
        nonlocal observation, state, ended
        for _ in range(steps):
            action, state = policy.predict(observation, state, ended)
            observation, _, terminated, truncated, _ = envs.step(action)
            ended = terminated | truncated

    return Timing(name, run, size * steps)


def start_timing(name: str, size: int) -> Timing:
    """Time starts of episodes in the vector environment: draw, noise, first observation; us."""
    envs = _vector_env(size)
    envs.reset(seed=0)
    return Timing(name, envs.reset, size, 1e6)


def sync_timing(name: str, size: int, steps: int) -> Timing:
    """Time whole steps of Gymnasium's `SyncVectorEnv` of single environments."""
    envs = gym.make_vec(OPERATION, num_envs=size, vectorization_mode="sync")
    return _loop(name, envs, steps, size)


def cartpole_timing(name: str, size: int, steps: int) -> Timing:
    """Time Gymnasium's CartPole vector environment, per robot."""
    envs = gym.make_vec("CartPole-v1", num_envs=size, vectorization_mode="vector_entry_point")
    return _loop(name, envs, steps, size)


def swimmer_timing(name: str, steps: int) -> Timing:
    """Time Gymnasium's Swimmer-v5; raises `ImportError` or a Gymnasium error without MuJoCo."""
    return _loop(name, gym.make("Swimmer-v5"), steps, 1)


def _vector_env(size: int, id: str = OPERATION, **options: Any) -> Any:
    return gym.make_vec(id, num_envs=size, vectorization_mode="vector_entry_point", **options)


def _loop(
    name: str, env: Any, steps: int, size: int, options: dict[str, Any] | None = None
) -> Timing:
    env.reset(seed=0, options=options)
    env.action_space.seed(0)
    single = isinstance(env, gym.Env)
    # Random actions of mean zero, as at the start of a training.
    samples = [env.action_space.sample() for _ in range(10)]
    actions = samples if env.action_space.dtype.kind == "i" else [*samples, *(-a for a in samples)]

    def run() -> None:
        for k in range(steps):
            outcome = env.step(actions[k % len(actions)])
            if single and (outcome[2] or outcome[3]):
                env.reset(options=options)

    return Timing(name, run, size * steps)
