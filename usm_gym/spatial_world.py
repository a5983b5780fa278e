"""The world of the spatial robot: a chain of links in space that follows a path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numba
import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import compiled, parallel, piece
from usm_gym.kernels.lanes import WIDTH, block_at, spread
from usm_gym.plant.spatial import layout as rows
from usm_gym.plant.spatial.links import SpatialPlant
from usm_gym.plant.spatial.step import advance
from usm_gym.plant.steering import steer
from usm_gym.plant.thrusters import command
from usm_gym.sensors import put
from usm_gym.spatial_packing import spatial_plant, spatial_row
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.support.validation import require
from usm_gym.task import spatial_guidance as guidance
from usm_gym.task.metrics import note_largest
from usm_gym.task.spatial_guidance import attitude_error, path_in_space, sight_in_space, sight_rates
from usm_gym.task.spatial_head_observation import observe_head_in_space
from usm_gym.task.spatial_observation import (
    SPATIAL_ENTRY,
    SpatialLayout,
    attitude_of,
    find_mass,
    measure_attitude,
    measure_joints,
    measure_thrusters,
    number,
    put_vector,
    spatial_allocations,
    vector,
)
from usm_gym.task.spatial_scenario import SpatialScenario
from usm_gym.world import Array, Kernels, World, world_of

# Physics steps times links of the longest episode, as in the plane.
MOST_LINK_STEPS = 2_000_000_000
AXES = 3


@compiled
def observe(fleet, plant, table, robot, lanes):
    """Measure one robot; not a `piece`, which would slow down what it is inlined in."""
    row, lane, instant = fleet.blocks[robot // lanes], robot % lanes, fleet.instant[robot]
    # A robot whose episode has ended may be stepped on until it is restarted.
    now = min(instant, fleet.steps[robot])
    observation, error, past = fleet.observation[robot], fleet.error[robot], fleet.past[robot]
    kept = past[instant % past.shape[0]]
    find_mass(row, lanes, lane, plant, error, kept[AXES:])
    reference = asked_position(row, lanes, lane, plant)
    for axis in range(AXES):
        error[axis] -= reference[0][axis]
        kept[axis] = error[axis]
    at = fleet.taken[robot, now, 0]
    seen, noise = past[(instant - (now - at)) % past.shape[0]], fleet.noise[robot, at]
    measured = seen[0] + noise[0], seen[1] + noise[1], seen[2] + noise[2]
    put_vector(observation, table, SPATIAL_ENTRY.position_error, measured)
    put_vector(observation, table, SPATIAL_ENTRY.reference_velocity, reference[1])
    put_vector(observation, table, SPATIAL_ENTRY.reference_acceleration, reference[2])
    noises, angles = fleet.other_noise[robot, now][AXES:], fleet.attitude_error[robot]
    face(row, lanes, lane, plant, reference, measured, noises, table, angles, observation)
    measure_joints(row, lanes, lane, plant.links, noises, table, observation)
    measure_thrusters(row, lanes, lane, plant.links, plant.thrusters, table, observation)
    period = plant.substeps * plant.h
    put(observation, table, SPATIAL_ENTRY.position_age, 0, (now - at) * period)
    at = fleet.taken[robot, now, 1]
    age, velocity = -1.0, (0.0, 0.0, 0.0)
    if at >= 0:
        age = (now - at) * period
        seen, noises = past[(instant - (now - at)) % past.shape[0]], fleet.other_noise[robot, at]
        velocity = seen[3] + noises[0], seen[4] + noises[1], seen[5] + noises[2]
    put_vector(observation, table, SPATIAL_ENTRY.velocity, velocity)
    put(observation, table, SPATIAL_ENTRY.velocity_age, 0, age)
    if plant.steering > 0:
        observe_head_in_space(fleet, plant, table, robot, lanes)
    for k in range(observation.size):
        observation[k] = min(max(observation[k], -table.bound[k]), table.bound[k])


@piece
def asked(row, lanes, lane, plant, quantity):
    """A number of the guidance of one robot."""
    first = rows.body_rows(plant.links, plant.thrusters)
    return number(row, lanes, lane, first + quantity)


@piece
def asked_position(row, lanes, lane, plant):
    """The reference of one robot, as of `path_in_space`."""
    return path_in_space(
        number(row, lanes, lane, rows.CLOCK) * plant.h,
        asked(row, lanes, lane, plant, guidance.SPEED),
        asked(row, lanes, lane, plant, guidance.SWAY),
        asked(row, lanes, lane, plant, guidance.SWAY_FREQUENCY),
        asked(row, lanes, lane, plant, guidance.HEAVE),
        asked(row, lanes, lane, plant, guidance.HEAVE_FREQUENCY),
        asked(row, lanes, lane, plant, guidance.RAMP),
    )


@piece
def face(row, lanes, lane, plant, reference, measured, noises, table, angles, observation):
    """Fill in the attitude, as it is and as it is measured, and its reference.

    Args:
        row: Block of the robot.
        lanes: Robots in a block.
        lane: Place of the robot in its block.
        plant: What all robots share.
        reference: What `path_in_space` has returned.
        measured: Position error as it is measured, m.
        noises: Errors of the measured angles and rates, see `measure_attitude`.
        table: Table of the observation.
        angles: Where to write how far pitch, yaw and roll are from what is asked for on board, rad,
            (3,).
        observation: Where to write the observation.
    """
    y, z = measured[1], measured[2]
    y_dot, z_dot = 0.0, 0.0
    if asked(row, lanes, lane, plant, guidance.CROSS_TRACK) == 0.0:
        y, z = y + reference[0][1], z + reference[0][2]
        y_dot, z_dot = reference[1][1], reference[1][2]
    look_ahead = asked(row, lanes, lane, plant, guidance.LOOK_AHEAD)
    pitch, yaw = sight_in_space(y, z, look_ahead)
    rates = sight_rates(y, z, y_dot, z_dot, look_ahead)
    q, omega = attitude_of(row, lanes, lane), vector(row, lanes, lane, rows.W)
    roll_error, pitch_error, yaw_error = attitude_error(q, pitch, yaw)
    angles[0], angles[1], angles[2] = pitch_error, yaw_error, roll_error
    q = measure_attitude(q, omega, noises, plant.links - 1, table, observation)
    roll_error, pitch_error, yaw_error = attitude_error(q, pitch, yaw)
    put(observation, table, SPATIAL_ENTRY.pitch_error, 0, pitch_error)
    put(observation, table, SPATIAL_ENTRY.yaw_error, 0, yaw_error)
    put(observation, table, SPATIAL_ENTRY.roll_error, 0, roll_error)
    put(observation, table, SPATIAL_ENTRY.reference_rates, 0, rates[0])
    put(observation, table, SPATIAL_ENTRY.reference_rates, 1, rates[1])


@piece
def run(fleet, plant, table, actions, like, lanes, stride, first, last):
    """One control period of blocks `first` to `last`: command, advance, measure."""
    size, thrusters = actions.shape[0], plant.thrusters
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
class SpatialWorld(World):
    """A robot in space, and its path there.

    Attributes:
        robot: The robot.
    """

    robot: SpatialRobot
    axes: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    attitude: ClassVar[tuple[str, ...]] = ("pitch", "yaw")
    watched: ClassVar[tuple[str, ...]] = ("roll",)
    kernels: ClassVar[Kernels] = Kernels(observe, run_singles, run_lanes, run_threads)

    @cached_property
    def layout(self) -> SpatialLayout:
        """The table of the observation."""
        return SpatialLayout(self.links - 1, self.thrusters)

    @property
    def links(self) -> int:
        """Links of the robot."""
        return len(self.robot.links)

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
        """Inertia, kg, and linear drag, N s/m, along x, y and z, (3,); see `World`."""
        return self.robot.straight_body

    @property
    def rows(self) -> int:
        """Rows of the body, then those of guidance."""
        return self._guidance + guidance.GUIDANCE_ROWS

    @cached_property
    def quantities(self) -> Mapping[str, slice]:
        """Rows by name, SI units.

        `position`, `velocity`, `acceleration` (of the middle of the last step) are those of the
        middle of the middle link, in the global frame, `attitude` its quaternion,
        `angular_velocity` in its axes; `force` has the thrusters' forces, which lag behind
        `command`, `coefficients` the true hydrodynamic ones; joint i is asked for
        `pan_shares[i] * pan[0] + tilt_shares[i] * tilt[0]`, where `pan` and `tilt` have the angle,
        its rate and its acceleration.
        """
        links, thrusters, joints = self.links, self.thrusters, self.links - 1
        starts = {
            "position": (rows.P, 3),
            "velocity": (rows.V, 3),
            "acceleration": (rows.A, 3),
            "attitude": (rows.Q, 4),
            "angular_velocity": (rows.W, 3),
            "joint_angles": (rows.row_of(rows.PHI, links), joints),
            "joint_rates": (rows.row_of(rows.PHI_DOT, links), joints),
            "water_velocity": (rows.WATER, 3),
            "coefficients": (rows.ADDED_ALONG, 6),
            "pan_shares": (rows.row_of(rows.PAN_SHARE, links), joints),
            "tilt_shares": (rows.row_of(rows.TILT_SHARE, links), joints),
            "pan": (rows.PAN, 3),
            "tilt": (rows.TILT, 3),
            "link_factors": (rows.row_of(rows.FACTOR, links), links),
            "command": (rows.thruster_row(rows.COMMAND, links, thrusters), thrusters),
            "force": (rows.thruster_row(rows.FORCE, links, thrusters), thrusters),
            "thruster_gains": (rows.thruster_row(rows.GAIN, links, thrusters), thrusters),
        }
        return {name: slice(row, row + size) for name, (row, size) in starts.items()}

    def check(self, scenario: SpatialScenario) -> None:
        """Refuse a scenario that the robot cannot swim.

        Raises:
            ValueError: If more joints shall bend than it has, none of these is about the axis that
                a pan or a tilt needs, factors or gains do not match its links and thrusters, or the
                episode is too much work.
        """
        joints, scan = self.links - 1, scenario.scan
        allowed = f"1 to {joints}, the robot's joints"
        require(scan.bending_joints <= joints, "bending_joints", scan.bending_joints, allowed)
        able = [bool(shares.any()) for shares in scan.shares(self.robot)]
        for name, angles, possible in zip(
            ("pans", "tilts"), (scan.pans, scan.tilts), able, strict=True
        ):
            allowed = "0: none of the bending joints turns the head so"
            require(possible or not any(angles), name, angles, allowed)
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

    def write(self, scenario: SpatialScenario, row: Array) -> None:
        """Write a scenario's parameters and its start, straight and at rest, into the rows."""
        conditions, water, path = scenario.conditions, scenario.water, scenario.path
        scan, links = scenario.scan, self.links
        row[: self._guidance] = spatial_row(
            self.robot,
            self.shared(scenario, None),
            coefficients=water.coefficients,
            filter_frequency=scan.filter_frequency or 0.0,
            time_constant=conditions.thruster_time_constant,
            dead_band=conditions.thruster_dead_band,
            link_factors=water.link_factors or 1.0,
            thruster_gains=scenario.thruster_gains or 1.0,
        )
        # The centre of mass starts at the origin, where the path does.
        row[rows.P : rows.P + 3] = -self.robot.straight_centre
        row[rows.WATER : rows.WATER + 3] = row[rows.MEAN : rows.MEAN + 3] = water.current
        slow = (water.amplitude, water.phase, water.period)
        waves = ((wave.amplitude, wave.phase, wave.period) for wave in water.waves)
        for k, (amplitude, phase, period) in enumerate((slow, *waves)):
            first = rows.SINUSOID + k * rows.SINUSOID_ROWS
            row[first : first + rows.SINUSOID_ROWS] = *amplitude, *phase, 2 * np.pi / period
        shares = scan.shares(self.robot)
        for quantity, values in zip((rows.PAN_SHARE, rows.TILT_SHARE), shares, strict=True):
            first = rows.row_of(quantity, links)
            row[first : first + links - 1] = values
        shifts = len(scenario.shifts)
        at = np.divide(scenario.shifts, conditions.physics_step)
        row[rows.SHIFT_STEP : rows.SHIFT_STEP + shifts] = at
        for first, angles in ((rows.PAN_SHIFT, scan.pans), (rows.TILT_SHIFT, scan.tilts)):
            row[first : first + shifts] = np.diff(angles, prepend=0.0)[:shifts]
        row[rows.LIMIT] = conditions.thruster_limit
        row[self._guidance :] = (
            path.speed,
            path.sway,
            path.sway_frequency,
            path.heave,
            path.heave_frequency,
            path.ramp,
            scenario.look_ahead or 0.0,
            scenario.cross_track,
        )

    def shared(self, scenario: SpatialScenario, previous: SpatialPlant | None) -> SpatialPlant:
        """What all robots share; as many changes of the joint references as any of them has."""
        shifts, sinusoids = len(scenario.shifts), scenario.water.sinusoids
        if previous is not None:
            if shifts <= previous.shifts and sinusoids <= previous.sinusoids:
                return previous
            shifts, sinusoids = max(shifts, previous.shifts), max(sinusoids, previous.sinusoids)
        conditions = scenario.conditions
        return spatial_plant(
            self.robot,
            conditions.physics_step,
            substeps=conditions.substeps,
            euler=conditions.integrator == "explicit",
            shifts=shifts,
            sinusoids=sinusoids,
        )

    def truth(self, read: Callable[[str], Array]) -> dict[str, Array]:
        """True parameters and signals, in the global frame.

        Returns:
            `coefficients`, as in `SpatialRobot.hydrodynamic_coefficients`, (size, 6);
            `water_velocity`, m/s, (size, 3).
        """
        return {name: read(name) for name in ("coefficients", "water_velocity")}

    def allocate(self, observation: NDArray[np.float32], matrices: Array) -> None:
        """Fill in the allocation matrices of robots as observed; see `World.allocate`."""
        layout = self.layout
        plant, thrusters = self._posture
        spatial_allocations(observation, layout.scale, layout.starts, plant, thrusters, matrices)

    @property
    def _guidance(self) -> int:
        """The first row of guidance."""
        return rows.body_rows(self.links, self.thrusters)

    @cached_property
    def _posture(self) -> tuple[SpatialPlant, Array]:
        """What `spatial_allocations` takes of the robot."""
        places = []
        for thruster in self.robot.thrusters:
            x, y, z = thruster.position
            half = self.robot.links[thruster.link - 1].length / 2
            places.append([thruster.link - 1, x - half, y, z, *thruster.direction])
        return spatial_plant(self.robot, 0.0), np.array(places)


@world_of.register
@lru_cache
def _spatial_world(robot: SpatialRobot) -> SpatialWorld:
    return SpatialWorld(robot)
