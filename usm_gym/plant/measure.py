"""What is measured of a robot at a control instant, and what is asked of its thrusters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import piece
from usm_gym.plant.layout import *
from usm_gym.plant.motion import line_of_sight, path

# The quantities of an observation in order; `usm_gym.task.observation` says what they are.
ENTRIES = (
    "position_error",
    "reference_velocity",
    "reference_acceleration",
    "tail_angle",
    "tail_rate",
    "joint_angles",
    "joint_rates",
    "joint_references",
    "joint_reference_rates",
    "joint_reference_accelerations",
    "heading_error",
    "thruster_command",
    "thruster_limit",
)
(
    POSITION_ERROR,
    REFERENCE_VELOCITY,
    REFERENCE_ACCELERATION,
    TAIL_ANGLE,
    TAIL_RATE,
    JOINT_ANGLES,
    JOINT_RATES,
    JOINT_REFERENCES,
    JOINT_REFERENCE_RATES,
    JOINT_REFERENCE_ACCELERATIONS,
    HEADING_ERROR,
    THRUSTER_COMMAND,
    THRUSTER_LIMIT,
) = range(len(ENTRIES))


class Table(NamedTuple):
    """The layout of the observation, for kernels.

    Attributes:
        starts: First index of each entry, and the size of the whole, int64.
        gain: Observed value over physical value of each number.
        bound: Bound of each observed number, float32.
    """

    starts: NDArray[np.int64]
    gain: NDArray[np.float64]
    bound: NDArray[np.float32]


@piece
def value(observation, table, entry, index):
    """One number of an observation in its physical unit.

    `table` has the fields `starts`, as in `Table`, and `scale`, physical value over observed value.
    """
    k = table.starts[entry] + index
    return observation[k] * table.scale[k]


@piece
def command(row, lanes, lane, links, action):
    """Set the thruster commands of one robot from its action in [-1, 1]; beyond it saturates.

    `row` is the block of the robot, shape (rows * lanes,), and `lane` its place in it.

    Returns:
        The mean absolute command, N.
    """
    limit = row[LIMIT * lanes + lane]
    effort = 0.0
    for j in range(action.size):
        share = min(max(float(action[j]), -1.0), 1.0)
        row[(first_command(links) + j) * lanes + lane] = share * limit
        effort += abs(share * limit)
    return effort / action.size


@piece
def measure(row, lanes, lane, links, h, noise, table, error, observation):
    """Fill in the true position error (m) and the observation of one robot.

    Args:
        row: Block of the robot.
        lanes: Robots in a block.
        lane: Place of the robot in its block.
        links: Number of links.
        h: Physics step, s.
        noise: Measurement error of the position now, m, (2,).
        table: Layout of the observation.
        error: Where to write the true position error, (2,).
        observation: Where to write the observation.

    Returns:
        The heading error as it is known on board, rad.
    """
    starts, gain, bound = table
    t = row[CLOCK * lanes + lane] * h
    p_x, p_y, v_x, v_y, a_x, a_y = path(
        t,
        row[SPEED * lanes + lane],
        row[SWAY * lanes + lane],
        row[FREQUENCY * lanes + lane],
        row[RAMP * lanes + lane],
    )
    error[0] = row[P_X * lanes + lane] - p_x
    error[1] = row[P_Y * lanes + lane] - p_y
    k = starts[POSITION_ERROR]
    observation[k] = (error[0] + noise[0]) * gain[k]
    observation[k + 1] = (error[1] + noise[1]) * gain[k + 1]
    k = starts[REFERENCE_VELOCITY]
    observation[k] = v_x * gain[k]
    observation[k + 1] = v_y * gain[k + 1]
    k = starts[REFERENCE_ACCELERATION]
    observation[k] = a_x * gain[k]
    observation[k + 1] = a_y * gain[k + 1]

    angles, rates, shares = row_of(THETA, links), row_of(OMEGA, links), row_of(SHARE, links)
    theta = row[angles * lanes + lane]
    omega = row[rates * lanes + lane]
    observation[starts[TAIL_ANGLE]] = theta * gain[starts[TAIL_ANGLE]]
    observation[starts[TAIL_RATE]] = omega * gain[starts[TAIL_RATE]]
    reference = row[DEFLECTION * lanes + lane]
    reference_rate = row[DEFLECTION_RATE * lanes + lane]
    reference_acceleration = row[DEFLECTION_ACCELERATION * lanes + lane]
    heading = theta
    for i in range(links - 1):
        theta_next = row[(angles + i + 1) * lanes + lane]
        omega_next = row[(rates + i + 1) * lanes + lane]
        share = row[(shares + i) * lanes + lane]
        k = starts[JOINT_ANGLES] + i
        observation[k] = (theta - theta_next) * gain[k]
        k = starts[JOINT_RATES] + i
        observation[k] = (omega - omega_next) * gain[k]
        k = starts[JOINT_REFERENCES] + i
        observation[k] = share * reference * gain[k]
        k = starts[JOINT_REFERENCE_RATES] + i
        observation[k] = share * reference_rate * gain[k]
        k = starts[JOINT_REFERENCE_ACCELERATIONS] + i
        observation[k] = share * reference_acceleration * gain[k]
        theta, omega = theta_next, omega_next
        heading += theta
    heading = theta if row[HEAD_HEADING * lanes + lane] > 0.0 else heading / links
    distance = row[P_Y * lanes + lane] + noise[1]
    if row[CROSS_TRACK * lanes + lane] > 0.0:
        distance -= p_y
    heading_error = heading - line_of_sight(distance, row[LOOK_AHEAD * lanes + lane])
    k = starts[HEADING_ERROR]
    observation[k] = heading_error * gain[k]

    limit = row[LIMIT * lanes + lane]
    commands = first_command(links)
    k = starts[THRUSTER_COMMAND]
    for j in range(starts[THRUSTER_LIMIT] - k):
        observation[k + j] = row[(commands + j) * lanes + lane] / limit * gain[k + j]
    k = starts[THRUSTER_LIMIT]
    observation[k] = limit * gain[k]
    for k in range(observation.size):
        observation[k] = min(max(observation[k], -bound[k]), bound[k])
    return heading_error
