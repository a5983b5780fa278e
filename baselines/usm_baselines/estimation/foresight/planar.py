"""Foresight in the plane."""

from __future__ import annotations

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
from usm_gym.packing import body_row, plant_of
from usm_gym.plant.layout import *
from usm_gym.plant.step import advance
from usm_gym.robot import Robot
from usm_gym.sensors import value
from usm_gym.task.nominal import Nominal
from usm_gym.task.observation import ENTRY
from usm_gym.world import world_of

AXES = 2
# The frequency that is assumed of the joint references' filter, rad/s.
REFERENCE_FREQUENCY = 9.0


def nominal_plant(nominal: Nominal) -> NominalPlant:
    """The nominal robot for kernels."""
    robot, period = nominal.robot, nominal.control_period
    plant = plant_of(robot, period / SUBSTEPS, substeps=SUBSTEPS, shifts=1)
    row = body_row(
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
def place_references(seen, nominal, block, lane):
    """Set the joint references of a robot and the deflection that they are on their way to.

    Each joint has a share of one deflection D. The vectors of references, rates and accelerations
    are all multiples of the shares; the shares are taken from all three together.
    """
    links = nominal.plant.links
    joints = links - 1
    D, rate, acceleration = 0.0, 0.0, 0.0
    for i in range(joints):
        D += value(seen, nominal, ENTRY.joint_references, i)
        rate += value(seen, nominal, ENTRY.joint_reference_rates, i)
        acceleration += value(seen, nominal, ENTRY.joint_reference_accelerations, i)
    w = nominal.frequency
    by_rate, by_acceleration = rate / (w * w), acceleration / (w * w * w * w)
    size = D * D + rate * by_rate + acceleration * by_acceleration
    for i in range(joints):
        part = D * value(seen, nominal, ENTRY.joint_references, i)
        part += by_rate * value(seen, nominal, ENTRY.joint_reference_rates, i)
        part += by_acceleration * value(seen, nominal, ENTRY.joint_reference_accelerations, i)
        block[(row_of(SHARE, links) + i) * WIDTH + lane] = part / max(size, 1e-30)
    block[DEFLECTION * WIDTH + lane] = D
    block[DEFLECTION_RATE * WIDTH + lane] = rate
    block[SHIFT_SIZE * WIDTH + lane] = D + (acceleration / w + 2.0 * rate) / w


@piece
def place(seen, nominal, state, applied, belief, block, lane):
    """Put a robot where an observation and the estimates say it is.

    Args:
        seen: Observation.
        nominal: The nominal robot.
        state: State of the predictor, of the time of the observation.
        applied: The observation that tells the commands over the coming period.
        belief: What it is believed to be.
        block: Block of the robot, (rows * WIDTH,).
        lane: Its place in the block.
    """
    links, thrusters = nominal.plant.links, nominal.plant.thruster_links.size
    for r in range(nominal.row.size):
        block[r * WIDTH + lane] = nominal.row[r]
    for k in range(CURRENT):
        block[(C_T + k) * WIDTH + lane] *= belief[COEFFICIENTS + k]
    for i in range(links):
        factor = belief[gains_from(AXES) + thrusters + i]
        block[(row_of(FACTOR, links) + i) * WIDTH + lane] = factor
    theta = value(seen, nominal, ENTRY.tail_angle, 0)
    omega = value(seen, nominal, ENTRY.tail_rate, 0)
    for i in range(links):
        if i > 0:
            theta -= value(seen, nominal, ENTRY.joint_angles, i - 1)
            omega -= value(seen, nominal, ENTRY.joint_rates, i - 1)
        block[(row_of(THETA, links) + i) * WIDTH + lane] = theta
        block[(row_of(OMEGA, links) + i) * WIDTH + lane] = omega
    for axis in range(AXES):
        e, v, d = state[3 * axis], state[3 * axis + 1], state[3 * axis + 2]
        block[(P_X + axis) * WIDTH + lane] = e
        velocity = v + value(seen, nominal, ENTRY.reference_velocity, axis)
        block[(V_X + axis) * WIDTH + lane] = velocity
        # All water accelerating by d accelerates the centre of mass by d and turns nothing.
        block[(WATER_AX + axis) * WIDTH + lane] = d
        block[(WATER_X + axis) * WIDTH + lane] = belief[CURRENT + axis]
    if nominal.plant.steering > 0:
        place_steering(seen, nominal, ENTRY.joint_references, block, lane)
    else:
        place_references(seen, nominal, block, lane)
    rows = thruster_rows(links, thrusters)
    entries = ENTRY.thruster_command, ENTRY.thruster_limit
    gains, pushing = belief[gains_from(AXES) :], state[estimates_of(AXES) :]
    place_thrusters(applied, nominal, entries, rows, thrusters, gains, pushing, block, lane)


@piece
def error_ahead(seen, nominal, time, axis, block, lane):
    """(error, rate) of a robot placed at `seen`, after `time`; the reference's jerk is left out."""
    velocity = value(seen, nominal, ENTRY.reference_velocity, axis)
    acceleration = value(seen, nominal, ENTRY.reference_acceleration, axis)
    e = block[(P_X + axis) * WIDTH + lane] - time * (velocity + 0.5 * time * acceleration)
    v = block[(V_X + axis) * WIDTH + lane] - velocity - time * acceleration
    return e, v


@compiled
def place_all(seen, nominal, state, applied, beliefs, blocks):
    """`Foresight.place`."""
    robots, copies = beliefs.shape[:2]
    for b in range(robots):
        for k in range(copies):
            copy = b * copies + k
            block, lane = blocks[copy // WIDTH], copy % WIDTH
            place(seen[b], nominal, state[b], applied[b], beliefs[b, k], block, lane)


@compiled
def advance_all(blocks, plant):
    """Advance all blocks by a control period."""
    like = spread(0.0)
    for k in range(blocks.shape[0]):
        advance(block_at(blocks, k, like), like, spread(0.0), 1, plant)


@compiled
def run_all(seen, nominal, blocks, ahead):
    """`Foresight.run`."""
    periods, robots, copies = ahead.shape[:3]
    for i in range(periods):
        advance_all(blocks, nominal.plant)
        time = (i + 1) * nominal.h
        for b in range(robots):
            for k in range(copies):
                copy = b * copies + k
                block, lane = blocks[copy // WIDTH], copy % WIDTH
                for axis in range(AXES):
                    found = error_ahead(seen[b], nominal, time, axis, block, lane)
                    ahead[i, b, k, axis, 0], ahead[i, b, k, axis, 1] = found


class PlanarForesight(Foresight):
    """Copies of the planar robot."""

    def __init__(self, nominal: Nominal) -> None:
        """Set up the nominal robot."""
        robot: Robot = nominal.robot
        forces = thruster_row(FORCE, robot.links, len(robot.thrusters))
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
def _planar_foresight(robot: Robot, nominal: Nominal) -> PlanarForesight:
    return PlanarForesight(nominal)
