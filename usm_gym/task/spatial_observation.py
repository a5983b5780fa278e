"""The observation of the spatial robot: the one table of what is in it, and its filling."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from usm_gym.kernels.compile import compiled, piece
from usm_gym.plant.spatial.layout import *
from usm_gym.plant.spatial.posture import centre_of_mass, mass_velocity, place_links
from usm_gym.plant.spatial.rotation import axes_of, cross, out_of, product
from usm_gym.sensors import Entry, Layout, put

_OF_JOINTS = "joint i turns link i + 1 against link i, right-handed"


@dataclass(frozen=True)
class SpatialLayout(Layout):
    """The layout of the observation of a spatial robot, the same in all its tasks.

    Attributes:
        joints: Number of joints.
        thrusters: Number of thrusters.
    """

    joints: int
    thrusters: int

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All entries in order."""
        return (
            Entry(
                "position_error",
                3,
                "m",
                0.01,
                0.5,
                "position minus its reference (x, y, z) at the time of measurement, global frame",
            ),
            Entry("reference_velocity", 3, "m/s", 0.1, 5.0, "velocity of the reference"),
            Entry("reference_acceleration", 3, "m/s^2", 0.1, 5.0, "acceleration of the reference"),
            Entry(
                "attitude",
                4,
                "1",
                1.0,
                1.1,
                "quaternion (w, x, y, z), w >= 0, from the axes of the middle link to the global "
                "ones (compass, inclinometer)",
            ),
            Entry(
                "angular_velocity", 3, "rad/s", 0.1, 100.0, "of the middle link, its axes (gyro)"
            ),
            *self._of_joints(),
            Entry(
                "pitch_error",
                1,
                "rad",
                0.1,
                4.0,
                "attitude minus its reference: rotation vector in the axes of the middle link, "
                "about y; positive lowers the head",
            ),
            Entry("yaw_error", 1, "rad", 0.1, 4.0, "the same about z"),
            Entry("roll_error", 1, "rad", 0.1, 4.0, "the same about x"),
            Entry(
                "reference_rates", 2, "rad/s", 0.1, 100.0, "rates of the references of pitch, yaw"
            ),
            *self._of_thrusters_and_ages(),
        )

    def _of_joints(self) -> tuple[Entry, ...]:
        joints = self.joints
        return (
            Entry("joint_angles", joints, "rad", 0.1, 10.0, f"{_OF_JOINTS} (encoders)"),
            Entry("joint_rates", joints, "rad/s", 0.5, 100.0, "their rates (encoders)"),
            Entry("joint_references", joints, "rad", 0.1, 10.0, "joint references, from the tail"),
            Entry("joint_reference_rates", joints, "rad/s", 0.5, 100.0, "their rates"),
            Entry("joint_reference_accelerations", joints, "rad/s^2", 5.0, 1000.0, "accelerations"),
        )

    def _of_thrusters_and_ages(self) -> tuple[Entry, ...]:
        return (
            Entry(
                "thruster_command",
                self.thrusters,
                "1",
                1.0,
                1.1,
                "command in effect over the thruster limit, after saturation",
            ),
            Entry("thruster_limit", 1, "N", 20.0, 1000.0, "largest command of a thruster"),
            Entry("position_age", 1, "s", 1.0, 10_000.0, "time since the position was measured"),
            Entry(
                "velocity",
                3,
                "m/s",
                0.1,
                10.0,
                "velocity over ground (x, y, z) at the time of its measurement; 0 without a sensor",
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
_NAMES = [entry.name for entry in SpatialLayout(joints=1, thrusters=5).entries]
SPATIAL_ENTRY: Any = namedtuple("SPATIAL_ENTRY", _NAMES)(*range(len(_NAMES)))


@piece
def put_vector(observation, table, entry, u):
    """Fill in three numbers."""
    for index in range(3):
        put(observation, table, entry, index, u[index])


@piece
def number(row, lanes, lane, index):
    """Number `index` of one robot of a block."""
    return row[index * lanes + lane]


@piece
def vector(row, lanes, lane, index):
    """Three numbers of one robot of a block."""
    return (
        number(row, lanes, lane, index),
        number(row, lanes, lane, index + 1),
        number(row, lanes, lane, index + 2),
    )


@piece
def attitude_of(row, lanes, lane):
    """The attitude of the middle link of one robot."""
    return (
        number(row, lanes, lane, Q),
        number(row, lanes, lane, Q + 1),
        number(row, lanes, lane, Q + 2),
        number(row, lanes, lane, Q + 3),
    )


@piece
def find_mass(row, lanes, lane, plant, position, velocity):
    """Fill in position, m, and velocity, m/s, of the centre of mass of one robot, (3,) each."""
    links = plant.links
    centre, frame = np.empty((links, 3)), np.empty((links, 9))
    phi, rates = np.empty(links - 1), np.empty(links - 1)
    for j in range(links - 1):
        phi[j] = number(row, lanes, lane, row_of(PHI, links) + j)
        rates[j] = number(row, lanes, lane, row_of(PHI_DOT, links) + j)
    q, root = attitude_of(row, lanes, lane), vector(row, lanes, lane, P)
    place_links(plant, root, q, phi, centre, frame)
    middle = centre_of_mass(plant, centre, frame)
    for axis in range(3):
        position[axis] = middle[axis]
    omega = out_of(axes_of(q), vector(row, lanes, lane, W))
    moving = vector(row, lanes, lane, V)
    mass_velocity(plant, omega, moving, rates, frame, velocity)


@piece
def measure_attitude(q, omega, noise, joints, table, observation):
    """Fill in attitude and angular velocity as they are measured; returns that attitude.

    `noise` has errors of the attitude about three axes, of the joint angles, of the angular
    velocity and of the joint rates, (2 (3 + joints),), or nothing.
    """
    if noise.size > 0:
        q = product(q, (1.0, 0.5 * noise[0], 0.5 * noise[1], 0.5 * noise[2]))
        length = np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        q = q[0] / length, q[1] / length, q[2] / length, q[3] / length
        k = 3 + joints
        omega = omega[0] + noise[k], omega[1] + noise[k + 1], omega[2] + noise[k + 2]
    sign = 1.0 if q[0] >= 0.0 else -1.0
    for k in range(4):
        put(observation, table, SPATIAL_ENTRY.attitude, k, sign * q[k])
    put_vector(observation, table, SPATIAL_ENTRY.angular_velocity, omega)
    return q


@piece
def measure_joints(row, lanes, lane, links, noise, table, observation):
    """Fill in angles and rates of the joints as measured, and their references."""
    joints = links - 1
    for j in range(joints):
        angle = number(row, lanes, lane, row_of(PHI, links) + j)
        rate = number(row, lanes, lane, row_of(PHI_DOT, links) + j)
        if noise.size > 0:
            angle += noise[3 + j]
            rate += noise[6 + joints + j]
        put(observation, table, SPATIAL_ENTRY.joint_angles, j, angle)
        put(observation, table, SPATIAL_ENTRY.joint_rates, j, rate)
        pan = number(row, lanes, lane, row_of(PAN_SHARE, links) + j)
        tilt = number(row, lanes, lane, row_of(TILT_SHARE, links) + j)
        for k in range(3):
            asked = pan * number(row, lanes, lane, PAN + k)
            asked += tilt * number(row, lanes, lane, TILT + k)
            put(observation, table, SPATIAL_ENTRY.joint_references + k, j, asked)


@piece
def measure_thrusters(row, lanes, lane, links, thrusters, table, observation):
    """Fill in the last commands and the limit."""
    limit = number(row, lanes, lane, LIMIT)
    commands = thruster_row(COMMAND, links, thrusters)
    for j in range(thrusters):
        command = number(row, lanes, lane, commands + j) / limit
        put(observation, table, SPATIAL_ENTRY.thruster_command, j, command)
    put(observation, table, SPATIAL_ENTRY.thruster_limit, 0, limit)


@compiled
def spatial_allocations(observation, scale, starts, plant, thrusters, matrices):
    """Fill in the allocation matrices of a batch from the angles that are measured.

    Args:
        observation: Observations, (batch, numbers).
        scale: Physical value over observed value of each number.
        starts: First indices of the entries.
        plant: What all robots share.
        thrusters: Of each thruster the link, from 0, its place from the link's middle, m, and its
            direction, in link axes, (thrusters, 7).
        matrices: Where to write: forces along x, y, z, moments about y, z and x of the middle link
            through the centre of mass, (batch, 6, thrusters).
    """
    links, root = plant.links, plant.root
    centre, frame = np.empty((links, 3)), np.empty((links, 9))
    phi = np.empty(links - 1)
    attitude, angles = starts[SPATIAL_ENTRY.attitude], starts[SPATIAL_ENTRY.joint_angles]
    for b in range(observation.shape[0]):
        seen = observation[b]
        q = (
            float(seen[attitude]),
            float(seen[attitude + 1]),
            float(seen[attitude + 2]),
            float(seen[attitude + 3]),
        )
        for j in range(links - 1):
            phi[j] = seen[angles + j] * scale[angles + j]
        place_links(plant, (0.0, 0.0, 0.0), q, phi, centre, frame)
        middle = centre_of_mass(plant, centre, frame)
        for j in range(thrusters.shape[0]):
            i, thruster = int(thrusters[j, 0]), thrusters[j]
            push = along(frame[i], thruster[4], thruster[5], thruster[6])
            arm = along(frame[i], thruster[1], thruster[2], thruster[3])
            arm = (
                arm[0] + centre[i, 0] - middle[0],
                arm[1] + centre[i, 1] - middle[1],
                arm[2] + centre[i, 2] - middle[2],
            )
            moment = cross(arm, push)
            for k in range(3):
                matrices[b, k, j] = push[k]
                turned = 3 * ((k + 1) % 3)
                matrices[b, 3 + k, j] = (
                    moment[0] * frame[root, turned]
                    + moment[1] * frame[root, turned + 1]
                    + moment[2] * frame[root, turned + 2]
                )


@piece
def along(frame, x, y, z):
    """A vector in global axes whose components along three axes, (9,), are given."""
    return (
        x * frame[0] + y * frame[3] + z * frame[6],
        x * frame[1] + y * frame[4] + z * frame[7],
        x * frame[2] + y * frame[5] + z * frame[8],
    )
