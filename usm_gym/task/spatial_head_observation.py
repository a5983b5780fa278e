"""What a steered robot in space observes besides its body, and its true error."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from usm_gym.kernels.compile import compiled, piece
from usm_gym.plant.spatial.layout import PHI, row_of
from usm_gym.sensors import Entry, Layout, known, put
from usm_gym.task.head_kinematics import find_spatial_head, spatial_jacobian
from usm_gym.task.head_observation import asked_of, head_entries, measure_steering
from usm_gym.task.spatial_observation import (
    SPATIAL_ENTRY,
    SpatialLayout,
    attitude_of,
    number,
)

AXES = 3


@dataclass(frozen=True)
class SpatialHeadLayout(Layout):
    """The observation of a steered robot in space: that of its body, then the head's.

    Attributes:
        joints: Number of joints.
        thrusters: Number of thrusters.
    """

    joints: int
    thrusters: int

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All entries in order."""
        body = SpatialLayout(self.joints, self.thrusters).entries
        return (*body, *head_entries(("x", "y", "z")))


# The number of each entry in the order of the table, by name.
_NAMES = [entry.name for entry in SpatialHeadLayout(joints=1, thrusters=5).entries]
SPATIAL_HEAD_ENTRY: Any = namedtuple("SPATIAL_HEAD_ENTRY", _NAMES)(*range(len(_NAMES)))


@piece
def seen_posture(observation, table, phi):
    """Fill in the joint angles as measured, rad, (joints,); returns the root's attitude."""
    for j in range(phi.size):
        phi[j] = known(observation, table, SPATIAL_ENTRY.joint_angles, j)
    return (
        known(observation, table, SPATIAL_ENTRY.attitude, 0),
        known(observation, table, SPATIAL_ENTRY.attitude, 1),
        known(observation, table, SPATIAL_ENTRY.attitude, 2),
        known(observation, table, SPATIAL_ENTRY.attitude, 3),
    )


@compiled
def observe_head_in_space(fleet, plant, table, robot, lanes):
    """Fill in the error of the head, and what is observed of it, after those of the body.

    The error of the robot is taken to be that of the centre of mass from its station.
    """
    row, lane, links = fleet.blocks[robot // lanes], robot % lanes, plant.links
    observation, error = fleet.observation[robot], fleet.error[robot]
    measure_steering(row, lanes, lane, plant, SPATIAL_ENTRY.joint_references, table, observation)
    centre, frame, phi = np.empty((links, 3)), np.empty((links, 9)), np.empty(links - 1)
    q = seen_posture(observation, table, phi)
    seen = find_spatial_head(plant, q, phi, centre, frame)
    for j in range(links - 1):
        phi[j] = number(row, lanes, lane, row_of(PHI, links) + j)
    true = find_spatial_head(plant, attitude_of(row, lanes, lane), phi, centre, frame)
    for axis in range(AXES):
        p, v, a = asked_of(row, lanes, lane, plant, axis)
        error[axis] += true[axis] - p
        body = known(observation, table, SPATIAL_ENTRY.position_error, axis)
        put(observation, table, SPATIAL_HEAD_ENTRY.head_error, axis, body + seen[axis] - p)
        put(observation, table, SPATIAL_HEAD_ENTRY.head_reference, axis, p)
        put(observation, table, SPATIAL_HEAD_ENTRY.head_reference_velocity, axis, v)
        put(observation, table, SPATIAL_HEAD_ENTRY.head_reference_acceleration, axis, a)


@compiled
def head_jacobians_in_space(observation, table, plant, matrices):
    """Fill in how the head moves with the joints, of a batch, (batch, 3, joints).

    See `spatial_jacobian`; `observation` is (batch, numbers).
    """
    links = plant.links
    centre, frame, phi = np.empty((links, 3)), np.empty((links, 9)), np.empty(links - 1)
    for b in range(observation.shape[0]):
        q = seen_posture(observation[b], table, phi)
        find_spatial_head(plant, q, phi, centre, frame)
        spatial_jacobian(plant, centre, frame, matrices[b])
