"""Task priority: the position of the head first, what it costs least to give up after it.

Second comes the direction of the head, in the plane, or, in space, that the body be turned as
little as the joints can help; third the posture. Each is brought about, by damped least squares, in
the null space of all that come before it, and so disturbs none of them.

Sources: Y. Nakamura, H. Hanafusa, T. Yoshikawa, Task-priority based redundancy control of robot
manipulators, International Journal of Robotics Research 6, 1987; G. Antonelli, S. Chiaverini, Task-
priority redundancy resolution for underwater vehicle-manipulator systems, IEEE International
Conference on Robotics and Automation, 1998.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from usm_baselines.head import (
    DAMPING,
    HEAD_GAIN,
    HEADING_LEAD,
    LEAD,
    POSTURE_GAIN,
    HeadLaw,
    HeadPercept,
    reactions,
)
from usm_baselines.laws.resolved_rates import wanted_velocities
from usm_baselines.signals import Array
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece
from usm_gym.plant.thrusters import allocate


class TaskPriorityGains(NamedTuple):
    """Gains of task priority."""

    head_gain: float = HEAD_GAIN
    lead: float = LEAD
    posture_gain: float = POSTURE_GAIN
    damping: float = DAMPING
    second_damping: float = Gain(
        0.3, "1", "the same of what comes second", tuned=(1e-2, 10.0), positive=True
    )
    heading_lead: float = HEADING_LEAD


@piece
def least(J, wanted, damping, T, work, found):
    """Fill in the damped least rates, (joints,), that bring about what is wanted, (rows,)."""
    rows, joints = J.shape
    for r in range(rows):
        for j in range(joints):
            T[r, j] = J[r, j]
        for k in range(rows):
            T[r, joints + k] = damping if k == r else 0.0
    allocate(T[:rows, : joints + rows], wanted, rows, 0.0, work, found[: joints + rows])


@compiled
def prioritise(known, model, correction, turns, home, gains, rates):
    """Fill in the rates of a batch, rad/s, (batch, joints), within their limit.

    Args:
        known: What is known.
        model: Nominal knowledge.
        correction: What is added to the velocities wanted of the heads, (batch, channels).
        turns: How the bodies turn with the joints, (batch, angles, joints); no angle in the plane.
        home: Posture to return to, rad, (joints,).
        gains: The gains.
        rates: Where to write.
    """
    axes, joints = model.axes, model.joints
    directions, angles = model.channels - axes, turns.shape[1]
    seconds = directions + angles
    most = max(axes, seconds)
    T, found = np.empty((most, joints + most)), np.empty(joints + most)
    work, wanted = np.empty((2 * most + 1, most)), np.empty(model.channels)
    second, asked, left = np.empty((seconds, joints)), np.empty(seconds), np.empty(axes)
    back = np.empty(joints)
    for b in range(known.seen.shape[0]):
        seen, offset, jacobian = known.seen[b], known.offsets[b], known.jacobians[b]
        gain, lead = gains.head_gain, gains.lead
        wanted_velocities(seen, model, offset, correction[b], gain, lead, wanted)
        first = jacobian[:axes]
        least(first, wanted[:axes], gains.damping, T, work, found)
        for j in range(joints):
            rates[b, j] = found[j]
            k = model.joint_angles + j
            back[j] = -gains.posture_gain * (seen[k] * model.scale[k] - home[j])
        for s in range(seconds):
            row = jacobian[axes + s] if s < directions else turns[b, s - directions]
            asked[s] = wanted[axes + s] if s < directions else 0.0
            for j in range(joints):
                asked[s] -= row[j] * rates[b, j]
                second[s, j] = row[j]
            withdraw(first, gains.damping, second[s], left, T, work, found)
        withdraw(first, gains.damping, back, left, T, work, found)
        least(second, asked, gains.second_damping, T, work, found)
        for j in range(joints):
            rates[b, j] += found[j]
        withdraw(second, gains.second_damping, back, asked, T, work, found)
        largest = model.rate_limit
        for j in range(joints):
            rates[b, j] += back[j]
            largest = max(largest, abs(rates[b, j]))
        for j in range(joints):
            rates[b, j] *= model.rate_limit / largest


@piece
def withdraw(J, damping, rates, made, T, work, found):
    """Take out of rates, (joints,), what they would do to a task; `made` is room, (rows,)."""
    rows, joints = J.shape
    for r in range(rows):
        made[r] = 0.0
        for j in range(joints):
            made[r] += J[r, j] * rates[j]
    least(J, made, damping, T, work, found)
    for j in range(joints):
        rates[j] -= found[j]


class TaskPriority(HeadLaw):
    """Rates by priority: position, then direction or reaction, then posture."""

    Gains: type[Any] = TaskPriorityGains

    def act(self, known: HeadPercept, thrust: Array, correction: Array) -> tuple[Array, Array]:
        """Leave the thrusters to the law for the body, and move the joints."""
        model, turns = self._model, np.empty((len(thrust), 0, self._model.joints))
        if model.channels == model.axes:
            turns = reactions(self._robot, known.seen, self._world.layout)
        rates = np.empty((len(thrust), model.joints))
        prioritise(known, model, correction, turns, self._home, self.gains, rates)
        return thrust, rates
