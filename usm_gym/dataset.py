"""Datasets of episodes in Minari's format, for offline learning (extra `datasets`)."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from usm_gym.envs.env import TrackingEnv, infos, outcome
from usm_gym.evaluation import rollout
from usm_gym.policy import as_action, is_privileged, nominal_of
from usm_gym.simulation import Simulation
from usm_gym.support.files import holding, move_folder, remove_folder
from usm_gym.support.seeding import RECORDING, stream
from usm_gym.support.validation import UsageError, brief, require

# What a disk must have left after episodes are written, bytes: HDF5 crashes when it is full.
SPARE = 2**26


def reset_seeds(seed: int, episodes: int) -> list[int]:
    """Seeds with which `env.reset` starts the episodes of a dataset.

    Their scenarios are met in no training, tuning or evaluation, and are in no frozen suite.
    """
    return [int(stream(seed, RECORDING, i).integers(2**63)) for i in range(episodes)]


def record(
    policy: Any,
    env: TrackingEnv,
    seeds: Sequence[int],
    progress: Callable[[float], None] = lambda episodes: None,
) -> list[Any]:
    """Let a policy act in the episodes that `env.reset` starts with some seeds.

    The episodes run side by side, with the bits that `env` has. Observations, rewards and infos are
    the environment's, actions are clipped to its action space.

    Args:
        policy: As for `usm_gym.evaluate`.
        env: The environment.
        seeds: The seeds, one per episode.
        progress: As for `usm_gym.evaluate`.

    Returns:
        The episodes as `minari.data_collector.EpisodeBuffer`, in the order of the seeds.

    Raises:
        ValueError: If the policy returns what is no action.
    """
    scenarios = []
    for seed in seeds:
        env.reset(seed=seed)
        scenarios.append(env.scenario)
    recorder = _Recorder(policy)
    trajectories = rollout(recorder, scenarios, progress, recorder.watch)
    lengths = [len(trajectory.time) for trajectory in trajectories]
    return [recorder.episode(*each) for each in zip(range(len(seeds)), seeds, lengths, strict=True)]


@contextmanager
def new_dataset(
    name: str, env: gym.Env[Any, Any], about: Mapping[str, Any]
) -> Iterator[Callable[[Sequence[Any]], None]]:
    """Give a function that adds episodes to a new dataset.

    Minari finds the dataset when the block has ended. Whatever interrupts the block leaves none.

    Args:
        name: Its id, such as usm/operation/sta-v0.
        env: The environment of its episodes, made by `gym.make`.
        about: What else its metadata say, in JSON's types.

    Raises:
        ValueError: If the id is none, or there is a dataset of that id.
        OSError: If it cannot be written, also in the block.
    """
    import minari
    from minari.dataset.minari_storage import MinariStorage
    from minari.namespace import create_namespace, list_local_namespaces
    from minari.storage.datasets_root_dir import get_dataset_path

    namespace = _namespace(name)
    target = get_dataset_path(name)
    # Minari looks into no folder whose name begins with a dot.
    flat = get_dataset_path(name.replace("/", "."))
    part = flat.with_name(f".{flat.name}.part")
    with holding(flat):
        require(not (target / "data").exists(), "dataset", name, f"a new one; {target} is there")
        remove_folder(part)
        try:
            storage = MinariStorage.new(
                part, env.observation_space, env.action_space, env.spec, data_format="hdf5"
            )
            known = {"dataset_id": name, "minari_version": minari.__version__}
            storage.update_metadata(known | dict(about))
            yield partial(_add, storage)
            if namespace is not None and namespace not in list_local_namespaces():
                create_namespace(namespace)
            target.mkdir(exist_ok=True)
            move_folder(part, target / "data")
        finally:
            remove_folder(part)


def _namespace(name: str) -> str | None:
    """The namespace in a dataset's id; None if it has none.

    Raises:
        ValueError: If it is no id.
    """
    from minari.dataset.minari_dataset import parse_dataset_id

    try:
        namespace: str | None = parse_dataset_id(name)[0]
    except (TypeError, ValueError) as error:  # the former without a version
        allowed = "NAME-vN or NAMESPACE/NAME-vN, such as usm/operation/sta-v0"
        raise UsageError(f"dataset is {brief(name)}; allowed: {allowed}") from error
    return namespace


def _add(storage: Any, episodes: Sequence[Any]) -> None:
    room = shutil.disk_usage(storage.data_path).free
    if room < SPARE + 2 * sum(map(_size, episodes)):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(storage.data_path))
    storage.update_episodes(episodes)


def _size(episode: Any) -> int:
    """What the arrays of an episode take, bytes, without the smallest."""
    arrays = (episode.observations, episode.actions, *episode.infos.values())
    return sum(array.nbytes for array in arrays)


class _Recorder:
    """A policy whose actions are taken down, and what follows from them.

    Attributes:
        nominal: Nominal knowledge of the policy, if it keeps one.
        privileged: Whether it has to be given true state.
    """

    def __init__(self, policy: Any) -> None:
        self.nominal = nominal_of(policy)
        self.privileged = is_privileged(policy)
        self._policy = policy
        self._answer: Any = None
        # One entry per control instant, and per control period, with a row per episode.
        self._observations: list[NDArray[np.float32]] = []
        self._infos: list[dict[str, NDArray[np.float64]]] = []
        self._actions: list[NDArray[np.float32]] = []
        self._outcomes: list[tuple[NDArray[Any], ...]] = []

    def predict(self, *arguments: Any, **options: Any) -> Any:
        """Let the policy answer."""
        self._answer = self._policy.predict(*arguments, **options)
        return self._answer

    def watch(self, simulation: Simulation) -> None:
        """Take down a control instant."""
        self._observations.append(simulation.observation.copy())
        self._infos.append({key: values.copy() for key, values in infos(simulation).items()})
        if self._answer is not None:
            action = as_action(self._answer[0], (simulation.size, simulation.world.actions))
            self._actions.append(np.clip(action, -1.0, 1.0))
            self._outcomes.append(outcome(simulation))

    def episode(self, index: int, seed: int, length: int) -> Any:
        """One of the episodes, up to its end."""
        from minari.data_collector import EpisodeBuffer

        def of(rows: Sequence[Any]) -> NDArray[Any]:
            return np.array([row[index] for row in rows])

        told = self._infos[: length + 1]
        rewards, terminations, truncations = map(of, zip(*self._outcomes[:length], strict=True))
        return EpisodeBuffer(
            seed=seed,
            observations=of(self._observations[: length + 1]),
            actions=of(self._actions[:length]),
            rewards=rewards,
            terminations=terminations,
            truncations=truncations,
            infos={key: of([info[key] for info in told]) for key in told[0]},
        )
