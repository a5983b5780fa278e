"""What the nominal robot will do: its plant, run ahead from what is measured and estimated.

Link angles and rates, joint references and thruster commands are known on board; position and
velocity of the centre of mass and what the nominal model leaves out, an acceleration d, come from a
Kalman filter with the gains of `kalman`, whose prediction step is the nominal plant. The future of
the joint references is that of a critically damped filter of an assumed frequency, from their
present value, rate and acceleration. Water at rest; its current ends up in d.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.signals import Array, Model, Signals
from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.lanes import WIDTH, block_at, spread
from usm_gym.plant.layout import *
from usm_gym.plant.measure import (
    JOINT_ANGLES,
    JOINT_RATES,
    JOINT_REFERENCE_ACCELERATIONS,
    JOINT_REFERENCE_RATES,
    JOINT_REFERENCES,
    POSITION_ERROR,
    REFERENCE_ACCELERATION,
    REFERENCE_VELOCITY,
    TAIL_ANGLE,
    TAIL_RATE,
    THRUSTER_COMMAND,
    THRUSTER_LIMIT,
    value,
)
from usm_gym.plant.motion import filter_coefficients, lag_share
from usm_gym.plant.step import Plant, advance
from usm_gym.task.nominal import Nominal

# Numbers at the start of a predictor's state: (e, v, d) of x and of y.
NAMES = ("error", "rate", "unmodelled")
ESTIMATES = 2 * len(NAMES)
# Physics steps of a prediction in a control period.
SUBSTEPS = 5
# The frequency that is assumed of the joint references' filter, rad/s.
REFERENCE_FREQUENCY = 9.0


class NominalPlant(NamedTuple):
    """The nominal robot in the form that kernels take.

    Attributes:
        plant: What the plant's kernels take.
        row: The numbers of a robot that do not change, (rows,).
        frequency: Assumed frequency of the joint references' filter, rad/s.
    """

    plant: Plant
    row: Array
    frequency: float


def nominal_plant(nominal: Nominal) -> NominalPlant:
    """The nominal robot for kernels."""
    robot = nominal.robot
    links, h = robot.links, nominal.control_period / SUBSTEPS
    row = np.zeros(rows(links, len(robot.thrusters)))
    row[C_T : LAMBDA_3 + 1] = robot.hydrodynamic_coefficients
    row[STIFFNESS], row[DAMPING] = robot.joint_stiffness, robot.joint_damping
    row[JOINT_INERTIA] = h * robot.joint_damping + h**2 * robot.joint_stiffness
    row[FILTER_DD : FILTER_DAMPING + 1] = filter_coefficients(REFERENCE_FREQUENCY, h)
    row[SHIFT_TIME] = -1.0
    row[LAG] = lag_share(nominal.thruster_time_constant, h)
    side = row_of(SIDE, links)
    row[side : side + links] = sides(links)
    plant = Plant(
        l=robot.half_length,
        m=robot.link_mass,
        J=robot.link_inertia,
        implicit=h,
        kirchhoff=1.0,
        links=links,
        thruster_links=robot.thruster_links,
        thruster_is_normal=robot.thruster_is_normal,
        h=h,
        substeps=SUBSTEPS,
        shifts=1,
        moving_water=False,
    )
    return NominalPlant(plant, row, REFERENCE_FREQUENCY)


@piece
def place_references(seen, model, frequency, block, lane):
    """Set the joint references of a robot and the deflection that they are on their way to.

    Each joint has a share of one deflection D. The vectors of references, rates and accelerations
    are all multiples of the shares; the shares are taken from all three together.
    """
    joints = model.links - 1
    D, rate, acceleration = 0.0, 0.0, 0.0
    for i in range(joints):
        D += value(seen, model, JOINT_REFERENCES, i)
        rate += value(seen, model, JOINT_REFERENCE_RATES, i)
        acceleration += value(seen, model, JOINT_REFERENCE_ACCELERATIONS, i)
    w = frequency
    by_rate, by_acceleration = rate / (w * w), acceleration / (w * w * w * w)
    size = D * D + rate * by_rate + acceleration * by_acceleration
    for i in range(joints):
        part = D * value(seen, model, JOINT_REFERENCES, i)
        part += by_rate * value(seen, model, JOINT_REFERENCE_RATES, i)
        part += by_acceleration * value(seen, model, JOINT_REFERENCE_ACCELERATIONS, i)
        block[(row_of(SHARE, model.links) + i) * WIDTH + lane] = part / max(size, 1e-30)
    block[DEFLECTION * WIDTH + lane] = D
    block[DEFLECTION_RATE * WIDTH + lane] = rate
    block[SHIFT_SIZE * WIDTH + lane] = D + (acceleration / w + 2.0 * rate) / w


@piece
def place(seen, model, nominal, state, applied, block, lane):
    """Put a robot where an observation and the estimates say it is.

    Args:
        seen: Observation.
        model: Nominal knowledge for reading it.
        nominal: The nominal robot.
        state: State of the predictor, of the time of the observation.
        applied: The observation that tells the commands over the coming period.
        block: Block of the robot, (rows * WIDTH,).
        lane: Its place in the block.
    """
    links, thrusters = model.links, model.thruster_links.size
    for r in range(nominal.row.size):
        block[r * WIDTH + lane] = nominal.row[r]
    theta = value(seen, model, TAIL_ANGLE, 0)
    omega = value(seen, model, TAIL_RATE, 0)
    for i in range(links):
        if i > 0:
            theta -= value(seen, model, JOINT_ANGLES, i - 1)
            omega -= value(seen, model, JOINT_RATES, i - 1)
        block[(row_of(THETA, links) + i) * WIDTH + lane] = theta
        block[(row_of(OMEGA, links) + i) * WIDTH + lane] = omega
    for axis in range(2):
        e, v, d = state[3 * axis], state[3 * axis + 1], state[3 * axis + 2]
        block[(P_X + axis) * WIDTH + lane] = e
        velocity = v + value(seen, model, REFERENCE_VELOCITY, axis)
        block[(V_X + axis) * WIDTH + lane] = velocity
        # All water accelerating by d accelerates the centre of mass by d and turns nothing.
        block[(WATER_AX + axis) * WIDTH + lane] = d
    place_references(seen, model, nominal.frequency, block, lane)
    limit = value(applied, model, THRUSTER_LIMIT, 0)
    first = first_command(links)
    for j in range(thrusters):
        command = value(applied, model, THRUSTER_COMMAND, j) * limit
        block[(first + j) * WIDTH + lane] = command
        block[(first + thrusters + j) * WIDTH + lane] = state[ESTIMATES + j]


@compiled
def advance_all(blocks, plant):
    """Advance all blocks, (blocks, rows * WIDTH), by a control period."""
    like = spread(0.0)
    for k in range(blocks.shape[0]):
        advance(block_at(blocks, k, like), like, spread(0.0), 1, plant)


@piece
def error_ahead(seen, model, time, axis, block, lane):
    """(error, rate) of a robot placed at `seen`, after `time`; the reference's jerk is left out."""
    velocity = value(seen, model, REFERENCE_VELOCITY, axis)
    acceleration = value(seen, model, REFERENCE_ACCELERATION, axis)
    e = block[(P_X + axis) * WIDTH + lane] - time * (velocity + 0.5 * time * acceleration)
    v = block[(V_X + axis) * WIDTH + lane] - velocity - time * acceleration
    return e, v


@compiled
def place_all(observation, model, nominal, state, past, blocks):
    """`place` every robot of a batch, lane by lane; lanes that are left over stay idle.

    Args:
        observation: Observations now, (batch, numbers).
        model: Nominal knowledge for reading them.
        nominal: The nominal robot.
        state: State of the predictor, (batch, size).
        past: Whether to place them as they were a period ago, with the commands known by now.
        blocks: Where to write, (blocks, rows * WIDTH).
    """
    last = ESTIMATES + model.thruster_links.size
    for b in range(observation.shape[0]):
        seen, own, block, lane = observation[b], state[b], blocks[b // WIDTH], b % WIDTH
        if past:
            place(own[last:], model, nominal, own, seen, block, lane)
        else:
            place(seen, model, nominal, own, seen, block, lane)


@compiled
def update(observation, started, model, correction, blocks, state):
    """Bring the state of a batch to the present, from its blocks and the measured position."""
    thrusters = model.thruster_links.size
    for b in range(observation.shape[0]):
        seen, own, block, lane = observation[b], state[b], blocks[b // WIDTH], b % WIDTH
        before = own[ESTIMATES + thrusters :]
        for axis in range(2):
            y, estimate = value(seen, model, POSITION_ERROR, axis), own[3 * axis : 3 * axis + 3]
            if started[b] == 0.0:
                rate = -value(seen, model, REFERENCE_VELOCITY, axis)
                estimate[0], estimate[1], estimate[2] = y, rate, 0.0
            else:
                e, v = error_ahead(before, model, model.h, axis, block, lane)
                estimate[0] = e + correction[axis, 0] * (y - e)
                estimate[1] = v + correction[axis, 1] * (y - e)
                estimate[2] += correction[axis, 2] * (y - e)
        for j in range(thrusters):
            row = first_command(model.links) + thrusters + j
            own[ESTIMATES + j] = block[row * WIDTH + lane] if started[b] > 0.0 else 0.0
        before[:] = seen


@compiled
def read_ahead(observation, model, time, blocks, ahead):
    """Read (error, rate) of a batch off its blocks, `time` after the observations."""
    for b in range(observation.shape[0]):
        for axis in range(2):
            block, lane = blocks[b // WIDTH], b % WIDTH
            ahead[b, axis] = error_ahead(observation[b], model, time, axis, block, lane)


@piece
def held_force(signals, model, b, axis):
    """Force, N, that the last commands of a robot make in an axis, its links being as they are."""
    seen, force = signals.observation[b], 0.0
    limit = value(seen, model, THRUSTER_LIMIT, 0)
    for j in range(model.thruster_links.size):
        command = value(seen, model, THRUSTER_COMMAND, j) * limit
        force += signals.allocation[b, axis, j] * command
    return force


class Predictor:
    """Estimates where the robots of a batch are, and foresees where they will be.

    Its state is an array of numbers for each robot: (e, v, d) of x and of y, the forces of the
    thrusters in N, the last observation.

    Attributes:
        size: How many numbers that is.
    """

    def __init__(self, nominal: Nominal, model: Model, correction: Array) -> None:
        """Keep the nominal robot.

        Args:
            nominal: Nominal knowledge.
            model: The same for kernels.
            correction: Gains of the filter on (e, v, d), (2, 3).
        """
        self._nominal, self._model, self._correction = nominal_plant(nominal), model, correction
        self.size = ESTIMATES + len(nominal.robot.thrusters) + model.scale.size

    def estimate(self, signals: Signals, state: Array) -> None:
        """Bring the state, (batch, size), to the present, in place."""
        blocks = self._blocks(signals, state, past=True)
        advance_all(blocks, self._nominal.plant)
        seen, started = signals.observation, signals.started
        update(seen, started, self._model, self._correction, blocks, state)

    def foresee(self, signals: Signals, state: Array, periods: int) -> Array:
        """Where estimated robots go if their last commands are held.

        Returns:
            Error and its rate after each period, m and m/s, (periods, batch, 2 axes, 2).
        """
        seen = signals.observation
        blocks = self._blocks(signals, state, past=False)
        ahead = np.empty((periods, len(seen), 2, 2))
        for i in range(periods):
            advance_all(blocks, self._nominal.plant)
            read_ahead(seen, self._model, (i + 1) * self._model.h, blocks, ahead[i])
        return ahead

    def _blocks(self, signals: Signals, state: Array, past: bool) -> Array:
        seen = signals.observation
        blocks = np.zeros((-(-len(seen) // WIDTH), self._nominal.row.size * WIDTH))
        place_all(seen, self._model, self._nominal, state, past, blocks)
        return blocks
