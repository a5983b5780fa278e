"""Resolved rates: joint rates that move the head as it has to move, and the posture besides.

The velocity wanted of the head is that of its reference, a little ahead, less a part of its error.
The rates make it by damped least squares, so that near singular postures the head falls behind
rather than that joints run away; what rates leave to be chosen brings the posture back to that of
the start.

Sources: D. E. Whitney, Resolved motion rate control of manipulators and human prostheses, IEEE
Transactions on Man-Machine Systems 10, 1969; Y. Nakamura, H. Hanafusa, Inverse kinematic solutions
with singularity robustness for robot manipulator control, Journal of Dynamic Systems, Measurement,
and Control 108, 1986; A. Liegeois, Automatic supervisory control of the configuration and behavior
of multibody mechanisms, IEEE Transactions on Systems, Man, and Cybernetics 7, 1977.
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
)
from usm_baselines.signals import Array
from usm_gym.kernels.compile import compiled
from usm_gym.plant.thrusters import allocate


class ResolvedRatesGains(NamedTuple):
    """Gains of resolved rates."""

    head_gain: float = HEAD_GAIN
    lead: float = LEAD
    posture_gain: float = POSTURE_GAIN
    damping: float = DAMPING
    heading_lead: float = HEADING_LEAD


@compiled
def wanted_velocities(seen, model, offset, correction, gain, lead, wanted):
    """Fill in the velocities wanted of the channels of the head, m/s and rad/s, (channels,).

    `offset` is by how much the centre of mass is further than measured, m, (axes,), `correction`
    what is added to the velocities.
    """
    for axis in range(model.axes):
        k = model.head_error + axis
        error = seen[k] * model.scale[k] + offset[axis]
        k = model.reference_velocity + axis
        velocity = seen[k] * model.scale[k]
        k = model.reference_acceleration + axis
        wanted[axis] = velocity + lead * (seen[k] * model.scale[k]) - gain * error
        wanted[axis] += correction[axis]
    if model.channels > model.axes:
        k = model.direction_error
        error = seen[k] * model.scale[k]
        k = model.direction_rate
        wanted[model.axes] = seen[k] * model.scale[k] - gain * error + correction[model.axes]


@compiled
def resolve(known, model, correction, home, gains, rates):
    """Fill in the rates of a batch, rad/s, (batch, joints), within their limit.

    Args:
        known: What is known.
        model: Nominal knowledge.
        correction: What is added to the velocities wanted of the heads, (batch, channels).
        home: Posture to return to, rad, (joints,).
        gains: The gains.
        rates: Where to write.
    """
    channels, joints = model.channels, model.joints
    wanted, work = np.empty(channels), np.empty((2 * channels + 1, channels))
    # Damping is what as many more joints would do that move the head alone.
    T, found = np.zeros((channels, joints + channels)), np.empty(joints + channels)
    for b in range(known.seen.shape[0]):
        seen, offset, jacobian = known.seen[b], known.offsets[b], known.jacobians[b]
        gain, lead = gains.head_gain, gains.lead
        wanted_velocities(seen, model, offset, correction[b], gain, lead, wanted)
        for j in range(joints):
            k = model.joint_angles + j
            rates[b, j] = -gains.posture_gain * (seen[k] * model.scale[k] - home[j])
        for c in range(channels):
            for j in range(joints):
                T[c, j] = jacobian[c, j]
                wanted[c] -= jacobian[c, j] * rates[b, j]
            T[c, joints + c] = gains.damping
        allocate(T, wanted, channels, 0.0, work, found)
        largest = model.rate_limit
        for j in range(joints):
            rates[b, j] += found[j]
            largest = max(largest, abs(rates[b, j]))
        for j in range(joints):
            rates[b, j] *= model.rate_limit / largest


class ResolvedRates(HeadLaw):
    """Resolved rates with the posture in the null space, over a law that holds the body."""

    Gains: type[Any] = ResolvedRatesGains

    def act(self, known: HeadPercept, thrust: Array, correction: Array) -> tuple[Array, Array]:
        """Leave the thrusters to the law for the body, and move the joints."""
        rates = np.empty((len(thrust), self._model.joints))
        resolve(known, self._model, correction, self._home, self.gains, rates)
        return thrust, rates
