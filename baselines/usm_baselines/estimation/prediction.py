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
from numpy.typing import NDArray

from usm_baselines.estimation import kalman
from usm_baselines.estimation.late_filter import memory_size, navigate
from usm_baselines.estimation.navigator import is_needed, navigation, transition_of
from usm_baselines.signals import Array, Signals, commanded
from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.lanes import WIDTH, block_at, spread
from usm_gym.packing import body_row, plant_of
from usm_gym.planar_world import PlanarWorld
from usm_gym.plant.chain import Plant
from usm_gym.plant.layout import *
from usm_gym.plant.step import advance
from usm_gym.plant.thrusters import delivered
from usm_gym.robot import Robot
from usm_gym.sensors import value
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal
from usm_gym.task.observation import ENTRY
from usm_gym.world import world_of

# Axes of the plane that the robot is in; numbers at the start of a predictor's state, its NAMES in
# each axis.
AXES = len(PlanarWorld.axes)
NAMES = ("error", "rate", "unmodelled")
ESTIMATES = AXES * len(NAMES)
# A belief about a robot: true over nominal coefficients, the current in m/s, then the force of each
# thruster over its command, then the coefficients of each link over those common to all.
COEFFICIENTS, CURRENT, THRUSTER_GAINS = 0, 6, 8
# Physics steps of a prediction in a control period.
SUBSTEPS = 5
# The frequency that is assumed of the joint references' filter, rad/s.
REFERENCE_FREQUENCY = 9.0


class NominalPlant(NamedTuple):
    """The nominal robot in the form that kernels take, and how its observations are read.

    Attributes:
        plant: What the plant's kernels take.
        row: The numbers of a robot that do not change, (rows,).
        frequency: Assumed frequency of the joint references' filter, rad/s.
        starts: First indices of the observation's entries.
        scale: Physical value over observed value, by number.
        h: Control period, s.
    """

    plant: Plant
    row: Array
    frequency: float
    starts: NDArray[np.int64]
    scale: Array
    h: float


def nominal_plant(nominal: Nominal) -> NominalPlant:
    """The nominal robot for kernels.

    Raises:
        ValueError: If it is not the planar robot.
    """
    robot, period = nominal.robot, nominal.control_period
    require(isinstance(robot, Robot), "robot", type(robot).__name__, "the planar robot")
    plant = plant_of(robot, period / SUBSTEPS, substeps=SUBSTEPS, shifts=1)
    row = body_row(
        robot,
        plant,
        filter_frequency=REFERENCE_FREQUENCY,
        time_constant=nominal.thruster_time_constant,
        dead_band=nominal.thruster_dead_band,
    )
    row[SHIFT_STEP] = -1.0
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
        factor = belief[THRUSTER_GAINS + thrusters + i]
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
    place_references(seen, nominal, block, lane)
    limit = value(applied, nominal, ENTRY.thruster_limit, 0)
    forces = thruster_row(FORCE, links, thrusters)
    targets = thruster_row(TARGET, links, thrusters)
    for j in range(thrusters):
        command = value(applied, nominal, ENTRY.thruster_command, j) * limit
        gain = belief[THRUSTER_GAINS + j]
        target = delivered(command, gain, nominal.row[DEAD_BAND])
        block[(targets + j) * WIDTH + lane] = target
        block[(forces + j) * WIDTH + lane] = state[ESTIMATES + j]


@compiled
def advance_all(blocks, plant):
    """Advance all blocks, (blocks, rows * WIDTH), by a control period."""
    like = spread(0.0)
    for k in range(blocks.shape[0]):
        advance(block_at(blocks, k, like), like, spread(0.0), 1, plant)


@piece
def error_ahead(seen, nominal, time, axis, block, lane):
    """(error, rate) of a robot placed at `seen`, after `time`; the reference's jerk is left out."""
    velocity = value(seen, nominal, ENTRY.reference_velocity, axis)
    acceleration = value(seen, nominal, ENTRY.reference_acceleration, axis)
    e = block[(P_X + axis) * WIDTH + lane] - time * (velocity + 0.5 * time * acceleration)
    v = block[(V_X + axis) * WIDTH + lane] - velocity - time * acceleration
    return e, v


@compiled
def place_all(observation, nominal, state, past, beliefs, blocks):
    """`place` every robot of a batch, lane by lane; lanes that are left over stay idle.

    Args:
        observation: Observations now, (batch, numbers).
        nominal: The nominal robot.
        state: State of the predictor, (batch, size).
        past: Whether to place them as they were a period ago, with the commands known by now.
        beliefs: What they are believed to be, (batch, numbers).
        blocks: Where to write, (blocks, rows * WIDTH).
    """
    last = ESTIMATES + nominal.plant.thruster_links.size
    for b in range(observation.shape[0]):
        seen, own, block, lane = observation[b], state[b], blocks[b // WIDTH], b % WIDTH
        if past:
            place(own[last:], nominal, own, seen, beliefs[b], block, lane)
        else:
            place(seen, nominal, own, seen, beliefs[b], block, lane)


@piece
def predicted(seen, before, started, nominal, block, lane, axis, estimate):
    """Fill in (e, v, d) of an axis as the block predicts it for now; at the start, as measured."""
    if started == 0.0:
        y = value(seen, nominal, ENTRY.position_error, axis)
        rate = -value(seen, nominal, ENTRY.reference_velocity, axis)
        estimate[0], estimate[1], estimate[2] = y, rate, 0.0
    else:
        e, v = error_ahead(before, nominal, nominal.h, axis, block, lane)
        estimate[0], estimate[1] = e, v


@piece
def note(seen, started, nominal, block, lane, own):
    """Keep the thrusters' forces and the observation of a robot for the next period."""
    thrusters = nominal.plant.thruster_links.size
    forces = thruster_row(FORCE, nominal.plant.links, thrusters)
    for j in range(thrusters):
        own[ESTIMATES + j] = block[(forces + j) * WIDTH + lane] if started > 0.0 else 0.0
    for k in range(seen.size):
        own[ESTIMATES + thrusters + k] = seen[k]


@compiled
def update(signals, nominal, correction, blocks, state):
    """Bring the state of a batch to the present, by the stationary filter of gain `correction`."""
    last = ESTIMATES + nominal.plant.thruster_links.size
    for b in range(signals.observation.shape[0]):
        seen, own, block, lane = signals.observation[b], state[b], blocks[b // WIDTH], b % WIDTH
        started = signals.started[b]
        for axis in range(AXES):
            estimate = own[3 * axis : 3 * axis + 3]
            predicted(seen, own[last:], started, nominal, block, lane, axis, estimate)
            if started > 0.0 and signals.fresh[b]:
                off = value(seen, nominal, ENTRY.position_error, axis) - estimate[0]
                for i in range(3):
                    estimate[i] += correction[axis, i] * off
        note(seen, started, nominal, block, lane, own)


@compiled
def update_late(signals, nominal, nav, transition, blocks, state):
    """The same by the filter `nav` of `navigator`, whose memory comes last in the state."""
    last = ESTIMATES + nominal.plant.thruster_links.size
    estimate = np.empty(ESTIMATES)
    for b in range(signals.observation.shape[0]):
        seen, own, block, lane = signals.observation[b], state[b], blocks[b // WIDTH], b % WIDTH
        started = signals.started[b]
        estimate[:] = own[:ESTIMATES]
        for axis in range(AXES):
            mine = estimate[3 * axis : 3 * axis + 3]
            predicted(seen, own[last:], started, nominal, block, lane, axis, mine)
        navigate(seen, nav, started, transition, estimate, own[last + seen.size :])
        own[:ESTIMATES] = estimate
        note(seen, started, nominal, block, lane, own)


@compiled
def hold_all(observation, nominal, blocks, ahead):
    """Hold the commands of a batch; fills in (error, rate) after each period."""
    for i in range(ahead.shape[0]):
        advance_all(blocks, nominal.plant)
        time = (i + 1) * nominal.h
        for b in range(observation.shape[0]):
            for axis in range(AXES):
                block, lane = blocks[b // WIDTH], b % WIDTH
                ahead[i, b, axis] = error_ahead(observation[b], nominal, time, axis, block, lane)


@piece
def held_force(signals, model, belief, b, axis):
    """Force, N, that the last commands of a robot make in an axis, its links being as they are."""
    force = 0.0
    for j in range(model.thrusters):
        share = signals.allocation[b, axis, j] * belief[THRUSTER_GAINS + j]
        force += share * commanded(signals.observation[b], model, j)
    return force


@compiled
def tell(signals, mass, state):
    """Fill in the estimates among the signals from the state of a predictor, (batch, size)."""
    for b in range(signals.y.shape[0]):
        for axis in range(AXES):
            first, thrust = len(NAMES) * axis, 0.0
            signals.y[b, axis] = state[b, first]
            signals.rate[b, axis] = state[b, first + 1]
            signals.disturbance[b, axis] = state[b, first + 2]
            for j in range(signals.allocation.shape[2]):
                thrust += signals.allocation[b, axis, j] * state[b, ESTIMATES + j]
            signals.thrust[b, axis] = thrust / mass


def believed(signals: Signals, state: Array) -> Array:
    """The state of a predictor with the estimates that are among the signals."""
    changed, each = state.copy(), len(NAMES)
    changed[:, 0:ESTIMATES:each] = signals.y
    changed[:, 1:ESTIMATES:each] = signals.rate
    changed[:, 2:ESTIMATES:each] = signals.disturbance
    return changed


class Predictor:
    """Estimates where the robots of a batch are, and foresees where they will be.

    Its state is an array of numbers for each robot: (e, v, d) of each axis, the forces of the
    thrusters in N, the last observation, and where positions come late or rarely, the memory of a
    navigator.

    Attributes:
        size: How many numbers that is.
    """

    def __init__(
        self, nominal: Nominal, acceleration_noise: float, disturbance_noise: float
    ) -> None:
        """Keep the nominal robot, and set up the filter.

        Args:
            nominal: Nominal knowledge.
            acceleration_noise: Spectral density of what drives v, m/s^2 / sqrt(Hz).
            disturbance_noise: Spectral density of what drives d, m/s^3 / sqrt(Hz).

        Raises:
            ValueError: If the robot is not the planar one, or a density is not above 0.
        """
        self._nominal = nominal_plant(nominal)
        densities = acceleration_noise, disturbance_noise
        self._linear = kalman.linear_model(nominal, *densities)
        self._filter = navigation(nominal, *densities) if is_needed(nominal) else None
        links, self._thrusters = nominal.robot.links, len(nominal.robot.thrusters)
        self._neutral = np.ones(THRUSTER_GAINS + self._thrusters + links)
        self._neutral[CURRENT:THRUSTER_GAINS] = 0.0
        self.size = ESTIMATES + self._thrusters + self._nominal.scale.size
        self.size += memory_size(self._filter) if self._filter else 0

    def beliefs(self, state: Array) -> Array:
        """What the robots of a batch are believed to be, (batch, numbers): here the nominal one."""
        beliefs = np.empty((len(state), self._neutral.size))
        beliefs[:] = self._neutral
        return beliefs

    def estimate(self, signals: Signals, state: Array) -> None:
        """Bring the state, (batch, size), to the present, in place."""
        blocks = self._blocks(signals, state, past=True)
        advance_all(blocks, self._nominal.plant)
        if self._filter is None:
            update(signals, self._nominal, self._linear.correction, blocks, state)
        else:
            transition = transition_of(self._linear, ESTIMATES)
            update_late(signals, self._nominal, self._filter, transition, blocks, state)

    def miss(self, signals: Signals, state: Array, rate: Array) -> Array:
        """What the plant, as it was believed to be, has left out over the past period.

        Args:
            signals: What was measured and applied.
            state: State of a period ago, the true errors and rates among its estimates and a
                disturbance of 0, (batch, size).
            rate: True rates of the error now, m/s, (batch, axes).

        Returns:
            The mean acceleration that was left out, m/s^2, (batch, axes).
        """
        blocks = self._blocks(signals, state, past=True)
        advance_all(blocks, self._nominal.plant)
        moved = state.copy()
        update(signals, self._nominal, np.zeros((AXES, len(NAMES))), blocks, moved)
        missed: Array = (rate - moved[:, 1:ESTIMATES:3]) / self._nominal.h
        return missed

    def foresee(self, signals: Signals, state: Array, periods: int) -> Array:
        """Where estimated robots go if their last commands are held.

        Returns:
            Error and its rate after each period, m and m/s, (periods, batch, 2 axes, 2).
        """
        seen = signals.observation
        blocks = self._blocks(signals, state, past=False)
        ahead = np.empty((periods, len(seen), 2, 2))
        hold_all(seen, self._nominal, blocks, ahead)
        return ahead

    def _blocks(self, signals: Signals, state: Array, past: bool) -> Array:
        seen = signals.observation
        blocks = np.zeros((-(-len(seen) // WIDTH), self._nominal.row.size * WIDTH))
        place_all(seen, self._nominal, state, past, self.beliefs(state), blocks)
        return blocks
