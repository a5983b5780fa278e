"""The Gymnasium environments of one robot."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from usm_gym.rendering.viewer import RENDER_MODES, Viewer
from usm_gym.robot import Robot, robot_of
from usm_gym.simulation import Simulation, Snapshot
from usm_gym.support.validation import is_whole, real_array, require
from usm_gym.task.conditions import Conditions, conditions_of
from usm_gym.task.nominal import Nominal, nominal_of
from usm_gym.task.observation import ObservationLayout
from usm_gym.task.reward import reward, reward_of_loss
from usm_gym.task.scenario import Mode, Scenario, mode_of, named, sample

Observation = NDArray[np.float32]


class USMEnv(gym.Env[Observation, NDArray[np.float32]]):
    """An underwater swimming manipulator whose centre of mass has to follow a path.

    Sixteen links, five thrusters. The thrusters hold the centre of mass on a slow path; in
    operation mode (`usm_gym:USM-Operation-v0`) the joints meanwhile bend the head side of the body
    one way, the other way and back, at about 10, 20 and 30 s, and so disturb it; in torpedo mode
    (`usm_gym:USM-Torpedo-v0`) the body is straight, the path faster, and the heading follows the
    line of sight. The score of an episode is the largest true position error in each axis after
    settling.

    ## Action

    `Box(-1, 1, (5,), float32)`: commands of the thrusters over their limit (20 N in "field");
    values beyond saturate, a wrong shape or a value that is not a number raises `ValueError`.

    | index | thruster | positive force |
    |---|---|---|
    | 0 | link 1 (tail), along the link | towards the head |
    | 1 | link 3, across | to the left of the link |
    | 2 | link 6, across | to the left |
    | 3 | link 11, across | to the left |
    | 4 | link 14 (head side), across | to the left |

    ## Observation

    `Box(float32)` of 90 numbers, the same in both modes: physical value over scale. Every error is
    actual minus reference. Angles are never wrapped. The true velocity of the centre of mass, the
    current and the true coefficients are not observed.

    OBSERVATION_TABLE

    ## Reward

    r = -10 mean_axes |e| / (|e| + 0.02 m) - 0.1 mean_thrusters |command| / limit, with the true
    position error e after the step. The step that loses the robot costs -10.1 for itself and for
    every step that remains, so that ending early never pays.

    ## Start

    Straight, at rest, on the reference. `reset(seed=...)` draws a scenario of the mode from
    `env.np_random`. `reset(options={"scenario": s})` takes s = "nominal" or "table1", under the
    environment's conditions, or a `Scenario` or its dict, which brings its own.

    ## End

    Truncation at the scenario's duration (40 s, 2000 steps). Termination when the robot is lost:
    the true error exceeds 0.5 m in an axis, or the state is no longer finite; the observation is
    finite all the same.

    ## Info, at every step

    | key | unit | meaning |
    |---|---|---|
    | `error_x`, `error_y` | m | true position error |
    | `max_error_x`, `max_error_y` | m | its largest absolute value since settling; 0 before |
    | `heading_error` | rad | heading minus its reference, as known on board |
    | `thrust_effort` | N | mean absolute command of the thrusters |
    | `diverged` | 0 or 1 | whether the robot is lost |

    All values are `numpy.float64`, which is a `float`, so that JSON takes them.

    ## Arguments

    | argument | default | meaning |
    |---|---|---|
    | `conditions` | `"field"` | `"ideal"`, `"field"`, `"rough"`, or a dict of `Conditions` fields |
    | `robot` | the paper's | a dict of `Robot` fields |
    | `render_mode` | None | `"rgb_array"`: `render()` gives an image of 640 x 480; `"human"`: a \
window shows every step in real time (drawing needs the extra `render`) |

    ## Version history

    - v0: first version.
    """

    # One frame for each control period; an instance corrects the rate if it has another period.
    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 50}  # noqa: RUF012 (Gymnasium's)

    def __init__(
        self,
        mode: Mode,
        conditions: str | Mapping[str, Any] | Conditions = "field",
        robot: Mapping[str, Any] | Robot | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Make the environment; no random number is drawn before `reset`.

        Raises:
            ValueError: If a condition, a field of the robot or the render mode is not allowed.
        """
        self.mode: Mode = mode_of(mode)
        self.conditions = conditions_of(conditions)
        self.robot = robot_of(robot)
        self.render_mode = render_mode
        self.metadata = {**self.metadata, "render_fps": render_fps(self.conditions)}
        self._viewer = None if render_mode is None else Viewer(render_mode)
        self.layout = ObservationLayout(self.robot.links, len(self.robot.thrusters))
        self.observation_space = self.layout.space
        self.action_space = action_space(self.robot)
        self._simulation: Simulation | None = None
        self._over = False

    @property
    def nominal(self) -> Nominal:
        """What a controller may know beforehand."""
        scenario = named("nominal", self.mode, self.conditions)
        if self._simulation is not None:
            scenario = self.scenario
        return nominal_of(self.robot, scenario)

    @property
    def scenario(self) -> Scenario:
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
        scenario = scenario_of(options, self.mode, self.conditions, self.robot, stream)
        self._simulation = Simulation(self.robot, [scenario])
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
        batch = checked_action(action, (len(self.robot.thrusters),))[np.newaxis]
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
        """Return to a snapshot; equal actions then have equal consequences, to the bit."""
        self._simulation = Simulation(self.robot, snapshot.scenarios)
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


# The class docstring is the specification; its table comes from the one that the code uses.
USMEnv.__doc__ = (USMEnv.__doc__ or "").replace(
    "OBSERVATION_TABLE", ObservationLayout(16, 5).table().replace("\n", "\n    ")
)


def render_fps(conditions: Conditions) -> int:
    """Frames per second at which one frame per control period is real time."""
    return max(1, round(1 / conditions.control_period))


def action_space(robot: Robot) -> gym.Space[NDArray[np.float32]]:
    """The action space of a robot."""
    return gym.spaces.Box(-1.0, 1.0, (len(robot.thrusters),), np.float32)


def checked_action(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """The action as float32 in [-1, 1], or an error that says what is wrong with it."""
    array = saturated(action, shape)
    require(not np.isnan(array).any(), "action", action, "numbers, not NaN")
    return array


def saturated(action: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """The action as float32 in [-1, 1]; a NaN stays one.

    Raises:
        ValueError: If it is no array of real numbers of that shape.
    """
    array = real_array("action", action)
    require(array.shape == shape, "the action's shape", array.shape, f"{shape}")
    return np.asarray(array.clip(-1.0, 1.0), np.float32)


def checked_seed(seed: Any) -> int | None:
    """A seed as Python's integer, or None where there is none.

    Raises:
        ValueError: If it is neither.
    """
    require(seed is None or is_whole(seed, 0), "seed", seed, "None or an integer from 0 on")
    return None if seed is None else int(seed)


def scenario_of(
    options: Mapping[str, Any] | None,
    mode: Mode,
    conditions: Conditions,
    robot: Robot,
    stream: np.random.Generator,
) -> Scenario:
    """The scenario that reset options ask for; without any, one drawn from the stream."""
    options = {} if options is None else options
    known = isinstance(options, Mapping) and set(options) <= {"scenario"}
    require(known, "options", options, "a dict with the key scenario")
    wanted = options.get("scenario")
    if wanted is None:
        return sample(mode, conditions, stream, robot.links - 1)
    if isinstance(wanted, str):
        return named(wanted, mode, conditions, robot.links - 1)
    scenario = wanted if isinstance(wanted, Scenario) else Scenario.from_dict(wanted)
    require(scenario.mode == mode, "the scenario's mode", scenario.mode, repr(mode))
    return scenario


def outcome(
    simulation: Simulation,
) -> tuple[NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Rewards, terminations and truncations of the step just made, (size,) each."""
    remaining = simulation.steps - simulation.count
    lost = simulation.lost
    rewards = reward(simulation.error, simulation.effort, simulation.limit)
    if lost.any():
        rewards[lost] = reward_of_loss(remaining[lost])
    return rewards, lost.copy(), (remaining <= 0) & ~lost


def infos(simulation: Simulation) -> dict[str, NDArray[Any]]:
    """The info of every robot: float64, (size,), some of them views of the simulation's."""
    return {
        "error_x": simulation.error[:, 0],
        "error_y": simulation.error[:, 1],
        "max_error_x": simulation.max_error[:, 0],
        "max_error_y": simulation.max_error[:, 1],
        "heading_error": simulation.heading_error,
        "thrust_effort": simulation.effort,
        "diverged": simulation.lost.astype(np.float64),
    }
