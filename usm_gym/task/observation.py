"""The observation: the one table of what is in it, in which unit, scale and bounds; its filling."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import sincos
from usm_gym.plant.layout import *
from usm_gym.plant.push import allocation_matrix
from usm_gym.sensors import Entry, Layout
from usm_gym.task.guidance import *


@dataclass(frozen=True)
class ObservationLayout(Layout):
    """The layout of the observation of a robot, the same in both modes.

    Attributes:
        links: Number of links.
        thrusters: Number of thrusters.
    """

    links: int
    thrusters: int

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All entries in order."""
        joints, thrusters = self.links - 1, self.thrusters
        return (
            Entry(
                "position_error",
                2,
                "m",
                0.01,
                0.5,
                "position minus its reference (x, y) at the time of measurement, global frame",
            ),
            Entry("reference_velocity", 2, "m/s", 0.1, 5.0, "velocity of the reference (x, y)"),
            Entry(
                "reference_acceleration",
                2,
                "m/s^2",
                0.1,
                5.0,
                "acceleration of the reference (x, y)",
            ),
            Entry("tail_angle", 1, "rad", 1.0, 100.0, "angle of link 1, never wrapped (compass)"),
            Entry("tail_rate", 1, "rad/s", 1.0, 100.0, "its rate (gyro)"),
            Entry(
                "joint_angles",
                joints,
                "rad",
                0.1,
                10.0,
                "theta_i - theta_(i+1), from the tail (encoders)",
            ),
            Entry("joint_rates", joints, "rad/s", 0.5, 100.0, "their rates (encoders)"),
            Entry("joint_references", joints, "rad", 0.1, 10.0, "joint references, from the tail"),
            Entry("joint_reference_rates", joints, "rad/s", 0.5, 100.0, "their rates"),
            Entry(
                "joint_reference_accelerations",
                joints,
                "rad/s^2",
                5.0,
                1000.0,
                "their accelerations",
            ),
            Entry("heading_error", 1, "rad", 0.1, 100.0, "heading minus its reference"),
            Entry(
                "thruster_command",
                thrusters,
                "1",
                1.0,
                1.1,
                "command in effect over the thruster limit, after saturation",
            ),
            Entry("thruster_limit", 1, "N", 20.0, 1000.0, "largest command of a thruster"),
            Entry(
                "position_age",
                1,
                "s",
                1.0,
                10_000.0,
                "time since the position was measured",
            ),
            Entry(
                "velocity",
                2,
                "m/s",
                0.1,
                10.0,
                "velocity over ground (x, y) at the time of its measurement; 0 without a sensor",
            ),
            Entry(
                "velocity_age",
                1,
                "s",
                1.0,
                10_000.0,
                "time since the velocity was measured; -1 without a sensor",
            ),
        )


# The number of each entry in the order of the table, by name.
_NAMES = [entry.name for entry in ObservationLayout(links=2, thrusters=3).entries]
ENTRY: Any = namedtuple("ENTRY", _NAMES)(*range(len(_NAMES)))


@piece
def number(row, lanes, lane, index):
    """Number `index` of one robot of a block."""
    return row[index * lanes + lane]


@piece
def find_error(row, lanes, lane, plant, error):
    """Fill in the true position error of one robot, m, (2,).

    Returns:
        The reference (p_x, p_y, v_x, v_y, a_x, a_y).
    """
    guidance = body_rows(plant.links, plant.thruster_links.size)
    reference = path(
        number(row, lanes, lane, CLOCK) * plant.h,
        number(row, lanes, lane, guidance + SPEED),
        number(row, lanes, lane, guidance + SWAY),
        number(row, lanes, lane, guidance + FREQUENCY),
        number(row, lanes, lane, guidance + RAMP),
    )
    error[0] = number(row, lanes, lane, P_X) - reference[0]
    error[1] = number(row, lanes, lane, P_Y) - reference[1]
    return reference


@piece
def measure(
    row, lanes, lane, plant, reference, measured, angle_noise, table, attitude_error, observation
):
    """Fill in the observation of one robot, but for ages and the velocity.

    Args:
        row: Block of the robot.
        lanes: Robots in a block.
        lane: Place of the robot in its block.
        plant: What all robots share.
        reference: What `find_error` has returned.
        measured: Position error as it is measured, m, (2,).
        angle_noise: Errors of the measured angles, then of their rates, (2 links,), or (0,).
        table: Table of the observation.
        attitude_error: Where to write how far the heading is from what is asked for on board, rad,
            (1,).
        observation: Where to write the observation.
    """
    links, guidance = plant.links, body_rows(plant.links, plant.thruster_links.size)
    measure_position(reference, measured, table, observation)
    mean, head = measure_links(row, lanes, lane, links, table, observation)
    mean_noise, head_noise = add_angle_noise(angle_noise, links, table, observation)
    of_head = number(row, lanes, lane, guidance + HEAD_HEADING) > 0.0
    distance = measured[1]
    if number(row, lanes, lane, guidance + CROSS_TRACK) == 0.0:
        distance += reference[1]
    look_ahead = number(row, lanes, lane, guidance + LOOK_AHEAD)
    attitude_error[0] = (head if of_head else mean) - line_of_sight(distance, look_ahead)
    k = table.starts[ENTRY.heading_error]
    observation[k] = attitude_error[0] * table.gain[k]
    observation[k] += (head_noise if of_head else mean_noise) * table.gain[k]
    measure_thrusters(row, lanes, lane, links, table, observation)


@piece
def measure_position(reference, measured, table, observation):
    """Fill in the measured position error and what is known of the reference."""
    starts, gain, _ = table
    _, _, v_x, v_y, a_x, a_y = reference
    k = starts[ENTRY.position_error]
    observation[k] = measured[0] * gain[k]
    observation[k + 1] = measured[1] * gain[k + 1]
    k = starts[ENTRY.reference_velocity]
    observation[k] = v_x * gain[k]
    observation[k + 1] = v_y * gain[k + 1]
    k = starts[ENTRY.reference_acceleration]
    observation[k] = a_x * gain[k]
    observation[k + 1] = a_y * gain[k + 1]


@piece
def measure_links(row, lanes, lane, links, table, observation):
    """Fill in the angles of tail and joints; returns the links' mean angle and the head's, rad."""
    starts, gain, _ = table
    angles, rates, shares = row_of(THETA, links), row_of(OMEGA, links), row_of(SHARE, links)
    theta, omega = number(row, lanes, lane, angles), number(row, lanes, lane, rates)
    observation[starts[ENTRY.tail_angle]] = theta * gain[starts[ENTRY.tail_angle]]
    observation[starts[ENTRY.tail_rate]] = omega * gain[starts[ENTRY.tail_rate]]
    reference = number(row, lanes, lane, DEFLECTION)
    reference_rate = number(row, lanes, lane, DEFLECTION_RATE)
    reference_acceleration = number(row, lanes, lane, DEFLECTION_ACCELERATION)
    total = theta
    for i in range(links - 1):
        theta_next = number(row, lanes, lane, angles + i + 1)
        omega_next = number(row, lanes, lane, rates + i + 1)
        share = number(row, lanes, lane, shares + i)
        k = starts[ENTRY.joint_angles] + i
        observation[k] = (theta - theta_next) * gain[k]
        k = starts[ENTRY.joint_rates] + i
        observation[k] = (omega - omega_next) * gain[k]
        k = starts[ENTRY.joint_references] + i
        observation[k] = share * reference * gain[k]
        k = starts[ENTRY.joint_reference_rates] + i
        observation[k] = share * reference_rate * gain[k]
        k = starts[ENTRY.joint_reference_accelerations] + i
        observation[k] = share * reference_acceleration * gain[k]
        theta, omega = theta_next, omega_next
        total += theta
    return total / links, theta


@piece
def add_angle_noise(noise, links, table, observation):
    """Add errors to the angles; returns what they make of the mean angle and the head's, rad."""
    starts, gain, _ = table
    if noise.size == 0:
        return 0.0, 0.0
    tail, tail_rate = starts[ENTRY.tail_angle], starts[ENTRY.tail_rate]
    observation[tail] += noise[0] * gain[tail]
    observation[tail_rate] += noise[links] * gain[tail_rate]
    angle = noise[0]
    total = angle
    for i in range(links - 1):
        k = starts[ENTRY.joint_angles] + i
        observation[k] += noise[1 + i] * gain[k]
        k = starts[ENTRY.joint_rates] + i
        observation[k] += noise[links + 1 + i] * gain[k]
        angle -= noise[1 + i]
        total += angle
    return total / links, angle


@piece
def measure_age(entry, age, table, observation):
    """Fill in how old a measurement is, s."""
    k = table.starts[entry]
    observation[k] = age * table.gain[k]


@piece
def measure_thrusters(row, lanes, lane, links, table, observation):
    """Fill in the last commands and the limit."""
    starts, gain, _ = table
    k = starts[ENTRY.thruster_command]
    thrusters = starts[ENTRY.thruster_limit] - k
    limit, commands = number(row, lanes, lane, LIMIT), thruster_row(COMMAND, links, thrusters)
    for j in range(thrusters):
        observation[k + j] = number(row, lanes, lane, commands + j) / limit * gain[k + j]
    k = starts[ENTRY.thruster_limit]
    observation[k] = limit * gain[k]


@compiled
def allocations(
    observation, scale, tail, joints, links, l, thruster_links, thruster_is_normal, matrices
):
    """Fill in the allocation matrices of a batch from the angles that are measured.

    Args:
        observation: Observations, (batch, numbers).
        scale: Physical value over observed value of each number.
        tail: Index of the tail's angle.
        joints: Index of the first joint's angle.
        links: Number of links.
        l: Half the length of a link, m.
        thruster_links: Zero-based link of each thruster.
        thruster_is_normal: Whether each thruster pushes across its link.
        matrices: Where to write, (batch, 3, thrusters).
    """
    sine, cosine = np.empty(links), np.empty(links)
    for b in range(observation.shape[0]):
        theta = observation[b, tail] * scale[tail]
        sine[0], cosine[0] = sincos(theta)
        for i in range(links - 1):
            theta -= observation[b, joints + i] * scale[joints + i]
            sine[i + 1], cosine[i + 1] = sincos(theta)
        allocation_matrix(sine, cosine, l, thruster_links, thruster_is_normal, matrices[b])
