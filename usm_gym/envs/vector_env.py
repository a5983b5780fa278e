"""The native vector environment: many robots in one simulation, in any world."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from usm_gym.envs.env import (
    action_space,
    checked_action,
    checked_seed,
    infos,
    outcome,
    render_fps,
    scenario_of,
)
from usm_gym.rendering.viewer import Viewer
from usm_gym.simulation import Simulation, Snapshot
from usm_gym.support.validation import is_whole, require
from usm_gym.task.nominal import Nominal, shared_nominal
from usm_gym.world import Sampler, world_of

Observations = NDArray[np.float32]
Flags = NDArray[np.bool_]

# Of the paper's robot, so many take half a gigabyte.
MOST_ROBOTS = 100_000


@dataclass(frozen=True)
class VectorSnapshot:
    """A copy of everything that changes in a vector environment.

    Attributes:
        simulation: The robots.
        streams: States of the streams from which each robot's scenarios are drawn.
        done: Which episodes have ended and wait for their reset.
    """

    simulation: Snapshot
    streams: tuple[Any, ...]
    done: Flags


class TrackingVectorEnv(gym.vector.VectorEnv[Observations, NDArray[np.float32], Any]):
    """`num_envs` robots, each as in `TrackingEnv`, with the same bits.

    Attributes:
        sampler: Where their scenarios come from.
        world: The world that they are in.
        layout: Table of the observation.
        threads: How many threads share a step.
        autoreset_mode: What happens to a robot whose episode has ended.
    """

    # Until Gymnasium 1.4, an environment is closed even if its constructor has failed.
    _viewer: Viewer | None = None

    def __init__(
        self,
        num_envs: int,
        sampler: Sampler,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int = 1,
        render_mode: str | None = None,
        render_index: int = 0,
    ) -> None:
        """Make the environment.

        Args:
            num_envs: How many robots.
            sampler: Where the scenarios come from.
            autoreset_mode: What happens to a robot whose episode has ended.
            threads: How many threads share a step, at most one per core; without effect on its
                result.
            render_mode: "rgb_array" gives images of all robots, "human" shows one robot in a
                window; None draws nothing.
            render_index: Which robot the window shows.

        Raises:
            ValueError: If an argument is not allowed.
        """
        allowed = f"1 to {MOST_ROBOTS}"
        require(is_whole(num_envs, 1, MOST_ROBOTS), "num_envs", num_envs, allowed)
        last = num_envs - 1
        require(is_whole(render_index, 0, last), "render_index", render_index, f"0 to {last}")
        require(is_whole(threads, 1), "threads", threads, "1 or more")
        modes = [mode.value for mode in AutoresetMode]
        known = isinstance(autoreset_mode, AutoresetMode) or autoreset_mode in modes
        require(known, "autoreset_mode", autoreset_mode, ", ".join(modes))
        self.num_envs = num_envs
        self.sampler = sampler
        self.threads = threads
        self.world = world_of(sampler.body)
        self.layout = self.world.layout
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            **self.metadata,
            "render_fps": render_fps(sampler.conditions),
            "autoreset_mode": self.autoreset_mode,
        }
        self.render_mode = render_mode
        if render_mode is not None:
            self._viewer = Viewer(sampler.body, render_mode, num_envs, render_index)
        self.single_observation_space = self.layout.space
        self.single_action_space = action_space(self.world)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._streams: list[np.random.Generator] = []
        self._simulation: Simulation | None = None
        self._done = np.zeros(num_envs, bool)
        self._same_nominal = False

    @property
    def nominal(self) -> Nominal:
        """What a controller may know beforehand, the same of all robots.

        Raises:
            ValueError: If the robots' scenarios do not agree in it.
        """
        if self._simulation is None:
            return self.sampler.nominal
        return shared_nominal(self._simulation.scenarios)

    @property
    def simulation(self) -> Simulation:
        """The simulation of all robots."""
        if self._simulation is None:
            raise gym.error.ResetNeeded("call reset() before anything else")
        return self._simulation

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Start the episodes of all robots, or of those in `options["reset_mask"]`.

        Raises:
            ValueError: If a seed, an option or a scenario is not valid; the environment is then
                left as it was.
        """
        valid = options is None or isinstance(options, Mapping)
        require(valid, "options", options, "a dict with the keys scenario and reset_mask")
        options = dict(options or {})
        which = self._mask(options.pop("reset_mask", None))
        streams = self._seeded(seed, which)
        indices = np.flatnonzero(which).tolist()
        scenarios = {i: self._draw(streams[i], self._options_of(i, options)) for i in indices}
        if self._same_nominal:
            kept = {} if which.all() else dict(enumerate(self.simulation.scenarios))
            shared_nominal((kept | scenarios).values())
        if which.all():
            ordered = [scenarios[i] for i in indices]
            self._simulation = Simulation(ordered, self.threads)
        else:
            for scenario in scenarios.values():
                self.simulation.check(scenario)
            for index, scenario in scenarios.items():
                self.simulation.start(index, scenario)
        self._streams = streams
        self._done[which] = False
        self._follow()
        return self.simulation.observation.copy(), self._infos(which)

    def step(
        self, actions: NDArray[np.float32]
    ) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Hold the thruster commands of all robots for one control period.

        Raises:
            ValueError: If the actions have the wrong shape or a NaN in them.
            gymnasium.error.ResetNeeded: If, without autoreset, an episode has ended.
        """
        simulation = self.simulation
        batch = checked_action(actions, (self.num_envs, self.world.actions))
        waiting = self._done.copy()
        if self.autoreset_mode is AutoresetMode.DISABLED and waiting.any():
            raise gym.error.ResetNeeded(f"robots {np.flatnonzero(waiting).tolist()} wait for reset")
        simulation.step(batch)
        if waiting.any():
            # Next-step autoreset: these robots' step is their reset, their action is ignored.
            self._restart(waiting)
        rewards, terminated, truncated = outcome(simulation)
        rewards[waiting] = 0.0
        done = terminated | truncated
        final: dict[str, Any] = {}
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            self._done = done
        elif done.any():
            final = self._final(done)
            self._restart(done)
        self._follow()
        told = {**final, **self._infos(np.ones(self.num_envs, bool))}
        return simulation.observation.copy(), rewards, terminated, truncated, told

    def require_same_nominal(self) -> None:
        """From now on, refuse scenarios that would give robots different nominal knowledge."""
        self._same_nominal = True

    def truth(self) -> dict[str, NDArray[np.float64]]:
        """True parameters and signals of all robots, for training; no policy is given them.

        Returns:
            What `World.truth` returns; the position's `error`, m, and `velocity`, m/s, (robots,
            axes).
        """
        simulation = self.simulation
        known = {"error": simulation.error.copy(), "velocity": simulation.velocity}
        return simulation.world.truth(simulation.read) | known

    def snapshot(self) -> VectorSnapshot:
        """Copy the whole state, the streams from which scenarios are drawn included."""
        streams = tuple(stream.bit_generator.state for stream in self._streams)
        return VectorSnapshot(self.simulation.snapshot(), streams, self._done.copy())

    def restore(self, snapshot: VectorSnapshot) -> None:
        """Return to a snapshot; equal actions then have equal consequences, bit for bit."""
        self._simulation = Simulation(snapshot.simulation.scenarios, self.threads)
        self._simulation.restore(snapshot.simulation)
        self._streams = [seeding.np_random(0)[0] for _ in snapshot.streams]
        for stream, state in zip(self._streams, snapshot.streams, strict=True):
            stream.bit_generator.state = state
        self._done = snapshot.done.copy()

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """Images of all robots, (480, 640, 3), in the mode "rgb_array"; otherwise None.

        An image takes 0.9 MB, and every call draws anew.

        Raises:
            gymnasium.error.DependencyNotInstalled: Without the extra `render`.
        """
        return None if self._viewer is None else self._viewer.render(self.simulation)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()

    def _follow(self) -> None:
        if self._viewer is not None:
            self._viewer.follow(self.simulation)

    def _restart(self, which: Flags) -> None:
        for index in np.flatnonzero(which).tolist():
            scenario = self._draw(self._streams[index], {})
            if self._same_nominal:
                shared_nominal((self.simulation.scenarios[index], scenario))
            self.simulation.start(index, scenario)

    def _draw(self, stream: np.random.Generator, options: Mapping[str, Any]) -> Any:
        return scenario_of(self.sampler, options, stream)

    def _seeded(
        self, seed: int | Sequence[int | None] | None, which: Flags
    ) -> list[np.random.Generator]:
        """The streams of all robots after a reset of some of them; those in use stay untouched."""
        seeds = self._seeds(seed)
        if not self._streams:
            require(which.all(), "reset_mask", which, "all robots at the first reset")
            return [seeding.np_random(robot_seed)[0] for robot_seed in seeds]
        streams = list(self._streams)
        for index in np.flatnonzero(which).tolist():
            again = seeds[index] is None
            streams[index] = (
                copy.deepcopy(streams[index]) if again else seeding.np_random(seeds[index])[0]
            )
        return streams

    def _seeds(self, seed: Any) -> list[int | None]:
        if isinstance(seed, (list, tuple)) or (isinstance(seed, np.ndarray) and seed.ndim):
            require(len(seed) == self.num_envs, "seed", seed, f"{self.num_envs} seeds")
            return [checked_seed(robot_seed) for robot_seed in seed]
        first = checked_seed(seed)
        return [None if first is None else first + i for i in range(self.num_envs)]

    def _mask(self, mask: Any) -> Flags:
        if mask is None:
            return np.ones(self.num_envs, bool)
        valid = (
            isinstance(mask, np.ndarray)
            and mask.shape == (self.num_envs,)
            and mask.dtype == np.bool_
            and mask.any()
        )
        require(
            valid, "reset_mask", mask, f"a bool array of shape ({self.num_envs},), not all False"
        )
        return np.asarray(mask, bool)

    def _options_of(self, index: int, options: Mapping[str, Any]) -> dict[str, Any]:
        scenario = options.get("scenario")
        if not isinstance(scenario, (list, tuple)):
            return dict(options)
        require(
            len(scenario) == self.num_envs,
            "scenario",
            scenario,
            f"a list of {self.num_envs} scenarios",
        )
        return {**options, "scenario": scenario[index]}

    def _infos(self, which: Flags) -> dict[str, Any]:
        vector: dict[str, Any] = {}
        for key, values in infos(self.simulation).items():
            vector[key] = values * which
            vector[f"_{key}"] = which
        return vector

    def _final(self, done: Flags) -> dict[str, Any]:
        observations = np.full(self.num_envs, None, dtype=object)
        for index in np.flatnonzero(done).tolist():
            observations[index] = self.simulation.observation[index].copy()
        return {
            "final_obs": observations,
            "_final_obs": done,
            "final_info": self._infos(done),
            "_final_info": done,
        }
