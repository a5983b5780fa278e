"""PID with a filtered derivative and anti-windup by back-calculation.

Source: K. J. Astrom, T. Hagglund, PID Controllers: Theory, Design, and Tuning, 2nd edition, 1995,
chapter 3: derivative by backward differences behind a first-order filter, integral that tracks the
force which was really applied, with the time constant sqrt(T_i T_d).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.laws.policy import HEADING_RANGE, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Range, Space
from usm_gym.kernels.compile import compiled, piece
from usm_gym.task.nominal import Nominal

PID_SPACE: Space = {
    "k_p": Range(30.0, 30000.0, "N/m"),
    "k_i": Range(10.0, 100000.0, "N/(m s)"),
    "k_d": Range(10.0, 3000.0, "N s/m"),
    "derivative_time": Range(1e-3, 0.3, "s"),
    "heading_gain": HEADING_RANGE,
}

# The law's state in one axis.
INTEGRAL, DERIVATIVE, LAST_ERROR, ASKED = range(4)


class PIDGains(NamedTuple):
    """Gains of the PID controller.

    Attributes:
        k_p: Proportional gain, N/m.
        k_i: Integral gain, N/(m s).
        k_d: Derivative gain, N s/m.
        derivative_time: Time constant of the derivative's filter, s.
        heading_gain: k_psi, N m/rad.
    """

    k_p: float = 1300.0
    k_i: float = 10000.0
    k_d: float = 400.0
    derivative_time: float = 0.003
    heading_gain: float = 100.0


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
        state: (integral and derivative part of the force, N; last error, m; force asked for, N),
            advanced in place.
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
    """The law for a batch, both axes; fills in the force, (batch, 2)."""
    for b in range(force.shape[0]):
        for axis in range(2):
            force[b, axis] = pid_force(
                signals.started[b],
                signals.y[b, axis],
                mass * (signals.u[b, axis] + signals.acceleration[b, axis]),
                signals.velocity[b, axis],
                h,
                gains,
                state[b, axis],
            )


class PID(ScriptedPolicy):
    """F = -(k_p e + k_i integral of e + k_d e'), e the measured position error."""

    law_size = 4
    positive = ("k_d",)

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Take gains other than the defaults by name, see `PIDGains`."""
        super().__init__(nominal, PIDGains(**gains))

    def force(self, signals: Signals, law_state: Array) -> Array:
        """The law."""
        force = np.empty_like(signals.y)
        pid(signals, self._model.h, self._model.mass, self.gains, law_state, force)
        return force
