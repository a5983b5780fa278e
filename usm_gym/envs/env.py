"""The Gymnasium environment of one robot, in any world."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from functools import cache
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from usm_gym.policy import as_action
from usm_gym.rendering.viewer import Viewer
from usm_gym.simulation import Simulation, Snapshot
from usm_gym.support.validation import is_whole, require
from usm_gym.task.conditions import Conditions
from usm_gym.task.nominal import Nominal
from usm_gym.world import Sampler, World, world_of

Observation = NDArray[np.float32]


class TrackingEnv(gym.Env[Observation, NDArray[np.float32]]):
    """A robot whose position has to follow a reference; `usm_gym.envs.usm` has the paper's.

    Attributes:
        sampler: Where its scenarios come from.
        world: The world that it is in.
        layout: Table of the observation.
    """

    def __init__(self, sampler: Sampler, render_mode: str | None = None) -> None:
        """Make the environment; no random number is drawn before `reset`.

        Args:
            sampler: Where the scenarios come from.
            render_mode: "rgb_array" or "human"; None draws nothing.

        Raises:
            ValueError: If the render mode is not allowed.
        """
        self.sampler = sampler
        self.world = world_of(sampler.body)
        self.layout = self.world.layout
        self.observation_space = self.layout.space
        self.action_space = action_space(self.world)
        self.metadata = {**self.metadata, "render_fps": render_fps(sampler.conditions)}
        self.render_mode = render_mode
        self._viewer = None if render_mode is None else Viewer(sampler.body, render_mode)
        self._simulation: Simulation | None = None
        self._over = False

    @property
    def nominal(self) -> Nominal:
        """What a controller may know beforehand."""
        if self._simulation is None:
            return self.sampler.nominal
        nominal: Nominal = self.scenario.nominal
        return nominal

    @property
    def scenario(self) -> Any:
        """The scenario in progress."""
        return self._running.scenarios[0]

    @property
    def simulation(self) -> Simulation:
        """The simulation, of one robot: for drawing and for privileged planners."""
        return self._running

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode; see the class for `options`.

        Raises:
            ValueError: If the seed, an option or a scenario is unknown or not valid; the
                environment is then left as it was.
        """
        seed = checked_seed(seed)
        # A copy of the stream, so that a reset that is refused leaves everything as it was.
        stream = copy.deepcopy(self.np_random) if seed is None else seeding.np_random(seed)[0]
        scenario = scenario_of(self.sampler, options, stream)
        self._simulation = Simulation([scenario])
        super().reset(seed=seed)
        self.np_random.bit_generator.state = stream.bit_generator.state
        self._over = False
        if self._viewer is not None:
            self._viewer.follow(self._simulation)
        return self._simulation.observation[0].copy(), self._info()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold the thruster commands for one control period.

        Raises:
            ValueError: If the action has the wrong shape or a NaN in it.
            gymnasium.error.ResetNeeded: If the episode is over.
        """
        simulation = self._running
        if self._over:
            raise gym.error.ResetNeeded("the episode is over: call reset()")
        batch = checked_action(action, (self.world.actions,))[np.newaxis]
        simulation.step(batch)
        rewards, terminated, truncated = outcome(simulation)
        self._over = bool(terminated[0] or truncated[0])
        if self._viewer is not None:
            self._viewer.follow(simulation)
        return (
            simulation.observation[0].copy(),
            float(rewards[0]),
            bool(terminated[0]),
            bool(truncated[0]),
            self._info(),
        )

    def render(self) -> NDArray[np.uint8] | None:
        """An image of the present, (480, 640, 3), in the mode "rgb_array"; otherwise None.

        Raises:
            gymnasium.error.DependencyNotInstalled: Without the extra `render`.
        """
        images = None if self._viewer is None else self._viewer.render(self._running)
        return None if images is None else images[0]

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._viewer is not None:
            self._viewer.close()

    def snapshot(self) -> Snapshot:
        """Copy the whole simulation state."""
        return self._running.snapshot()

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a snapshot; equal actions then have equal consequences, bit for bit."""
        self._simulation = Simulation(snapshot.scenarios)
        self._simulation.restore(snapshot)
        _, terminated, truncated = outcome(self._simulation)
        self._over = bool(terminated[0] or truncated[0])

    @property
    def _running(self) -> Simulation:
        if self._simulation is None:
            raise gym.error.ResetNeeded("call reset() before anything else")
        return self._simulation

    def _info(self) -> dict[str, Any]:
        return {key: values[0] for key, values in infos(self._running).items()}


def render_fps(conditions: Conditions) -> int:
    """Frames per second at which one frame per control period is real time."""
    return max(1, round(1 / conditions.control_period))


def action_space(world: World) -> gym.Space[NDArray[np.float32]]:
    """The action space of a world."""
    return gym.spaces.Box(-1.0, 1.0, (world.actions,), np.float32)


def checked_action(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """The action as float32; the plant saturates it.

    Raises:
        ValueError: If it is no array of real numbers of that shape, or has a NaN.
    """
    array = as_action(action, shape)
    require(not np.isnan(array).any(), "action", action, "numbers, not NaN")
    return array


def checked_seed(seed: Any) -> int | None:
    """A seed as Python's integer, or None where there is none.

    Raises:
        ValueError: If it is neither.
    """
    require(seed is None or is_whole(seed, 0), "seed", seed, "None or an integer from 0 on")
    return None if seed is None else int(seed)


def scenario_of(
    sampler: Sampler, options: Mapping[str, Any] | None, stream: np.random.Generator
) -> Any:
    """The scenario that reset options ask for; without any, one drawn from the stream.

    Raises:
        ValueError: If an option is unknown, or the scenario not one of the sampler's.
    """
    options = {} if options is None else options
    known = isinstance(options, Mapping) and set(options) <= {"scenario"}
    require(known, "options", options, "a dict with the key scenario")
    wanted = options.get("scenario")
    if wanted is None:
        return sampler.draw(stream)
    scenario = sampler.choose(wanted)
    allowed = "one of the environment's robot"
    require(getattr(scenario, "body", None) == sampler.body, "scenario", wanted, allowed)
    return scenario


def outcome(
    simulation: Simulation,
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Rewards, terminations and truncations of the step just made, (size,) each."""
    world, lost = simulation.world, simulation.lost
    remaining = simulation.steps - simulation.count
    rewards = world.reward(
        simulation.error, simulation.attitude_error, simulation.effort, simulation.limit
    )
    if lost.any():
        rewards[lost] = world.reward_of_loss(remaining[lost])
    return rewards, lost.copy(), (remaining <= 0) & ~lost


@cache
def info_keys(axes: tuple[str, ...], attitude: tuple[str, ...]) -> tuple[str, ...]:
    """The keys of an info."""
    errors = [f"{kind}_{axis}" for kind in ("error", "max_error") for axis in axes]
    return (*errors, *(f"{angle}_error" for angle in attitude), "thrust_effort", "diverged")


def infos(simulation: Simulation) -> dict[str, NDArray[Any]]:
    """The info of every robot: float64, (size,), some of them views of the simulation's."""
    arrays = (simulation.error, simulation.max_error, simulation.attitude_error)
    values = [array[:, k] for array in arrays for k in range(array.shape[1])]
    values += (simulation.effort, simulation.lost.astype(np.float64))
    world = simulation.world
    keys = info_keys(world.axes, world.attitude + world.watched)
    return dict(zip(keys, values, strict=True))
