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

from usm_baselines.laws.policy import HEADING_RANGE, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Range, Space
from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.task.nominal import Nominal

LADRC_SPACE: Space = {
    "observer_bandwidth": Range(2.0, 200.0, "rad/s"),
    "controller_bandwidth": Range(0.5, 30.0, "rad/s"),
    "inertia": Range(5.0, 100.0, "kg"),
    "heading_gain": HEADING_RANGE,
}


class LADRCGains(NamedTuple):
    """Gains of linear active-disturbance-rejection control.

    Attributes:
        observer_bandwidth: omega_o, rad/s.
        controller_bandwidth: omega_c, rad/s.
        inertia: 1 / b_0, force over the acceleration it is taken to cause, kg.
        heading_gain: k_psi, N m/rad.
    """

    observer_bandwidth: float = 60.0
    controller_bandwidth: float = 4.0
    inertia: float = 17.0
    heading_gain: float = 100.0


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
        state: (error, its rate, disturbance as an acceleration), advanced in place.
    """
    a = state[2] + u
    e = state[0] + h * state[1] + 0.5 * h * h * a
    v = state[1] + h * a
    innovation = y - e
    state[0] = e + correction[0] * innovation
    state[1] = v + correction[1] * innovation
    state[2] += correction[2] * innovation


@compiled
def ladrc(signals, h, mass, gains, state, force):
    """Observer and law for a batch, both axes; fills in the force, (batch, 2)."""
    correction = observer_correction(gains.observer_bandwidth, h)
    omega = gains.controller_bandwidth
    for b in range(force.shape[0]):
        for axis in range(2):
            own, acceleration = state[b, axis], signals.acceleration[b, axis]
            if signals.started[b] == 0.0:
                own[0], own[1], own[2] = signals.y[b, axis], -signals.velocity[b, axis], 0.0
            else:
                applied = mass * (signals.u[b, axis] + acceleration)
                u = applied / gains.inertia - acceleration
                extended_state(signals.y[b, axis], u, h, correction, own)
            u_0 = -omega * omega * own[0] - 2.0 * omega * own[1]
            force[b, axis] = gains.inertia * (u_0 - own[2] + acceleration)


class LADRC(ScriptedPolicy):
    """Linear active-disturbance-rejection control.

    The law's state is (error, its rate, disturbance) for each axis, in m and s.
    """

    law_size = 3
    positive = ("observer_bandwidth", "inertia")

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Take gains other than the defaults by name, see `LADRCGains`."""
        super().__init__(nominal, LADRCGains(**gains))

    def force(self, signals: Signals, law_state: Array) -> Array:
        """Observe, cancel, and place the poles of what is left."""
        force = np.empty_like(signals.y)
        ladrc(signals, self._model.h, self._model.mass, self.gains, law_state, force)
        return force
