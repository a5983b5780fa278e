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
from usm_gym.plant import layout as rows
from usm_gym.plant.measure import Table
from usm_gym.plant.motion import filter_coefficients, lag_share
from usm_gym.plant.step import Fleet, Plant, observe_one, run_lanes, run_singles, run_threads
from usm_gym.robot import Robot
from usm_gym.support.validation import require
from usm_gym.task.metrics import LOST_ERROR, TIME_TOLERANCE
from usm_gym.task.observation import ObservationLayout
from usm_gym.task.scenario import Scenario

# Physics steps times links of the longest episode; at a step of 1e-3 s, 16 links swim 35 hours.
MOST_LINK_STEPS = 2_000_000_000
# Links of all robots side by side, some gigabytes; and physics steps times links of one control
# period, some seconds, which nothing can interrupt.
MOST_LINKS, MOST_AT_ONCE = 4_000_000, 500_000_000


@dataclass(frozen=True)
class Snapshot:
    """A copy of everything that changes in a simulation.

    Attributes:
        scenarios: The scenarios in progress.
        arrays: The state.
    """

    scenarios: tuple[Scenario, ...]
    arrays: dict[str, NDArray[Any]]


def check_fit(robot: Robot, scenario: Scenario) -> None:
    """Refuse a scenario that a robot cannot swim.

    Raises:
        ValueError: If more joints shall bend than it has, or the episode is too much work.
    """
    joints = robot.links - 1
    require(
        scenario.inspection.bending_joints <= joints,
        "bending_joints",
        scenario.inspection.bending_joints,
        f"1 to {joints}, the robot's joints",
    )
    steps = scenario.steps * scenario.conditions.substeps
    longest = MOST_LINK_STEPS // robot.links * scenario.conditions.physics_step
    require(
        steps * robot.links <= MOST_LINK_STEPS,
        "duration",
        scenario.duration,
        f"up to {longest:g} s for {robot.links} links at this physics step",
    )


class Simulation:
    """`size` copies of a robot, each in a scenario of its own, advanced in step.

    All scenarios must agree in what the numbers of physics steps follow from: control period,
    physics step, integrator and hydrodynamics.

    Attributes:
        robot: The robot.
        size: How many there are.
        layout: Layout of the observation.
        scenarios: The scenario of each.
        count: Control periods since each start, int64, (size,).
        error: True position errors, m, (size, 2).
        heading_error: Heading errors as known on board, rad, (size,).
        observation: Observations, float32, (size, numbers).
        max_error: Largest true errors so far after settling, m, (size, 2); 0 before.
        effort: Mean absolute thruster commands, N, (size,).
        lost: Which robots are lost: their error beyond `LOST_ERROR` or not finite, (size,).
        steps: Control periods in each episode, int64, (size,).
        fleet: The state, as kernels take it.
        plant: What all robots share, as kernels take it.
    """

    def __init__(self, robot: Robot, scenarios: Sequence[Scenario], threads: int = 1) -> None:
        """Start all robots at the beginning of the given scenarios.

        Args:
            robot: The robot.
            scenarios: One scenario for each copy of it.
            threads: How many threads share a step, at most one per core; without effect on its
                result.
        """
        require(threads >= 1, "threads", threads, "1 or more")
        numbers = len(scenarios) * robot.links
        work = numbers * scenarios[0].conditions.substeps
        many = f"{len(scenarios)} robots of {robot.links} links"
        require(numbers <= MOST_LINKS, "scenarios", many, f"up to {MOST_LINKS} links in all")
        require(
            work <= MOST_AT_ONCE,
            "scenarios",
            f"{many}, {scenarios[0].conditions.substeps} physics steps at a time",
            f"up to {MOST_AT_ONCE} in all",
        )
        self.robot = robot
        self.size = len(scenarios)
        self.layout = ObservationLayout(robot.links, len(robot.thrusters))
        self._lanes = WIDTH if self.size > 1 else 1
        self._table = Table(self.layout.starts, 1.0 / self.layout.scale, self.layout.bound)
        self._timing = scenarios[0].conditions.timing
        blocks = -(-self.size // self._lanes)
        numbers = rows.rows(robot.links, len(robot.thrusters))
        self._rows = np.zeros((blocks, numbers, self._lanes))
        self.scenarios = list(scenarios)
        self.count = np.zeros(self.size, np.int64)
        self.error = np.zeros((self.size, 2))
        self.heading_error = np.zeros(self.size)
        self.observation = np.zeros((self.size, self.layout.size), np.float32)
        self.max_error = np.zeros((self.size, 2))
        self.steps = np.zeros(self.size, np.int64)
        self.effort = np.zeros(self.size)
        self.lost = np.zeros(self.size, bool)
        self._settled = np.zeros(self.size, np.int64)
        self._noise = np.zeros((self.size, max(s.steps for s in scenarios) + 1, 2))
        self._threads = min(threads, blocks, numba.config.NUMBA_NUM_THREADS)
        self._shifts, self._moving_water = 0, False
        self._share_out()
        for index, scenario in enumerate(scenarios):
            self.start(index, scenario)

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._share_out()  # what was one array before pickling has become two

    @property
    def limit(self) -> NDArray[np.float64]:
        """Thruster limits, N, (size,)."""
        return self._column(rows.LIMIT)

    @property
    def command(self) -> NDArray[np.float64]:
        """Last thruster commands after saturation, N, (size, thrusters)."""
        first = rows.first_command(self.robot.links)
        return self._columns(first, len(self.robot.thrusters))

    @property
    def force(self) -> NDArray[np.float64]:
        """Forces of the thrusters, which lag behind the commands, N, (size, thrusters)."""
        thrusters = len(self.robot.thrusters)
        return self._columns(rows.first_command(self.robot.links) + thrusters, thrusters)

    @property
    def current(self) -> NDArray[np.float64]:
        """Velocity of the water, m/s, (size, 2)."""
        return np.stack([self._column(rows.WATER_X), self._column(rows.WATER_Y)], axis=1)

    @property
    def theta(self) -> NDArray[np.float64]:
        """True link angles, rad, (size, links)."""
        links = self.robot.links
        return self._columns(rows.row_of(rows.THETA, links), links)

    @property
    def position(self) -> NDArray[np.float64]:
        """True position of the centre of mass, m, (size, 2)."""
        return np.stack([self._column(rows.P_X), self._column(rows.P_Y)], axis=1)

    def check(self, scenario: Scenario) -> None:
        """Refuse a scenario that `start` would refuse.

        Raises:
            ValueError: If the scenario does not fit the robot or the others' timing.
        """
        check_fit(self.robot, scenario)
        require(
            scenario.conditions.timing == self._timing,
            "conditions",
            scenario.conditions.timing,
            f"control period, physics step, integrator and hydrodynamics as the others: "
            f"{self._timing}",
        )

    def start(self, index: int, scenario: Scenario) -> None:
        """Put one robot at the beginning of a scenario.

        Raises:
            ValueError: If the scenario does not fit the robot or the others' timing.
        """
        self.check(scenario)
        self.scenarios[index] = scenario
        self._write(index, scenario)
        self.count[index] = 0
        self.max_error[index] = 0.0
        self.steps[index] = scenario.steps
        self._settled[index] = math.ceil(
            (scenario.settle_time - TIME_TOLERANCE) / scenario.conditions.control_period
        )
        self.effort[index] = 0.0
        self.lost[index] = False
        noise = scenario.noise()
        missing = len(noise) - self._noise.shape[1]
        shifts, moving = len(scenario.shifts), any(scenario.water.amplitude)
        if missing > 0 or shifts > self._shifts or moving > self._moving_water:
            self._noise = np.pad(self._noise, ((0, 0), (0, max(missing, 0)), (0, 0)))
            self._shifts = max(shifts, self._shifts)
            self._moving_water |= moving
            self._share_out()
        self._noise[index, : len(noise)] = noise
        observe_one(self.fleet, self.plant, self._table, index, self._lanes)

    def step(self, action: NDArray[Any]) -> None:
        """Advance every robot by one control period.

        Args:
            action: Thruster commands over the thruster limits, (size, thrusters); values beyond
                [-1, 1] saturate.
        """
        arguments = (self.fleet, self.plant, self._table, action)
        if self._threads > 1:
            # The number belongs to the calling thread, not to this simulation.
            previous = numba.get_num_threads()
            numba.set_num_threads(self._threads)
            try:
                run_threads(*arguments)
            finally:
                numba.set_num_threads(previous)
        else:
            kernel = run_lanes if self._lanes > 1 else run_singles
            kernel(*arguments, 0, len(self._rows))
        # Compiled code assumes finite numbers, so that what is none is found here.
        distance = np.maximum(*np.abs(self.error.T)) + 0.0 * self.heading_error
        np.logical_not(distance <= LOST_ERROR, out=self.lost)
        if self.lost.any():
            self._tidy(self.lost)

    def snapshot(self) -> Snapshot:
        """Copy the whole state."""
        return Snapshot(
            tuple(self.scenarios),
            {name: getattr(self, name).copy() for name in _STATE},
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a copied state; what follows then has the same bits as what followed it."""
        for index, scenario in enumerate(snapshot.scenarios):
            if scenario != self.scenarios[index]:
                self.start(index, scenario)
        for name, array in snapshot.arrays.items():
            getattr(self, name)[...] = array

    def _tidy(self, lost: NDArray[np.bool_]) -> None:
        # What is reported of a lost robot is finite, its observation inside its bounds.
        bound = self.layout.bound
        self.observation[lost] = np.clip(np.nan_to_num(self.observation[lost]), -bound, bound)
        for values in (self.error, self.max_error, self.heading_error):
            values[lost] = np.nan_to_num(
                values[lost], nan=LOST_ERROR, posinf=LOST_ERROR, neginf=-LOST_ERROR
            )

    def _share_out(self) -> None:
        """Gather what the kernel takes; arrays are shared, not copied."""
        conditions = self.scenarios[0].conditions
        implicit = conditions.physics_step if conditions.integrator == "symplectic" else 0.0
        self.plant = Plant(
            l=self.robot.half_length,
            m=self.robot.link_mass,
            J=self.robot.link_inertia,
            implicit=implicit,
            kirchhoff=float(conditions.hydrodynamics == "consistent"),
            links=self.robot.links,
            thruster_links=self.robot.thruster_links,
            thruster_is_normal=self.robot.thruster_is_normal,
            h=conditions.physics_step,
            substeps=conditions.substeps,
            shifts=self._shifts,
            moving_water=self._moving_water,
        )
        self.fleet = Fleet(
            blocks=self._rows.reshape(len(self._rows), -1),
            instant=self.count,
            noise=self._noise,
            settled=self._settled,
            error=self.error,
            max_error=self.max_error,
            heading_error=self.heading_error,
            effort=self.effort,
            observation=self.observation,
        )

    def _write(self, index: int, scenario: Scenario) -> None:
        """Write a scenario's parameters and its start, straight and at rest, into the rows."""
        conditions, water, path = scenario.conditions, scenario.water, scenario.path
        h = conditions.physics_step
        row = self._rows[index // self._lanes, :, index % self._lanes]
        row[:] = 0.0
        nominal = np.array(self.robot.hydrodynamic_coefficients)
        row[rows.C_T : rows.LAMBDA_3 + 1] = nominal * water.coefficients
        row[[rows.WATER_X, rows.WATER_Y]] = water.current
        row[[rows.MEAN_X, rows.MEAN_Y]] = water.current
        row[[rows.AMPLITUDE_X, rows.AMPLITUDE_Y]] = water.amplitude
        row[[rows.PHASE_X, rows.PHASE_Y]] = water.phase
        row[rows.WATER_FREQUENCY] = 2 * np.pi / water.period
        stiffness, damping = scenario.joint_stiffness, scenario.joint_damping
        k_p = self.robot.joint_stiffness if stiffness is None else stiffness
        k_d = self.robot.joint_damping if damping is None else damping
        implicit = h if conditions.integrator == "symplectic" else 0.0
        row[rows.STIFFNESS], row[rows.DAMPING] = k_p, k_d
        row[rows.JOINT_INERTIA] = implicit * k_d + implicit**2 * k_p
        motion = scenario.inspection
        links = self.robot.links
        share = rows.row_of(rows.SHARE, links) + links - 1 - motion.bending_joints
        row[share : share + motion.bending_joints] = 1.0 / motion.bending_joints
        side = rows.row_of(rows.SIDE, links)
        row[side : side + links] = rows.sides(links)
        row[rows.FILTER_DD : rows.FILTER_DAMPING + 1] = filter_coefficients(
            motion.filter_frequency or 0.0, h
        )
        row[rows.SHIFT_TIME : rows.SHIFT_SIZE] = rows.NEVER
        shifts = len(scenario.shifts)
        row[rows.SHIFT_TIME : rows.SHIFT_TIME + shifts] = scenario.shifts
        sizes = np.diff(motion.deflections, prepend=0.0)[:shifts]
        row[rows.SHIFT_SIZE : rows.SHIFT_SIZE + shifts] = sizes
        row[rows.LAG] = lag_share(conditions.thruster_time_constant, h)
        row[rows.LIMIT] = conditions.thruster_limit
        row[rows.SPEED], row[rows.SWAY] = path.speed, path.amplitude
        row[rows.FREQUENCY], row[rows.RAMP] = path.frequency, path.ramp
        row[rows.LOOK_AHEAD] = scenario.look_ahead or 0.0
        row[rows.CROSS_TRACK] = scenario.cross_track
        row[rows.HEAD_HEADING] = scenario.heading == "head"

    def _column(self, row: int) -> NDArray[np.float64]:
        return self._rows[:, row].reshape(-1)[: self.size]

    def _columns(self, first: int, count: int) -> NDArray[np.float64]:
        table = self._rows[:, first : first + count].swapaxes(1, 2)
        return table.reshape(-1, count)[: self.size].copy()


_STATE = (
    "_rows",
    "count",
    "error",
    "max_error",
    "heading_error",
    "effort",
    "lost",
    "observation",
)
