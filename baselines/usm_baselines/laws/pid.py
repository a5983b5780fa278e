"""PID with a filtered derivative and anti-windup by back-calculation.

Source: K. J. Astrom, T. Hagglund, PID Controllers: Theory, Design, and Tuning, 2nd edition, 1995,
chapter 3: derivative by backward differences behind a first-order filter, integral that tracks the
force which was really applied, with the time constant sqrt(T_i T_d).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece


class PIDGains(NamedTuple):
    """Gains of the PID controller."""

    k_p: float = Gain(1300.0, "N/m", "proportional gain", tuned=(10.0, 1e5))
    k_i: float = Gain(10000.0, "N/(m s)", "integral gain", tuned=(10.0, 1e6))
    k_d: float = Gain(400.0, "N s/m", "derivative gain", tuned=(1.0, 1e4), positive=True)
    derivative_time: float = Gain(
        0.003, "s", "time constant of the derivative's filter", tuned=(1e-4, 1.0)
    )
    heading_gain: float = HEADING_GAIN


# Integral and derivative part of the force, N; last error, m; force that was asked for, N.
STATE = ("integral", "derivative", "last_error", "asked")
INTEGRAL, DERIVATIVE, LAST_ERROR, ASKED = range(len(STATE))


@piece
def pid_force(started, y, applied, velocity, h, gains, state):
    """Force on the centre of mass in one axis, N.

    Args:
        started: 0.0 at the first call of an episode.
        y: Measured error, m.
        applied: Force that was applied over the past period, N.
        velocity: Velocity of the reference, m/s, for the start from rest.
        h: Control period, s.
        gains: Gains.
        state: The numbers of `STATE`, advanced in place.
    """
    if started == 0.0:
        state[INTEGRAL], state[DERIVATIVE] = 0.0, gains.k_d * velocity
    else:
        memory = gains.derivative_time / (gains.derivative_time + h)
        slope = -(y - state[LAST_ERROR]) / h
        state[DERIVATIVE] = memory * state[DERIVATIVE] + (1.0 - memory) * gains.k_d * slope
        # T_i T_d = (k_p / k_i)(k_d / k_p).
        share = min(h / np.sqrt(gains.k_d / gains.k_i), 1.0) if gains.k_i > 0.0 else 0.0
        state[INTEGRAL] += share * (applied - state[ASKED]) - h * gains.k_i * y
    state[LAST_ERROR] = y
    state[ASKED] = state[INTEGRAL] + state[DERIVATIVE] - gains.k_p * y
    return state[ASKED]


@compiled
def pid(signals, h, mass, gains, state, force):
    """The law for a batch; fills in the force, N, (batch, axes)."""
    for b, axis in np.ndindex(force.shape):
        started, own = signals.started[b], state[b, axis]
        y, velocity = signals.y[b, axis], signals.velocity[b, axis]
        applied = mass * (signals.u[b, axis] + signals.acceleration[b, axis])
        force[b, axis] = pid_force(started, y, applied, velocity, h, gains, own)


class PID(ScriptedPolicy):
    """F = -(k_p e + k_i integral of e + k_d e'), e the measured position error."""

    Gains = PIDGains
    state = STATE

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """The law."""
        pid(signals, self._model.h, self._model.mass, self.gains, state, force)
