"""Sliding-mode control with a boundary layer and integral action.

    s = e' + 2 surface e + surface^2 integral of e,
    F = m_t (p_ref'' - 2 surface e' - surface^2 e - eta sat(s / boundary)).

The integral starts where s = 0. The rate e' is that of the paper's observer, (15)-(16).

Source: J.-J. E. Slotine, W. Li, Applied Nonlinear Control, 1991, chapter 7.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from usm_baselines.estimation import observer
from usm_baselines.estimation.observer import (
    ERROR,
    K2_EXPONENT,
    OBSERVER_GAIN,
    RATE,
    check_exponent,
    observer_gains,
    perceive,
)
from usm_baselines.laws.super_twisting import SURFACE
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece
from usm_gym.task.nominal import Nominal


class SlidingModeGains(NamedTuple):
    """Gains of the sliding-mode controller."""

    observer_gain: float = OBSERVER_GAIN
    k2_exponent: float = K2_EXPONENT
    surface: float = Gain(14.0, "1/s", "lambda", tuned=SURFACE, positive=True)
    eta: float = Gain(0.8, "m/s^2", "acceleration of the switching term", tuned=(1e-2, 30.0))
    boundary: float = Gain(
        0.7, "m/s", "half the width of the boundary layer", tuned=(1e-3, 30.0), positive=True
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
    k = observer_gains(gains.observer_gain, gains.k2_exponent)
    surface = gains.surface
    for b, axis in np.ndindex(force.shape):
        own, acceleration = state[b, axis], signals.acceleration[b, axis]
        perceive(signals, b, axis, True, h, k, own)
        proportional = own[RATE] + 2.0 * surface * own[ERROR]
        if signals.started[b] == 0.0:
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

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Take gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        check_exponent(self.gains.k2_exponent)

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """The law."""
        sliding_mode(signals, self._model.h, self._model.mass, self.gains, state, force)
