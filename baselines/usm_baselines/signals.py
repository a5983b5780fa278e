"""What control laws work with: from the observation to signals, from a wrench to the action.

A law sees the tracking error, the applied force and the reference, and answers with a force on the
centre of mass; heading control and thruster allocation are the same for all.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import compiled
from usm_gym.kernels.elementary import sincos
from usm_gym.plant.measure import (
    HEADING_ERROR,
    JOINT_ANGLES,
    POSITION_ERROR,
    REFERENCE_ACCELERATION,
    REFERENCE_VELOCITY,
    TAIL_ANGLE,
    THRUSTER_COMMAND,
    THRUSTER_LIMIT,
    value,
)
from usm_gym.plant.thrusters import allocate, allocation_matrix
from usm_gym.task.nominal import Nominal
from usm_gym.task.observation import ObservationLayout

Array = NDArray[np.float64]


class Model(NamedTuple):
    """Nominal knowledge in the form that kernels take.

    Attributes:
        starts: First index of each entry of the observation.
        scale: Physical value over observed value of each number.
        axes: Number of axes in which the position is controlled.
        links: Number of links.
        l: Half the length of a link, m.
        thruster_links: Zero-based link of each thruster.
        thruster_is_normal: Whether each thruster pushes across its link.
        mass: Total mass m_t, kg.
        h: Control period, s.
    """

    starts: NDArray[np.int64]
    scale: Array
    axes: int
    links: int
    l: float
    thruster_links: NDArray[np.int64]
    thruster_is_normal: NDArray[np.bool_]
    mass: float
    h: float


class Signals(NamedTuple):
    """What a control law works with, for a batch of robots.

    Attributes:
        started: 0.0 at the first call of an episode, else 1.0, (batch,).
        y: Measured position error, m, (batch, 2).
        u: Applied force over the mass less the reference's acceleration, m/s^2, (batch, 2).
        velocity: Velocity of the reference, m/s, (batch, 2).
        acceleration: Acceleration of the reference, m/s^2, (batch, 2).
        allocation: Allocation matrices, (batch, 3, thrusters).
        observation: All that is measured, to be read with `value`, (batch, numbers).
    """

    started: Array
    y: Array
    u: Array
    velocity: Array
    acceleration: Array
    allocation: Array
    observation: NDArray[np.float32]


def model_of(nominal: Nominal) -> Model:
    """The nominal knowledge for kernels."""
    robot = nominal.robot
    layout = ObservationLayout(robot.links, len(robot.thrusters))
    return Model(
        starts=layout.starts,
        scale=layout.scale,
        axes=2,
        links=robot.links,
        l=robot.half_length,
        thruster_links=robot.thruster_links,
        thruster_is_normal=robot.thruster_is_normal,
        mass=robot.total_mass,
        h=nominal.control_period,
    )


@compiled
def sense(state, model, signals):
    """Fill in the signals from the observations among them and the shared part of the state.

    The applied force is the last command after saturation, projected with the link angles at the
    time of that command, which the state has kept.
    """
    thrusters = model.thruster_links.size
    sine, cosine = np.empty(model.links), np.empty(model.links)
    for b in range(signals.observation.shape[0]):
        seen = signals.observation[b]
        signals.started[b] = state[b, 0]
        limit = value(seen, model, THRUSTER_LIMIT, 0)
        for axis in range(2):
            force = 0.0
            for j in range(thrusters):
                command = value(seen, model, THRUSTER_COMMAND, j) * limit
                force += state[b, 1 + axis * thrusters + j] * command
            acceleration = value(seen, model, REFERENCE_ACCELERATION, axis)
            signals.y[b, axis] = value(seen, model, POSITION_ERROR, axis)
            signals.velocity[b, axis] = value(seen, model, REFERENCE_VELOCITY, axis)
            signals.acceleration[b, axis] = acceleration
            signals.u[b, axis] = force / model.mass - acceleration
        theta = value(seen, model, TAIL_ANGLE, 0)
        sine[0], cosine[0] = sincos(theta)
        for i in range(model.links - 1):
            theta -= value(seen, model, JOINT_ANGLES, i)
            sine[i + 1], cosine[i + 1] = sincos(theta)
        T = signals.allocation[b]
        allocation_matrix(sine, cosine, model.l, model.thruster_links, model.thruster_is_normal, T)


@compiled
def act(observation, state, model, allocation, force, heading_gain, action):
    """Fill in the actions that make the forces (N) and a proportional heading moment."""
    thrusters = model.thruster_links.size
    forces = np.empty(thrusters)
    for b in range(observation.shape[0]):
        seen, T = observation[b], allocation[b]
        moment = -heading_gain * value(seen, model, HEADING_ERROR, 0)
        allocate(T, force[b, 0], force[b, 1], moment, forces)
        limit = value(seen, model, THRUSTER_LIMIT, 0)
        state[b, 0] = 1.0
        for j in range(thrusters):
            action[b, j] = forces[j] / limit
            state[b, 1 + j] = T[0, j]
            state[b, 1 + thrusters + j] = T[1, j]


def room_for_signals(observation: NDArray[np.float32], thrusters: int) -> Signals:
    """Signals of a batch that `sense` has to fill in."""
    size = len(observation)
    y, u, velocity, acceleration = np.empty((4, size, 2))
    allocation = np.empty((size, 3, thrusters))
    return Signals(np.empty(size), y, u, velocity, acceleration, allocation, observation)
