"""Sliding-mode control with a boundary layer and integral action.

    s = e' + 2 surface e + surface^2 integral of e,
    F = m_t (p_ref'' - 2 surface e' - surface^2 e - eta sat(s / boundary)).

The integral starts where s = 0. The rate e' is that of the paper's observer, (15)-(16).

Source: J.-J. E. Slotine, W. Li, Applied Nonlinear Control, 1991, chapter 7.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.estimation.observer import HOMOGENEOUS, observe, observer_gains
from usm_baselines.laws.policy import HEADING_RANGE, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Range, Space
from usm_gym.kernels.compile import compiled, piece
from usm_gym.task.nominal import Nominal

SLIDING_MODE_SPACE: Space = {
    "observer_gain": Range(1e-2, 1000.0, "m/s^3"),
    "surface": Range(0.3, 30.0, "1/s"),
    "eta": Range(1e-2, 10.0, "m/s^2"),
    "boundary": Range(1e-4, 1.0, "m/s"),
    "heading_gain": HEADING_RANGE,
}

INTEGRAL = 4


class SlidingModeGains(NamedTuple):
    """Gains of the sliding-mode controller.

    Attributes:
        observer_gain: L of the observer, m/s^3.
        surface: lambda, 1/s.
        eta: Acceleration of the switching term, m/s^2.
        boundary: Half the width of the boundary layer, m/s.
        heading_gain: k_psi, N m/rad.
    """

    observer_gain: float = 90.0
    surface: float = 14.0
    eta: float = 0.8
    boundary: float = 0.7
    heading_gain: float = 100.0


@piece
def switching(s, boundary, eta):
    """-eta sat(s / boundary), m/s^2."""
    return -eta * min(max(s / boundary, -1.0), 1.0)


@compiled
def sliding_mode(signals, h, mass, gains, state, force):
    """Observer and controller for a batch, both axes; fills in the force, (batch, 2)."""
    k = observer_gains(gains.observer_gain, HOMOGENEOUS)
    surface = gains.surface
    for b in range(force.shape[0]):
        for axis in range(2):
            own, started, y = state[b, axis], signals.started[b], signals.y[b, axis]
            velocity, acceleration = signals.velocity[b, axis], signals.acceleration[b, axis]
            observe(True, started, y, signals.u[b, axis], velocity, h, k, own)
            proportional = own[1] + 2.0 * surface * own[0]
            if started == 0.0:
                own[INTEGRAL] = -proportional / (surface * surface)
            else:
                own[INTEGRAL] += h * own[0]
            s = proportional + surface * surface * own[INTEGRAL]
            equivalent = -2.0 * surface * own[1] - surface * surface * own[0]
            u = equivalent + switching(s, gains.boundary, gains.eta)
            force[b, axis] = mass * (acceleration + u)


class SlidingMode(ScriptedPolicy):
    """Sliding-mode control with a boundary layer and integral action.

    The law's state is (p1, p2, p3, e) of the observer and the integral of the error for each axis.
    """

    law_size = 5
    positive = ("observer_gain", "surface", "boundary")

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Take gains other than the defaults by name, see `SlidingModeGains`."""
        super().__init__(nominal, SlidingModeGains(**gains))

    def force(self, signals: Signals, law_state: Array) -> Array:
        """The law."""
        force = np.empty_like(signals.y)
        model = self._model
        sliding_mode(signals, model.h, model.mass, self.gains, law_state, force)
        return force
