"""Linear active-disturbance-rejection control: an extended-state observer and what it cancels.

Sources: Z. Gao, Scaling and bandwidth-parameterization based controller tuning, American Control
Conference 2003: all poles of the observer at -observer_bandwidth, those of the loop that is left
at -controller_bandwidth. R. Miklosovic, A. Radke, Z. Gao, Discrete implementation and
generalization of the extended state observer, American Control Conference 2006: the same observer
sampled, corrected by the present measurement.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import exp_of_negative


class LADRCGains(NamedTuple):
    """Gains of linear active-disturbance-rejection control."""

    observer_bandwidth: float = Gain(
        60.0, "rad/s", "omega_o of the observer", tuned=(1.0, 2000.0), positive=True
    )
    controller_bandwidth: float = Gain(4.0, "rad/s", "omega_c of the loop", tuned=(0.1, 30.0))
    inertia: float = Gain(
        17.0,
        "kg",
        "1 / b_0: force over the acceleration that it is taken to cause",
        tuned=(2.0, 200.0),
        positive=True,
    )
    heading_gain: float = HEADING_GAIN


# m, m/s and m/s^2.
STATE = ("error", "rate", "disturbance")
ERROR, RATE, DISTURBANCE = range(len(STATE))


@piece
def observer_correction(observer_bandwidth, h):
    """Gains of the sampled observer, whose three poles are at e^(-omega_o h)."""
    pole = exp_of_negative(-observer_bandwidth * h)
    gap = 1.0 - pole
    return (
        1.0 - pole * pole * pole,
        1.5 * gap * gap * (1.0 + pole) / h,
        gap * gap * gap / (h * h),
    )


@piece
def extended_state(y, u, h, correction, state):
    """One step of the extended-state observer.

    Args:
        y: Measured error, m.
        u: Acceleration that was asked for over the past period, m/s^2.
        h: Control period, s.
        correction: Gains of the observer.
        state: The numbers of `STATE`, advanced in place.
    """
    a = state[DISTURBANCE] + u
    e = state[ERROR] + h * state[RATE] + 0.5 * h * h * a
    v = state[RATE] + h * a
    innovation = y - e
    state[ERROR] = e + correction[ERROR] * innovation
    state[RATE] = v + correction[RATE] * innovation
    state[DISTURBANCE] += correction[DISTURBANCE] * innovation


@compiled
def ladrc(signals, h, mass, gains, state, force):
    """Observer and law for a batch; fills in the force, N, (batch, axes)."""
    correction = observer_correction(gains.observer_bandwidth, h)
    omega = gains.controller_bandwidth
    for b, axis in np.ndindex(force.shape):
        own, acceleration = state[b, axis], signals.acceleration[b, axis]
        y, velocity = signals.y[b, axis], signals.velocity[b, axis]
        if signals.started[b] == 0.0:
            own[ERROR], own[RATE], own[DISTURBANCE] = y, -velocity, 0.0
        else:
            applied = mass * (signals.u[b, axis] + acceleration)
            extended_state(y, applied / gains.inertia - acceleration, h, correction, own)
        u_0 = -omega * omega * own[ERROR] - 2.0 * omega * own[RATE]
        force[b, axis] = gains.inertia * (u_0 - own[DISTURBANCE] + acceleration)


class LADRC(ScriptedPolicy):
    """Linear active-disturbance-rejection control."""

    Gains = LADRCGains
    state = STATE

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Observe, cancel, and place the poles of what is left."""
        ladrc(signals, self._model.h, self._model.mass, self.gains, state, force)
