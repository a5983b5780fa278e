"""The posture of a robot in the few numbers that the agent of the residual task sees."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial, singledispatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from usm_baselines.signals import Signals

from usm_agents.residual.observation import (
    DIRECTION_ENTRIES,
    HEAD_ENTRIES,
    HEAD_ERROR,
    JOINT_ANGLES,
    JOINTS_VELOCITY,
    PLANAR_POSTURE,
    SPATIAL_POSTURE,
)
from usm_gym.head_world import HeadWorld
from usm_gym.kernels.compile import compiled, piece
from usm_gym.manipulator import Manipulator
from usm_gym.robot import Robot
from usm_gym.sensors import Entry, value
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.task.observation import ENTRY
from usm_gym.task.spatial_observation import SPATIAL_ENTRY
from usm_gym.world import world_of

Array = NDArray[np.float64]


class Plain(NamedTuple):
    """How the plain observation is read, see `usm_gym.sensors.value`.

    Attributes:
        starts: First indices of the entries.
        scale: Physical value over observed value, by number.
    """

    starts: NDArray[np.int64]
    scale: Array


class Posture(NamedTuple):
    """What reads the posture from plain observations.

    Attributes:
        entries: What it gives, in order.
        fill: `(observation, signals, posture)`: fill in the physical values of a batch, (batch,
            numbers), from what is observed and what is known of the body.
    """

    entries: tuple[Entry, ...]
    fill: Callable[[NDArray[np.float32], Signals, Array], None]


@piece
def over_joints(seen, plain, entry, joints):
    """Sum of a quantity over the joints."""
    total = 0.0
    for i in range(joints):
        total += value(seen, plain, entry, i)
    return total


@piece
def tail_over_mean(seen, plain, entry, joints):
    """The tail's angle over the mean of all links', from the joints' angles; of rates likewise.

    Joint i turns the links after it.
    """
    total = 0.0
    for i in range(joints):
        total += (joints - i) / (joints + 1) * value(seen, plain, entry, i)
    return total


@piece
def asked_to_bend(seen, plain, entry, joints):
    """How many joints have a reference other than 0."""
    bending = 0.0
    for i in range(joints):
        if value(seen, plain, entry, i) != 0.0:
            bending += 1.0
    return bending


@compiled
def planar_posture(plain, observation, signals, posture):
    """Fill in heading and joint motion of planar robots."""
    joints = plain.starts[ENTRY.joint_rates] - plain.starts[ENTRY.joint_angles]
    for b in range(observation.shape[0]):
        seen, found = observation[b], posture[b]
        tail, rate = value(seen, plain, ENTRY.tail_angle, 0), value(seen, plain, ENTRY.tail_rate, 0)
        found[0] = tail - tail_over_mean(seen, plain, ENTRY.joint_angles, joints)
        found[1] = value(seen, plain, ENTRY.heading_error, 0)
        found[2] = rate - tail_over_mean(seen, plain, ENTRY.joint_rates, joints)
        for k in range(5):  # angles, rates; references, their rates and accelerations
            found[3 + k] = over_joints(seen, plain, ENTRY.joint_angles + k, joints)
        found[8] = asked_to_bend(seen, plain, ENTRY.joint_references, joints)


@compiled
def spatial_posture(plain, sides, observation, signals, posture):
    """Fill in attitude and joint motion of spatial robots.

    `sides` has how much a joint turns what is before it to the left and up, (joints, 2).
    """
    joints = sides.shape[0]
    for b in range(observation.shape[0]):
        seen, found = observation[b], posture[b]
        for k in range(3):  # pitch, yaw and roll
            found[k] = value(seen, plain, SPATIAL_ENTRY.pitch_error + k, 0)
            found[3 + k] = value(seen, plain, SPATIAL_ENTRY.angular_velocity, k)
        for k in range(5):  # angles, rates; references, their rates and accelerations
            for side in range(2):
                total = 0.0
                for j in range(joints):
                    total += sides[j, side] * value(seen, plain, SPATIAL_ENTRY.joint_angles + k, j)
                found[6 + 2 * k + side] = total
        found[16] = asked_to_bend(seen, plain, SPATIAL_ENTRY.joint_references, joints)


@singledispatch
def posture_of(robot: Any) -> Posture:
    """What reads the posture of a robot.

    Raises:
        TypeError: If nothing does.
    """
    raise TypeError(f"no posture is registered for {type(robot).__name__}")


@posture_of.register
def _(robot: Robot) -> Posture:
    return Posture(PLANAR_POSTURE, partial(planar_posture, _plain(robot)))


@posture_of.register
def _(robot: SpatialRobot) -> Posture:
    sides = np.array([(axis[2], -axis[1]) for axis in robot.joint_axes])
    return Posture(SPATIAL_POSTURE, partial(spatial_posture, _plain(robot), sides))


@posture_of.register
def _(robot: Manipulator) -> Posture:
    world = world_of(robot)
    assert isinstance(world, HeadWorld)
    body, axes = posture_of(robot.robot), len(world.axes)
    own = (
        *(replace(entry, size=axes) for entry in (HEAD_ERROR, *HEAD_ENTRIES)),
        *(DIRECTION_ENTRIES if world.attitude else ()),
        replace(JOINTS_VELOCITY, size=axes),
        replace(JOINT_ANGLES, size=robot.joints),
    )
    return Posture((*body.entries, *own), partial(head_posture, world, body))


def head_posture(
    world: HeadWorld,
    body: Posture,
    observation: NDArray[np.float32],
    signals: Signals,
    posture: Array,
) -> None:
    """Fill in the posture of bodies, and what is known of their heads."""
    layout, axes = world.layout, len(world.axes)

    def read(name: str) -> Array:
        place = layout.slices[name]
        return np.asarray(observation[:, place] * layout.scale[place])

    first = sum(entry.size for entry in body.entries)
    body.fill(observation, signals, posture[:, :first])
    jacobians = np.empty(
        (len(observation), axes + len(world.attitude), world.actions - world.thrusters)
    )
    world.jacobians(observation, jacobians)
    known = [read("head_error") + signals.y - read("position_error")]
    known += [read(f"head_reference_{name}") for name in ("velocity", "acceleration")]
    if world.attitude:
        known += [read("direction_error"), read("direction_reference_rate")]
    known += [
        np.einsum("bcj,bj->bc", jacobians[:, :axes], read("joint_rates")),
        read("joint_angles"),
    ]
    np.concatenate(known, axis=1, out=posture[:, first:])


def _plain(robot: Any) -> Plain:
    layout = world_of(robot).layout
    return Plain(layout.starts, layout.scale)
