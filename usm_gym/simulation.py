"""Robots simulated side by side: scenarios in, commands in, observations and true errors out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.lanes import WIDTH
from usm_gym.support.validation import require
from usm_gym.task.loss import make_finite
from usm_gym.task.metrics import TIME_TOLERANCE
from usm_gym.world import Array, Episode, Fleet, world_of

# Links of all robots side by side, some gigabytes; and physics steps times links of one control
# period, some seconds, which nothing can interrupt.
MOST_LINKS, MOST_AT_ONCE = 4_000_000, 500_000_000


@dataclass(frozen=True)
class Snapshot:
    """A copy of everything that changes in a simulation.

    Attributes:
        scenarios: The scenarios in progress.
        arrays: The state.
        past: What is still to be measured, see `usm_gym.world.Fleet`.
        commands: Actions that are still to take effect, (size, periods, numbers).
    """

    scenarios: tuple[Any, ...]
    arrays: dict[str, NDArray[Any]]
    past: Array
    commands: NDArray[np.float32]


class Simulation:
    """`size` copies of a robot, each in a scenario of its own, advanced in step.

    All scenarios must be of the same robot, and agree in what the numbers of physics steps follow
    from: control period, physics step, integrator, hydrodynamics and drag.

    Attributes:
        world: The world that all robots are in.
        size: How many robots there are.
        layout: Table of the observation.
        scenarios: The robots' scenarios.
        count: Control periods since the start, int64, (size,).
        error: True position errors, m, (size, axes).
        attitude_error: Attitude errors as known on board, rad, (size, angles): those that are
            controlled, then those that are watched.
        observation: Observations, float32, (size, numbers).
        max_error: Largest true errors so far after settling, m, (size, axes); 0 before.
        effort: Mean absolute thruster commands, N, (size,).
        limit: Thruster limits, N, (size,).
        lost: Which robots are lost (`usm_gym.task.loss`), (size,).
        steps: Control periods per episode, int64, (size,).
        fleet: The state, as kernels take it.
        shared: What all robots share, as kernels take it.
    """

    def __init__(self, scenarios: Sequence[Episode], threads: int = 1) -> None:
        """Start all robots at the beginning of the given scenarios.

        Args:
            scenarios: One scenario per robot.
            threads: How many threads share a step, at most one per core; without effect on its
                result.
        """
        require(threads >= 1, "threads", threads, "1 or more")
        self.world = world_of(scenarios[0].body)
        self.size = len(scenarios)
        _check_size(self.size, self.world.links, scenarios[0].conditions.substeps)
        self.layout = self.world.layout
        self.scenarios: list[Any] = list(scenarios)
        self.shared: Any = None
        self._lanes = WIDTH if self.size > 1 else 1
        self._timing = scenarios[0].conditions.timing
        axes, blocks = len(self.world.axes), -(-self.size // self._lanes)
        self._rows = _aligned_zeros((blocks, self.world.rows, self._lanes))
        self.count = np.zeros(self.size, np.int64)
        self.error = np.zeros((self.size, axes))
        angles = len(self.world.attitude) + len(self.world.watched)
        self.attitude_error = np.zeros((self.size, angles))
        self.observation = np.zeros((self.size, self.layout.size), np.float32)
        self.max_error = np.zeros((self.size, axes))
        self.steps = np.zeros(self.size, np.int64)
        self.effort, self.limit = np.zeros(self.size), np.zeros(self.size)
        self.lost = np.zeros(self.size, bool)
        self._settled = np.zeros(self.size, np.int64)
        self._past = np.zeros((self.size, 1, 2 * axes))
        # Commands that have not taken effect yet; those of period i at i modulo their number.
        self._wait = np.zeros(self.size, np.int64)
        self._commands = np.zeros((self.size, 1, self.world.actions), np.float32)
        self._taken = np.zeros((self.size, 1, 2), np.int32)
        self._noise = np.zeros((self.size, 1, axes))
        self._other_noise = np.zeros((self.size, 1, 0), np.float32)
        self._threads = min(threads, blocks, numba.config.NUMBA_NUM_THREADS)
        self._share_out()
        for index, scenario in enumerate(scenarios):
            self.start(index, scenario)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._share_out()  # what was one array before pickling has become two

    def read(self, quantity: str) -> Array:
        """Read a quantity of all robots; `World.quantities` has their names.

        Returns:
            A copy, (size, numbers).
        """
        rows = self._rows[:, self.world.quantities[quantity]]
        return rows.swapaxes(1, 2).reshape(-1, rows.shape[1])[: self.size].copy()

    @property
    def mass_error(self) -> Array:
        """True position errors of the centres of mass, m, (size, axes), whatever is scored."""
        return self._mass[:, : len(self.world.axes)]

    @property
    def velocity(self) -> Array:
        """True velocities of the centres of mass, m/s, (size, axes)."""
        return self._mass[:, len(self.world.axes) :]

    @property
    def _mass(self) -> Array:
        mass: Array = self._past[np.arange(self.size), self.count % self._past.shape[1]]
        return mass

    def check(self, scenario: Any) -> None:
        """Refuse a scenario that `start` would refuse.

        Raises:
            ValueError: If the scenario is of another robot, does not fit the robot, or has another
                timing than the others.
        """
        same = scenario.body == self.scenarios[0].body
        require(same, "the scenario's robot", scenario.body, "that of the others")
        self.world.check(scenario)
        require(
            scenario.conditions.timing == self._timing,
            "conditions",
            scenario.conditions.timing,
            "control period, physics step, integrator, hydrodynamics and drag as the others: "
            f"{self._timing}",
        )

    def start(self, index: int, scenario: Any) -> None:
        """Put one robot at the beginning of a scenario.

        Raises:
            ValueError: As `check`.
        """
        self.check(scenario)
        self.scenarios[index] = scenario
        self.world.write(scenario, self._rows[index // self._lanes, :, index % self._lanes])
        self.count[index] = 0
        self.max_error[index] = 0.0
        self.steps[index] = scenario.steps
        self._settled[index] = math.ceil(
            (scenario.settle_time - TIME_TOLERANCE) / scenario.conditions.control_period
        )
        self.effort[index] = 0.0
        self.limit[index] = scenario.conditions.thruster_limit
        self.lost[index] = False
        self.shared = self.world.shared(scenario, self.shared)
        measured, conditions = scenario.sensing(), scenario.conditions
        self._wait[index] = conditions.action_delay
        self._past = _with_room(self._past, measured.oldest + 1, self.count)
        self._commands = _with_room(self._commands, conditions.action_delay + 1, self.count)
        self._taken = _written(self._taken, index, measured.taken)
        self._noise = _written(self._noise, index, measured.position)
        self._other_noise = _written(self._other_noise, index, measured.others)
        self._share_out()
        self._commands[index] = 0.0
        self.world.kernels.observe(
            self.fleet, self.shared, self.layout.kernel_table, index, self._lanes
        )

    def step(self, action: NDArray[Any]) -> None:
        """Advance every robot by one control period.

        Args:
            action: Commands over their limits, those of the thrusters first, (size, `actions` of
                the world); values beyond [-1, 1] saturate.
        """
        kernels = self.world.kernels
        if self._commands.shape[1] > 1:
            action = self._in_effect(action)
        arguments = (self.fleet, self.shared, self.layout.kernel_table, action)
        if self._threads > 1:
            # The number belongs to the calling thread, not to this simulation.
            previous = numba.get_num_threads()
            numba.set_num_threads(self._threads)
            try:
                kernels.run_threads(*arguments)
            finally:
                numba.set_num_threads(previous)
        else:
            run = kernels.run_lanes if self._lanes > 1 else kernels.run
            run(*arguments, 0, len(self._rows))
        if self.world.find_lost(self.error, self.attitude_error, self.lost):
            # What is reported of a lost robot is finite, its observation inside its bounds.
            bound, lost = self.layout.bound, self.lost
            self.observation[lost] = np.clip(np.nan_to_num(self.observation[lost]), -bound, bound)
            for errors in (self.error, self.max_error, self.attitude_error):
                make_finite(errors, lost, self.world.lost_error)

    def snapshot(self) -> Snapshot:
        """Copy the whole state."""
        return Snapshot(
            tuple(self.scenarios),
            {name: getattr(self, name).copy() for name in _STATE},
            self._past.copy(),
            self._commands.copy(),
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a copied state; what follows then has the same bits as what followed it."""
        for index, scenario in enumerate(snapshot.scenarios):
            if scenario != self.scenarios[index]:
                self.start(index, scenario)
        for name, array in snapshot.arrays.items():
            getattr(self, name)[...] = array
        self._past, self._commands = snapshot.past.copy(), snapshot.commands.copy()
        self._share_out()

    def _in_effect(self, action: NDArray[Any]) -> NDArray[Any]:
        """The commands that take effect now, when these have been given."""
        robots, periods = np.arange(self.size), self._commands.shape[1]
        self._commands[robots, self.count % periods] = action
        in_effect: NDArray[Any] = self._commands[robots, (self.count - self._wait) % periods]
        return in_effect

    def _share_out(self) -> None:
        """Gather what the kernels take; arrays are shared, not copied."""
        self.fleet = Fleet(
            blocks=self._rows.reshape(len(self._rows), -1),
            instant=self.count,
            steps=self.steps,
            taken=self._taken,
            noise=self._noise,
            other_noise=self._other_noise,
            past=self._past,
            settled=self._settled,
            error=self.error,
            max_error=self.max_error,
            attitude_error=self.attitude_error,
            effort=self.effort,
            observation=self.observation,
        )


def _written(kept: NDArray[Any], index: int, values: NDArray[Any]) -> NDArray[Any]:
    """What is kept of all robots, (size, instants, numbers), with new values of one of them.

    There is room for the most instants and numbers of any. Nothing reads a robot's instants after
    its last one; numbers that it lacks are 0.
    """
    instants, numbers = values.shape
    room = [max(instants - kept.shape[1], 0), max(numbers - kept.shape[2], 0)]
    if any(room):
        kept = np.pad(kept, ((0, 0), (0, room[0]), (0, room[1])))
    kept[index, :instants, :numbers], kept[index, :instants, numbers:] = values, 0
    return kept


def _with_room(kept: NDArray[Any], length: int, count: NDArray[np.int64]) -> NDArray[Any]:
    """What is kept of the last periods, with room for so many.

    Args:
        kept: That of period i at i modulo their number, (size, periods, numbers).
        length: For how many periods there shall be room.
        count: Periods since the start, (size,).
    """
    size, periods, numbers = kept.shape
    if length <= periods:
        return kept
    wider, robots = np.zeros((size, length, numbers), kept.dtype), np.arange(size)
    for age in range(periods):
        period = count - age
        wider[robots, period % length] = kept[robots, period % periods]
    return wider


def _aligned_zeros(shape: tuple[int, ...]) -> Array:
    """Zeros that begin on a cache line, which vector loads cross otherwise."""
    size, line = math.prod(shape), 8  # numbers
    room = np.zeros(size + line)
    first = -room.ctypes.data // room.itemsize % line
    return room[first : first + size].reshape(shape)


def _check_size(size: int, links: int, substeps: int) -> None:
    """Refuse more robots than memory holds, or than can be advanced in reasonable time."""
    many = f"{size} robots of {links} links"
    require(size * links <= MOST_LINKS, "scenarios", many, f"up to {MOST_LINKS} links in all")
    require(
        size * links * substeps <= MOST_AT_ONCE,
        "scenarios",
        f"{many}, {substeps} physics steps at a time",
        f"up to {MOST_AT_ONCE} in all",
    )


_STATE = (
    "_rows",
    "count",
    "error",
    "max_error",
    "attitude_error",
    "effort",
    "lost",
    "observation",
)
