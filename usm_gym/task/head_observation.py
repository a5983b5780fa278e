"""What a steered robot observes besides its body, and its true error: the head on its path.

The position of the head is not measured. It follows from that of the centre of mass and from the
angles, as they are measured.
"""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.lanes import padded
from usm_gym.plant.layout import CLOCK, P_X, THETA, row_of
from usm_gym.plant.steering import ANGLE, QUANTITIES, steering_row
from usm_gym.sensors import Entry, Layout, known, put
from usm_gym.task.head_kinematics import find_planar_head, planar_jacobian
from usm_gym.task.head_path import (
    AMPLITUDE,
    CENTRE,
    CHANNEL_ROWS,
    FREQUENCY,
    PHASE,
    RAMP,
    START,
    traced,
)
from usm_gym.task.observation import ENTRY, ObservationLayout, number

AXES = 2


def head_entries(axes: tuple[str, ...]) -> tuple[Entry, ...]:
    """The entries of position, velocity and acceleration of the head's reference, and its error."""
    size, names = len(axes), ", ".join(axes)
    return (
        Entry(
            "head_error",
            size,
            "m",
            0.01,
            1.0,
            f"position of the head ({names}) minus its reference, by what is measured",
        ),
        Entry("head_reference", size, "m", 0.5, 100.0, "its reference, from the station"),
        Entry("head_reference_velocity", size, "m/s", 0.1, 5.0, "velocity of its reference"),
        Entry(
            "head_reference_acceleration", size, "m/s^2", 0.1, 5.0, "acceleration of its reference"
        ),
    )


@dataclass(frozen=True)
class HeadLayout(Layout):
    """The observation of a steered robot in the plane: that of its body, then the head's.

    Attributes:
        links: Number of links.
        thrusters: Number of thrusters.
    """

    links: int
    thrusters: int

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All entries in order."""
        return (
            *ObservationLayout(self.links, self.thrusters).entries,
            *head_entries(("x", "y")),
            Entry(
                "direction_error",
                1,
                "rad",
                0.1,
                100.0,
                "direction of the head, by what is measured, minus its reference; never wrapped",
            ),
            Entry("direction_reference_rate", 1, "rad/s", 0.5, 100.0, "rate of that reference"),
        )


# The number of each entry in the order of the table, by name.
_NAMES = [entry.name for entry in HeadLayout(links=2, thrusters=3).entries]
HEAD_ENTRY: Any = namedtuple("HEAD_ENTRY", _NAMES)(*range(len(_NAMES)))


@piece
def path_row(plant):
    """First row of the path of the head."""
    return steering_row(plant.steering, QUANTITIES, plant.links)


@piece
def asked_of(row, lanes, lane, plant, channel):
    """Reference of one channel of the head, with two derivatives."""
    path = path_row(plant)
    first = path + channel * CHANNEL_ROWS
    return traced(
        number(row, lanes, lane, CLOCK) * plant.h,
        number(row, lanes, lane, first + START),
        number(row, lanes, lane, first + CENTRE),
        number(row, lanes, lane, first + AMPLITUDE),
        number(row, lanes, lane, first + FREQUENCY),
        number(row, lanes, lane, first + PHASE),
        number(row, lanes, lane, path + RAMP),
    )


@piece
def measure_steering(row, lanes, lane, plant, entry, table, observation):
    """Fill in the joint references, their rates and accelerations, whose entries follow `entry`."""
    links = plant.links
    first = steering_row(plant.steering, ANGLE, links)
    for j in range(links - 1):
        angle = number(row, lanes, lane, first + j)
        rate = number(row, lanes, lane, first + padded(links) + j)
        command = number(row, lanes, lane, first + 2 * padded(links) + j)
        put(observation, table, entry, j, angle)
        put(observation, table, entry + 1, j, rate)
        put(observation, table, entry + 2, j, (command - rate) / plant.joint_time_constant)


@compiled
def observe_head(fleet, plant, table, robot, lanes):
    """Fill in the error of the head, and what is observed of it, after those of the body."""
    row, lane = fleet.blocks[robot // lanes], robot % lanes
    observation, error = fleet.observation[robot], fleet.error[robot]
    angles, links = fleet.attitude_error[robot], plant.links
    measure_steering(row, lanes, lane, plant, HEAD_ENTRY.joint_references, table, observation)
    theta = np.empty(links)
    seen_angles(observation, table, theta)
    seen, direction = find_planar_head(theta, plant), theta[links - 1]
    for i in range(links):
        theta[i] = number(row, lanes, lane, row_of(THETA, links) + i)
    true = find_planar_head(theta, plant)
    for axis in range(AXES):
        p, v, a = asked_of(row, lanes, lane, plant, axis)
        error[axis] = number(row, lanes, lane, P_X + axis) + true[axis] - p
        body = known(observation, table, ENTRY.position_error, axis)
        put(observation, table, HEAD_ENTRY.head_error, axis, body + seen[axis] - p)
        put(observation, table, HEAD_ENTRY.head_reference, axis, p)
        put(observation, table, HEAD_ENTRY.head_reference_velocity, axis, v)
        put(observation, table, HEAD_ENTRY.head_reference_acceleration, axis, a)
    p, v, _ = asked_of(row, lanes, lane, plant, AXES)
    # Of the body the heading is watched.
    angles[1] = angles[0]
    angles[0] = theta[links - 1] - p
    put(observation, table, HEAD_ENTRY.direction_error, 0, direction - p)
    put(observation, table, HEAD_ENTRY.direction_reference_rate, 0, v)


@compiled
def head_jacobians(observation, table, plant, matrices):
    """Fill in how the head moves and turns with the joints, of a batch, (batch, 3, joints).

    See `planar_jacobian`; `observation` is (batch, numbers).
    """
    theta = np.empty(plant.links)
    for b in range(observation.shape[0]):
        seen_angles(observation[b], table, theta)
        planar_jacobian(theta, plant, matrices[b])


@piece
def seen_angles(observation, table, theta):
    """Fill in the angles of the links as measured, rad, (links,)."""
    theta[0] = known(observation, table, ENTRY.tail_angle, 0)
    for i in range(theta.size - 1):
        theta[i + 1] = theta[i] - known(observation, table, ENTRY.joint_angles, i)
