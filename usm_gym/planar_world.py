"""The world of the paper's robot: a chain of links in a plane that follows a path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numba
import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import compiled, parallel, piece
from usm_gym.kernels.lanes import WIDTH, block_at, spread
from usm_gym.packing import body_row, plant_of
from usm_gym.plant import layout as rows
from usm_gym.plant.plant import Plant
from usm_gym.plant.steering import steer
from usm_gym.plant.step import advance
from usm_gym.plant.thrusters import command
from usm_gym.robot import Robot
from usm_gym.support.validation import require
from usm_gym.task import guidance
from usm_gym.task.head_observation import observe_head
from usm_gym.task.metrics import note_largest
from usm_gym.task.observation import (
    ENTRY,
    ObservationLayout,
    allocations,
    find_error,
    measure,
    measure_age,
    number,
)
from usm_gym.task.scenario import Scenario
from usm_gym.world import Array, Kernels, World, world_of

# Physics steps times links of the longest episode; at a step of 1e-3 s, 16 links swim 35 hours.
MOST_LINK_STEPS = 2_000_000_000
AXES = 2


@compiled
def observe(fleet, plant, table, robot, lanes):
    """Measure one robot; not a `piece`, which would slow down what it is inlined in."""
    row, lane, instant = fleet.blocks[robot // lanes], robot % lanes, fleet.instant[robot]
    # A robot whose episode has ended may be stepped on until it is restarted.
    now = min(instant, fleet.steps[robot])
    error, past = fleet.error[robot], fleet.past[robot]
    reference = find_error(row, lanes, lane, plant, error)
    kept = past[instant % past.shape[0]]
    for axis in range(AXES):
        kept[axis] = error[axis]
        kept[AXES + axis] = number(row, lanes, lane, rows.V_X + axis)
    at = fleet.taken[robot, now, 0]
    seen, noise = past[(instant - (now - at)) % past.shape[0]], fleet.noise[robot, at]
    measured = seen[0] + noise[0], seen[1] + noise[1]
    others, angles = fleet.other_noise[robot, now], fleet.attitude_error[robot]
    observation = fleet.observation[robot]
    measure(row, lanes, lane, plant, reference, measured, others[AXES:], table, angles, observation)
    period = plant.substeps * plant.h
    measure_age(ENTRY.position_age, (now - at) * period, table, observation)
    at = fleet.taken[robot, now, 1]
    age, k = -1.0, table.starts[ENTRY.velocity]
    observation[k], observation[k + 1] = 0.0, 0.0
    if at >= 0:
        age = (now - at) * period
        seen, noises = past[(instant - (now - at)) % past.shape[0]], fleet.other_noise[robot, at]
        for axis in range(AXES):
            velocity = seen[AXES + axis] + noises[axis]
            observation[k + axis] = velocity * table.gain[k + axis]
    measure_age(ENTRY.velocity_age, age, table, observation)
    if plant.steering > 0:
        observe_head(fleet, plant, table, robot, lanes)
    for k in range(observation.size):
        observation[k] = min(max(observation[k], -table.bound[k]), table.bound[k])


@piece
def run(fleet, plant, table, actions, like, lanes, stride, first, last):
    """One control period of blocks `first` to `last`: command, advance, measure."""
    size, thrusters = actions.shape[0], plant.thruster_links.size
    places = rows.thruster_rows(plant.links, thrusters)
    for k in range(first, last):
        for robot in range(k * lanes, min((k + 1) * lanes, size)):
            block, lane, action = fleet.blocks[k], robot - k * lanes, actions[robot]
            fleet.effort[robot] = command(block, lanes, lane, places, action[:thrusters])
            if plant.steering > 0:
                steer(block, lanes, lane, plant, action[thrusters:])
        advance(block_at(fleet.blocks, k, like), like, spread(0.0), stride, plant)
        for robot in range(k * lanes, min((k + 1) * lanes, size)):
            fleet.instant[robot] += 1
            observe(fleet, plant, table, robot, lanes)
            note_largest(fleet, robot)


@compiled
def run_singles(fleet, plant, table, actions, first, last):
    """`run` for blocks of one robot each."""
    run(fleet, plant, table, actions, 0.0, 1, WIDTH, first, last)


@compiled
def run_lanes(fleet, plant, table, actions, first, last):
    """`run` for blocks of `lanes.WIDTH` robots each."""
    run(fleet, plant, table, actions, spread(0.0), WIDTH, 1, first, last)


@parallel
def run_threads(fleet, plant, table, actions):
    """`run_lanes` for all blocks, shared out among threads."""
    for k in numba.prange(fleet.blocks.shape[0]):
        run_lanes(fleet, plant, table, actions, k, k + 1)


@dataclass(frozen=True)
class PlanarWorld(World):
    """A robot in a plane, and its path there.

    Attributes:
        robot: The robot.
    """

    robot: Robot
    axes: ClassVar[tuple[str, ...]] = ("x", "y")
    attitude: ClassVar[tuple[str, ...]] = ("heading",)
    kernels: ClassVar[Kernels] = Kernels(observe, run_singles, run_lanes, run_threads)

    @cached_property
    def layout(self) -> ObservationLayout:
        """The table of the observation."""
        return ObservationLayout(self.links, self.thrusters)

    @property
    def links(self) -> int:
        """Links of the robot."""
        return self.robot.links

    @property
    def thrusters(self) -> int:
        """Thrusters of the robot."""
        return len(self.robot.thrusters)

    @property
    def mass(self) -> float:
        """Mass of the robot, kg."""
        return self.robot.total_mass

    @property
    def straight_body(self) -> tuple[Array, Array]:
        """Inertia, kg, and linear drag, N s/m, along the straight body and across it, (2,)."""
        robot = self.robot
        added = np.array([0.0, robot.added_mass])
        inertia = robot.total_mass + robot.links * added
        drag = robot.links * np.array([robot.tangential_drag, robot.normal_drag])
        return inertia, drag

    @property
    def rows(self) -> int:
        """Rows of the body, then those of guidance."""
        return self._guidance + guidance.GUIDANCE_ROWS

    @cached_property
    def quantities(self) -> Mapping[str, slice]:
        """Rows by name; vectors in the global frame, angles from the tail, SI units.

        `position`, `velocity` and `acceleration` are those of the centre of mass, `force` has the
        thrusters' forces, which lag behind `command` and have its size times `thruster_gains`,
        `coefficients` the true hydrodynamic ones, which link i has times `link_factors[i]`;
        joint i is asked for `joint_shares[i] * deflection`. `acceleration`, what pushes the links,
        `sine` and `cosine` of their angles and the water are of the middle of the last step.
        """
        links = self.links
        thrusters = self.thrusters
        starts = {
            "position": (rows.P_X, 2),
            "velocity": (rows.V_X, 2),
            "acceleration": (rows.A_X, 2),
            "theta": (rows.row_of(rows.THETA, links), links),
            "theta_dot": (rows.row_of(rows.OMEGA, links), links),
            "water_velocity": (rows.WATER_X, 2),
            "coefficients": (rows.C_T, 6),
            "joint_shares": (rows.row_of(rows.SHARE, links), links - 1),
            "deflection": (rows.DEFLECTION, 1),
            "push_along": (rows.row_of(rows.PUSH_T, links), links),
            "push_across": (rows.row_of(rows.PUSH_N, links), links),
            "sine": (rows.row_of(rows.SIN, links), links),
            "cosine": (rows.row_of(rows.COS, links), links),
            "link_factors": (rows.row_of(rows.FACTOR, links), links),
            "command": (rows.thruster_row(rows.COMMAND, links, thrusters), thrusters),
            "force": (rows.thruster_row(rows.FORCE, links, thrusters), thrusters),
            "thruster_gains": (rows.thruster_row(rows.GAIN, links, thrusters), thrusters),
        }
        return {name: slice(row, row + size) for name, (row, size) in starts.items()}

    def check(self, scenario: Scenario) -> None:
        """Refuse a scenario that the robot cannot swim.

        Raises:
            ValueError: If more joints shall bend than it has, factors or gains do not match its
                links and thrusters, or the episode is too much work.
        """
        joints = self.links - 1
        bending = scenario.inspection.bending_joints
        allowed = f"1 to {joints}, the robot's joints"
        require(bending <= joints, "bending_joints", bending, allowed)
        factors, gains = scenario.water.link_factors, scenario.thruster_gains
        fitting = len(factors) in (0, self.links)
        require(fitting, "link_factors", factors, f"none, or one for each of {self.links} links")
        fitting = len(gains) in (0, self.thrusters)
        allowed = f"none, or one for each of {self.thrusters} thrusters"
        require(fitting, "thruster_gains", gains, allowed)
        steps = scenario.steps * scenario.conditions.substeps
        longest = MOST_LINK_STEPS // self.links * scenario.conditions.physics_step
        require(
            steps * self.links <= MOST_LINK_STEPS,
            "duration",
            scenario.duration,
            f"up to {longest:g} s for {self.links} links at this physics step",
        )

    def write(self, scenario: Scenario, row: Array) -> None:
        """Write a scenario's parameters and its start, straight and at rest, into the rows."""
        conditions, water, path = scenario.conditions, scenario.water, scenario.path
        motion, links = scenario.inspection, self.links
        row[: self._guidance] = body_row(
            self.robot,
            self.shared(scenario, None),
            coefficients=water.coefficients,
            joint_gains=scenario.joint_gains,
            filter_frequency=motion.filter_frequency or 0.0,
            time_constant=conditions.thruster_time_constant,
            dead_band=conditions.thruster_dead_band,
            link_factors=water.link_factors or 1.0,
            thruster_gains=scenario.thruster_gains or 1.0,
        )
        row[rows.WATER_X : rows.WATER_Y + 1] = water.current
        row[rows.MEAN_X : rows.MEAN_Y + 1] = water.current
        slow = (water.amplitude, water.phase, water.period)
        waves = ((wave.amplitude, (wave.phase, wave.phase), wave.period) for wave in water.waves)
        for k, (amplitude, phase, period) in enumerate((slow, *waves)):
            first = rows.SINUSOID + k * rows.SINUSOID_ROWS
            row[first : first + rows.SINUSOID_ROWS] = *amplitude, *phase, 2 * np.pi / period
        share = rows.row_of(rows.SHARE, links) + links - 1 - motion.bending_joints
        row[share : share + motion.bending_joints] = 1.0 / motion.bending_joints
        shifts = len(scenario.shifts)
        at = np.divide(scenario.shifts, conditions.physics_step)
        row[rows.SHIFT_STEP : rows.SHIFT_STEP + shifts] = at
        sizes = np.diff(motion.deflections, prepend=0.0)[:shifts]
        row[rows.SHIFT_SIZE : rows.SHIFT_SIZE + shifts] = sizes
        row[rows.LIMIT] = conditions.thruster_limit
        asked = row[self._guidance :]
        asked[guidance.SPEED], asked[guidance.SWAY] = path.speed, path.amplitude
        asked[guidance.FREQUENCY], asked[guidance.RAMP] = path.frequency, path.ramp
        asked[guidance.LOOK_AHEAD] = scenario.look_ahead or 0.0
        asked[guidance.CROSS_TRACK] = scenario.cross_track
        asked[guidance.HEAD_HEADING] = scenario.heading == "head"

    def shared(self, scenario: Scenario, previous: Plant | None) -> Plant:
        """What all robots share; as many changes of the joint references as any of them has."""
        shifts, sinusoids = len(scenario.shifts), scenario.water.sinusoids
        if previous is not None:
            if shifts <= previous.shifts and sinusoids <= previous.sinusoids:
                return previous
            shifts, sinusoids = max(shifts, previous.shifts), max(sinusoids, previous.sinusoids)
        conditions = scenario.conditions
        return plant_of(
            self.robot,
            conditions.physics_step,
            substeps=conditions.substeps,
            euler=conditions.integrator == "explicit",
            hydrodynamics=conditions.hydrodynamics,
            drag=conditions.drag,
            shifts=shifts,
            sinusoids=sinusoids,
        )

    def truth(self, read: Callable[[str], Array]) -> dict[str, Array]:
        """True parameters and signals, in the global frame.

        Returns:
            `coefficients`, as in `Robot.hydrodynamic_coefficients`, (size, 6); `water_velocity`,
            m/s, (size, 2); `disturbance`, the acceleration of the centre of mass less that by the
            thrusters over the mass, f / m_t of (23), m/s^2, (size, 2).
        """
        along, across = read("push_along"), read("push_across")
        s, c = read("sine"), read("cosine")
        push = np.stack(
            [(along * c - across * s).sum(axis=1), (along * s + across * c).sum(axis=1)]
        )
        return {
            "coefficients": read("coefficients"),
            "water_velocity": read("water_velocity"),
            "disturbance": read("acceleration") - push.T / self.mass,
        }

    def allocate(self, observation: NDArray[np.float32], matrices: Array) -> None:
        """Fill in the allocation matrices of robots as observed; see `World.allocate`."""
        allocations(observation, *self._posture, matrices)

    @property
    def _guidance(self) -> int:
        """The first row of guidance."""
        return rows.body_rows(self.links, self.thrusters)

    @cached_property
    def _posture(self) -> tuple[Any, Any, Any, Any, Any, Any, Any]:
        """What `allocations` takes of the robot and of its observation."""
        robot, layout = self.robot, self.layout
        tail, joints = (layout.slices[name].start for name in ("tail_angle", "joint_angles"))
        links, normal = robot.thruster_links, robot.thruster_is_normal
        return layout.scale, tail, joints, robot.links, robot.half_length, links, normal


@world_of.register
@lru_cache
def _planar_world(robot: Robot) -> PlanarWorld:
    return PlanarWorld(robot)
