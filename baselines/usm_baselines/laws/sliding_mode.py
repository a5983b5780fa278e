"""Sliding-mode control with a boundary layer and integral action.

    s = e' + 2 surface e + surface^2 integral of e,
    F = m_t (p_ref'' - 2 surface e' - surface^2 e - eta sat(s / boundary)).

The integral starts where s = 0. The rate e' is that of the paper's observer, (15)-(16).

Source: J.-J. E. Slotine, W. Li, Applied Nonlinear Control, 1991, chapter 7.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.estimation import observer
from usm_baselines.estimation.observer import ERROR, HOMOGENEOUS, RATE, observe, observer_gains
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece


class SlidingModeGains(NamedTuple):
    """Gains of the sliding-mode controller."""

    observer_gain: float = Gain(
        90.0, "m/s^3", "L of the observer", tuned=(1e-2, 1000.0), positive=True
    )
    surface: float = Gain(14.0, "1/s", "lambda", tuned=(0.3, 30.0), positive=True)
    eta: float = Gain(0.8, "m/s^2", "acceleration of the switching term", tuned=(1e-2, 10.0))
    boundary: float = Gain(
        0.7, "m/s", "half the width of the boundary layer", tuned=(1e-4, 1.0), positive=True
    )
    heading_gain: float = HEADING_GAIN


# The observer's numbers; integral of the error, m s.
STATE = (*observer.NAMES, "integral")
*_, INTEGRAL = range(len(STATE))


@piece
def switching(s, boundary, eta):
    """-eta sat(s / boundary), m/s^2."""
    return -eta * min(max(s / boundary, -1.0), 1.0)


@compiled
def sliding_mode(signals, h, mass, gains, state, force):
    """Observer and controller for a batch; fills in the force, N, (batch, axes)."""
    k = observer_gains(gains.observer_gain, HOMOGENEOUS)
    surface = gains.surface
    for b, axis in np.ndindex(force.shape):
        own, started, y = state[b, axis], signals.started[b], signals.y[b, axis]
        velocity, acceleration = signals.velocity[b, axis], signals.acceleration[b, axis]
        observe(True, started, y, signals.u[b, axis], velocity, h, k, own)
        proportional = own[RATE] + 2.0 * surface * own[ERROR]
        if started == 0.0:
            own[INTEGRAL] = -proportional / (surface * surface)
        else:
            own[INTEGRAL] += h * own[ERROR]
        s = proportional + surface * surface * own[INTEGRAL]
        equivalent = -2.0 * surface * own[RATE] - surface * surface * own[ERROR]
        u = equivalent + switching(s, gains.boundary, gains.eta)
        force[b, axis] = mass * (acceleration + u)


class SlidingMode(ScriptedPolicy):
    """Sliding-mode control with a boundary layer and integral action."""

    Gains = SlidingModeGains
    state = STATE

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """The law."""
        sliding_mode(signals, self._model.h, self._model.mass, self.gains, state, force)
