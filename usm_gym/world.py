"""The seam between body and task: what a simulation drives, and from what laws are made.

A world joins one body, one task and its sensors. It says in which axes errors are measured and how
many numbers describe a robot, writes a scenario into these, and has the compiled entry points that
advance them. `usm_gym.planar_world` is the one of the paper's robot; docs/layout.md says how to add
another.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from functools import singledispatch
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from usm_gym.sensors import Layout
from usm_gym.task.conditions import Conditions
from usm_gym.task.loss import LOST_ERROR, find_lost
from usm_gym.task.nominal import Nominal
from usm_gym.task.reward import reward, reward_of_loss
from usm_gym.task.sensing import Sensing

Array = NDArray[np.float64]


class Fleet(NamedTuple):
    """The robots that are simulated side by side, `size` of them in blocks of `lanes`.

    Attributes:
        blocks: Numbers of all robots, (blocks, rows * lanes); a row holds one number
            for every robot of the block.
        instant: Control periods since the start, int64, (size,).
        steps: Control periods of the episode, after which nothing is drawn, int64, (size,).
        taken: At which control instant the position and the velocity that are known at an instant
            were measured, int32, (size, control instants, 2); -1 where nothing measures it.
        noise: Errors of positions that are measured at an instant, m, (size, control instants,
            axes).
        other_noise: The same of velocities, angles and rates, float32, see
            `usm_gym.task.sensing.Sensing`, (size, control instants, numbers).
        past: True position errors, m, and velocities, m/s, of the last control instants, (size,
            instants, 2 axes): those of instant i at i modulo their number, which is larger than the
            age of any measurement.
        settled: Control period from which on errors count, int64, (size,).
        error: True position errors, m, (size, axes).
        max_error: Their largest absolute values since settling, m, (size, axes).
        attitude_error: Attitude errors as known on board, rad, (size, angles): those that are
            controlled, then those that are watched.
        effort: Mean absolute thruster commands, N, (size,).
        observation: Observations, float32, (size, numbers).
    """

    blocks: Array
    instant: NDArray[np.int64]
    steps: NDArray[np.int64]
    taken: NDArray[np.int32]
    noise: Array
    other_noise: NDArray[np.float32]
    past: Array
    settled: NDArray[np.int64]
    error: Array
    max_error: Array
    attitude_error: Array
    effort: Array
    observation: NDArray[np.float32]


class Kernels(NamedTuple):
    """The compiled entry points of a world.

    `shared` is what `World.shared` gives, `table` that of the observation, `actions` the commands
    over the limits, (size, `World.actions`).

    Attributes:
        observe: `(fleet, shared, table, index, lanes)`: fill in errors and observation of a robot.
        run: `(fleet, shared, table, actions, first, last)`: advance the blocks `first` to `last`,
            this one left out, each of one robot, by a control period.
        run_lanes: The same for blocks of `lanes.WIDTH` robots.
        run_threads: `(fleet, shared, table, actions)`: `run_lanes` for all blocks, shared out among
            threads.
    """

    observe: Any
    run: Any
    run_lanes: Any
    run_threads: Any


class Episode(Protocol):
    """What a world asks of a scenario, which may have more."""

    @property
    def conditions(self) -> Conditions:
        """Sensors, actuators, timing."""

    @property
    def body(self) -> Any:
        """The robot, of which `world_of` gives the world."""

    @property
    def nominal(self) -> Nominal:
        """What a controller may know beforehand."""

    @property
    def duration(self) -> float:
        """Length of the episode, s."""

    @property
    def steps(self) -> int:
        """Control periods in the episode."""

    @property
    def settle_time(self) -> float:
        """From when on errors count, s."""

    @property
    def shifts(self) -> tuple[float, ...]:
        """When the body is asked to move, s; metrics leave a while after them out."""

    def sensing(self) -> Sensing:
        """When its sensors measure, and how wrong they are."""


class Sampler(Protocol):
    """Where the scenarios of an environment come from."""

    @property
    def body(self) -> Any:
        """The robot of all scenarios, of which `world_of` gives the world."""

    @property
    def nominal(self) -> Nominal:
        """What a controller may know before the first scenario."""

    @property
    def conditions(self) -> Conditions:
        """The conditions of the scenarios that are drawn."""

    def draw(self, stream: np.random.Generator) -> Any:
        """Draw a scenario."""

    def choose(self, wanted: Any) -> Any:
        """The scenario of a name, of a dict, or itself.

        Raises:
            ValueError: If there is none, or it is of another robot or another task.
        """


class World(ABC):
    """One body, one task and its sensors.

    Attributes:
        axes: Names of the axes of the position error.
        attitude: Names of the angles of the attitude error that are controlled and scored; their
            errors are observed one after the other, as `ANGLE_error`.
        watched: Names of angles that are reported, but neither controlled nor scored.
        kernels: The compiled entry points.
        lost_error: Further from its reference than this in any axis a robot is lost, m.
    """

    lost_error: ClassVar[float] = LOST_ERROR
    axes: ClassVar[tuple[str, ...]]
    attitude: ClassVar[tuple[str, ...]] = ()
    watched: ClassVar[tuple[str, ...]] = ()
    kernels: ClassVar[Kernels]

    @property
    @abstractmethod
    def layout(self) -> Layout:
        """The table of the observation."""

    @property
    @abstractmethod
    def links(self) -> int:
        """Rigid bodies of a robot, by which its work is measured."""

    @property
    @abstractmethod
    def thrusters(self) -> int:
        """Thrusters of a robot."""

    @property
    def actions(self) -> int:
        """Numbers of an action, those of the thrusters first."""
        return self.thrusters

    @property
    @abstractmethod
    def mass(self) -> float:
        """Mass of a robot as laws take it, kg."""

    @property
    @abstractmethod
    def straight_body(self) -> tuple[Array, Array]:
        """Inertia with added mass, kg, and linear drag, N s/m, in each axis, (axes,) each.

        They are those of a robot that is straight, level and along x.
        """

    @property
    @abstractmethod
    def quantities(self) -> Mapping[str, slice]:
        """Rows of the quantities that may be read, by name; `command`, N, among them."""

    @property
    @abstractmethod
    def rows(self) -> int:
        """Numbers of a robot."""

    def check(self, scenario: Any) -> None:  # noqa: B027 (a world may take all scenarios)
        """Refuse a scenario that the robot cannot carry out.

        Raises:
            ValueError: If it cannot.
        """

    @abstractmethod
    def write(self, scenario: Any, row: Array) -> None:
        """Write a scenario and its start into the numbers of a robot, (rows,)."""

    @abstractmethod
    def shared(self, scenario: Any, previous: Any) -> Any:
        """What all robots share, as kernels take it: a named tuple.

        Args:
            scenario: A scenario that starts.
            previous: What was shared so far, which is returned if it will do; None at first.
        """

    def find_lost(self, error: Array, attitude_error: Array, lost: NDArray[np.bool_]) -> bool:
        """Write down which robots are lost, (size,), and say whether any is.

        Args:
            error: True position errors, m, (size, axes).
            attitude_error: Attitude errors, rad, (size, angles).
            lost: Where to write.
        """
        return bool(find_lost(error, attitude_error, self.lost_error, lost))

    def reward(self, error: Array, attitude_error: Array, effort: Array, limit: Array) -> Array:
        """Rewards of a step, (size,).

        Args:
            error: True position errors, m, (size, axes).
            attitude_error: Attitude errors, rad, (size, angles).
            effort: Mean absolute thruster commands after saturation, N, (size,).
            limit: Thruster limits, N, (size,).
        """
        controlled = attitude_error[:, : len(self.attitude)]
        return reward(error, controlled, effort, limit)

    def reward_of_loss(self, remaining: NDArray[np.int64]) -> Array:
        """Rewards of the steps that lose robots, (lost,).

        Args:
            remaining: Control periods that were left of their episodes, (lost,).
        """
        return reward_of_loss(remaining, len(self.attitude))

    def truth(self, read: Callable[[str], Array]) -> dict[str, Array]:
        """What training may be told and no policy: true parameters and signals, by name.

        Args:
            read: Reads a quantity of all robots, (size, numbers).

        Returns:
            Arrays whose first axis is the robots; none, unless the world gives some.
        """
        return {}

    @abstractmethod
    def allocate(self, observation: NDArray[np.float32], matrices: Array) -> None:
        """Fill in the allocation matrices of robots as observed.

        Args:
            observation: Observations, (batch, numbers).
            matrices: Where to write: the forces along the axes, N, then the moments about the
                attitude's angles and those that are watched, N m, that unit forces of the thrusters
                make, (batch, axes + angles, thrusters).
        """


@singledispatch
def world_of(robot: Any) -> World:
    """The world of a robot."""
    raise TypeError(f"no world is registered for {type(robot).__name__}")
