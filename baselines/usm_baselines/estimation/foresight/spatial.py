"""Foresight in space.

What is estimated of a robot are position and velocity of its centre of mass; the plant has those of
the middle of its middle link. The disturbance is put in as water that accelerates. It turns nothing
but for the keel, which hangs as if gravity were g - d.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation.foresight.interface import (
    COEFFICIENTS,
    CURRENT,
    SUBSTEPS,
    Foresight,
    NominalPlant,
    estimates_of,
    foresight_of,
    gains_from,
    place_steering,
    place_thrusters,
    steering_rows,
)
from usm_baselines.signals import Array
from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.lanes import WIDTH, block_at, spread
from usm_gym.plant.spatial.layout import *
from usm_gym.plant.spatial.step import advance
from usm_gym.sensors import value
from usm_gym.spatial_packing import spatial_plant, spatial_row
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.task.nominal import Nominal
from usm_gym.task.spatial_observation import SPATIAL_ENTRY as ENTRY
from usm_gym.task.spatial_observation import find_mass
from usm_gym.world import world_of

# The frequency that is assumed of the joint references' filter, rad/s.
REFERENCE_FREQUENCY = 4.0
# Added to the squares of the joints' shares, of order 1: where no joint moves, nothing does.
NO_SHARE = 1e-12


def nominal_plant(nominal: Nominal) -> NominalPlant:
    """The nominal robot for kernels."""
    robot, period = nominal.robot, nominal.control_period
    plant = spatial_plant(robot, period / SUBSTEPS, substeps=SUBSTEPS, shifts=1)
    row = spatial_row(
        robot,
        plant,
        filter_frequency=REFERENCE_FREQUENCY,
        time_constant=nominal.thruster_time_constant,
        dead_band=nominal.thruster_dead_band,
    )
    row[SHIFT_STEP] = -1.0
    plant, row = steering_rows(plant, row, nominal)
    layout = world_of(robot).layout
    return NominalPlant(plant, row, REFERENCE_FREQUENCY, layout.starts, layout.scale, period)


@piece
def bends(seen, nominal, joint):
    """Whether a joint is asked for anything."""
    asked = abs(value(seen, nominal, ENTRY.joint_references, joint))
    asked += abs(value(seen, nominal, ENTRY.joint_reference_rates, joint))
    asked += abs(value(seen, nominal, ENTRY.joint_reference_accelerations, joint))
    return asked > 0.0


@piece
def shares(plant, joint):
    """Of what pans and tilts the robot as a whole, the parts that a joint has by its axis."""
    return plant.axes[joint, 2], -plant.axes[joint, 1]


@piece
def deflections(seen, nominal, entry):
    """Pan and tilt that make the joint references, or their rates or accelerations, of `entry`."""
    plant = nominal.plant
    a, b, c, p, t = NO_SHARE, 0.0, NO_SHARE, 0.0, 0.0
    for j in range(plant.links - 1):
        if bends(seen, nominal, j):
            (pan, tilt), asked = shares(plant, j), value(seen, nominal, entry, j)
            a, b, c = a + pan * pan, b + pan * tilt, c + tilt * tilt
            p, t = p + pan * asked, t + tilt * asked
    size = a * c - b * b
    return (c * p - b * t) / size, (a * t - b * p) / size


@piece
def place_references(seen, nominal, block, lane):
    """Set the joint references of a robot and the pan and the tilt that they are on their way to.

    Joints that bend have parts of pan and tilt by their axes, as `Scan.shares` gives them; of which
    size is up to the pan and the tilt.
    """
    links, w = nominal.plant.links, nominal.frequency
    for j in range(links - 1):
        pan, tilt = shares(nominal.plant, j)
        bending = 1.0 if bends(seen, nominal, j) else 0.0
        block[(row_of(PAN_SHARE, links) + j) * WIDTH + lane] = bending * pan
        block[(row_of(TILT_SHARE, links) + j) * WIDTH + lane] = bending * tilt
    angle = deflections(seen, nominal, ENTRY.joint_references)
    rate = deflections(seen, nominal, ENTRY.joint_reference_rates)
    acceleration = deflections(seen, nominal, ENTRY.joint_reference_accelerations)
    rows = (PAN, PAN_SHIFT), (TILT, TILT_SHIFT)
    for k in range(2):
        first, shift = rows[k]
        block[first * WIDTH + lane] = angle[k]
        block[(first + 1) * WIDTH + lane] = rate[k]
        target = angle[k] + (acceleration[k] / w + 2.0 * rate[k]) / w
        block[shift * WIDTH + lane] = target


@piece
def place_posture(seen, nominal, block, lane):
    """Set attitude, joints and their rates of a robot."""
    links = nominal.plant.links
    square = 0.0
    for k in range(4):
        part = value(seen, nominal, ENTRY.attitude, k)
        square += part * part
    # Before the first observation there is none.
    if square > 0.0:
        length = math.sqrt(square)
        for k in range(4):
            block[(Q + k) * WIDTH + lane] = value(seen, nominal, ENTRY.attitude, k) / length
    for k in range(3):
        block[(W + k) * WIDTH + lane] = value(seen, nominal, ENTRY.angular_velocity, k)
    phi, phi_dot, phi_ddot = row_of(PHI, links), row_of(PHI_DOT, links), row_of(PHI_DDOT, links)
    for j in range(links - 1):
        block[(phi + j) * WIDTH + lane] = value(seen, nominal, ENTRY.joint_angles, j)
        block[(phi_dot + j) * WIDTH + lane] = value(seen, nominal, ENTRY.joint_rates, j)
        # Not measured, but stiff joints do what they are asked for.
        asked = value(seen, nominal, ENTRY.joint_reference_accelerations, j)
        block[(phi_ddot + j) * WIDTH + lane] = asked


@piece
def place(seen, nominal, state, applied, belief, middle, moving, block, lane):
    """Put a robot where an observation and the estimates say it is.

    Args:
        seen: Observation.
        nominal: The nominal robot.
        state: State of the predictor, of the time of the observation.
        applied: The observation that tells the commands over the coming period.
        belief: What it is believed to be.
        middle: Room for three numbers.
        moving: The same.
        block: Block of the robot, (rows * WIDTH,).
        lane: Its place in the block.
    """
    links, thrusters = nominal.plant.links, nominal.plant.thrusters
    for r in range(nominal.row.size):
        block[r * WIDTH + lane] = nominal.row[r]
    for k in range(CURRENT):
        block[(ADDED_ALONG + k) * WIDTH + lane] *= belief[COEFFICIENTS + k]
    for i in range(links):
        factor = belief[gains_from(AXES) + thrusters + i]
        block[(row_of(FACTOR, links) + i) * WIDTH + lane] = factor
    place_posture(seen, nominal, block, lane)
    # Where the centre of mass is and how it moves while the middle link is at rest at the origin.
    find_mass(block, WIDTH, lane, nominal.plant, middle, moving)
    for axis in range(AXES):
        e, v, d = state[3 * axis], state[3 * axis + 1], state[3 * axis + 2]
        block[(P + axis) * WIDTH + lane] = e - middle[axis]
        velocity = v + value(seen, nominal, ENTRY.reference_velocity, axis)
        block[(V + axis) * WIDTH + lane] = velocity - moving[axis]
        block[(WATER_A + axis) * WIDTH + lane] = d
        block[(WATER + axis) * WIDTH + lane] = belief[CURRENT + axis]
    if nominal.plant.steering > 0:
        place_steering(seen, nominal, ENTRY.joint_references, block, lane)
    else:
        place_references(seen, nominal, block, lane)
    rows = thruster_rows(links, thrusters)
    entries = ENTRY.thruster_command, ENTRY.thruster_limit
    gains, pushing = belief[gains_from(AXES) :], state[estimates_of(AXES) :]
    place_thrusters(applied, nominal, entries, rows, thrusters, gains, pushing, block, lane)


@compiled
def place_all(seen, nominal, state, applied, beliefs, blocks):
    """`Foresight.place`."""
    robots, copies = beliefs.shape[:2]
    middle, moving = np.empty(AXES), np.empty(AXES)
    for b in range(robots):
        for k in range(copies):
            copy = b * copies + k
            block, lane, belief = blocks[copy // WIDTH], copy % WIDTH, beliefs[b, k]
            place(seen[b], nominal, state[b], applied[b], belief, middle, moving, block, lane)


@compiled
def advance_all(blocks, plant):
    """Advance all blocks by a control period."""
    like = spread(0.0)
    for k in range(blocks.shape[0]):
        advance(block_at(blocks, k, like), like, spread(0.0), 1, plant)


@piece
def read(seen, nominal, time, middle, moving, block, lane, found):
    """Fill in (error, rate) of a robot placed at `seen`, after `time`, (axes, 2)."""
    find_mass(block, WIDTH, lane, nominal.plant, middle, moving)
    for axis in range(AXES):
        velocity = value(seen, nominal, ENTRY.reference_velocity, axis)
        acceleration = value(seen, nominal, ENTRY.reference_acceleration, axis)
        found[axis, 0] = middle[axis] - time * (velocity + 0.5 * time * acceleration)
        found[axis, 1] = moving[axis] - velocity - time * acceleration


@compiled
def run_all(seen, nominal, blocks, ahead):
    """`Foresight.run`."""
    periods, robots, copies = ahead.shape[:3]
    middle, moving = np.empty(AXES), np.empty(AXES)
    for i in range(periods):
        advance_all(blocks, nominal.plant)
        time = (i + 1) * nominal.h
        for b in range(robots):
            for k in range(copies):
                copy = b * copies + k
                block, lane, found = blocks[copy // WIDTH], copy % WIDTH, ahead[i, b, k]
                read(seen[b], nominal, time, middle, moving, block, lane, found)


class SpatialForesight(Foresight):
    """Copies of a spatial robot."""

    def __init__(self, nominal: Nominal) -> None:
        """Set up the nominal robot."""
        robot: SpatialRobot = nominal.robot
        forces = thruster_row(FORCE, len(robot.links), len(robot.thrusters))
        super().__init__(nominal_plant(nominal), robot, forces)

    def place(
        self,
        seen: NDArray[np.float32],
        state: Array,
        applied: NDArray[np.float32],
        beliefs: Array,
        blocks: Array,
    ) -> None:
        """Write the copies into blocks of zeros."""
        place_all(seen, self.nominal, state, applied, beliefs, blocks)

    def run(self, seen: NDArray[np.float32], blocks: Array, ahead: Array) -> None:
        """Hold the commands, and fill in error and rate after each control period."""
        run_all(seen, self.nominal, blocks, ahead)


@foresight_of.register
def _spatial_foresight(robot: SpatialRobot, nominal: Nominal) -> SpatialForesight:
    return SpatialForesight(nominal)
