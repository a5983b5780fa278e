"""The PD controller (21) in its three readings, on the same observer as the super-twisting one."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

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
from usm_baselines.laws.super_twisting import SURFACE, compensating_force
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain, Range, Space, space_of
from usm_gym.kernels.compile import compiled, piece
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal

Reading = Literal["force", "mass", "observer"]
READINGS: tuple[Reading, ...] = ("force", "mass", "observer")
FORCE, MASS, OBSERVER = range(3)


class PDGains(NamedTuple):
    """Gains of the PD controller, those of section 5.2.2 by default.

    In the readings "mass" and "observer" k_p is in 1/s^2 and k_d in 1/s.
    """

    k_p: float = Gain(200.0, "N/m", "proportional gain", tuned=(10.0, 1e5))
    k_d: float = Gain(6.0, "N s/m", "derivative gain", tuned=(1.0, 1e4))
    observer_gain: float = OBSERVER_GAIN
    k2_exponent: float = K2_EXPONENT
    surface: float = Gain(1.0, "1/s", 'lambda of (19); for the reading "observer" only')
    heading_gain: float = HEADING_GAIN


# Where the gains are tuned, by reading.
SPACES: dict[Reading, Space] = {
    "force": space_of(PDGains),
    "mass": space_of(
        PDGains,
        k_p=Range(1.0, 1e4, "1/s^2"),
        k_d=Range(0.1, 1e3, "1/s"),
    ),
    "observer": space_of(
        PDGains,
        k_p=Range(0.1, 1e3, "1/s^2"),
        k_d=Range(0.01, 100.0, "1/s"),
        surface=Range(*SURFACE, "1/s"),
    ),
}


@piece
def pd_force(z1, z2, acceleration, mass, gains, reading, state):
    """Force on the centre of mass in one axis, N; see `PD` for the readings.

    Args:
        z1: First correction of the observer, m/s.
        z2: Second correction of the observer, m/s^2.
        acceleration: Acceleration of the reference, m/s^2.
        mass: Total mass m_t, kg.
        gains: Gains.
        reading: FORCE, MASS or OBSERVER.
        state: The observer's numbers.
    """
    u_pd = -gains.k_d * state[RATE] - gains.k_p * state[ERROR]
    if reading == FORCE:
        return u_pd
    if reading == MASS:
        return mass * (acceleration + u_pd)
    return compensating_force(z1, z2, acceleration, mass, gains.surface, u_pd, state)


@compiled
def pd(signals, h, mass, gains, reading, state, force):
    """Observer and controller for a batch; fills in the force, N, (batch, axes)."""
    k = observer_gains(gains.observer_gain, gains.k2_exponent)
    for b, axis in np.ndindex(force.shape):
        own, acceleration = state[b, axis], signals.acceleration[b, axis]
        z1, z2 = perceive(signals, b, axis, True, h, k, own)
        force[b, axis] = pd_force(z1, z2, acceleration, mass, gains, reading, own)


class PD(ScriptedPolicy):
    """The PD controller (21), F being the force on the centre of mass.

    - "force": F = k_d (p_ref' - p2) + k_p (p_ref - p1), as in the paper's reference [1], and the
      only reading that gives errors of the size of Table 1.
    - "mass": F = m_t (p_ref'' + u_PD).
    - "observer": (19) with u_PD in the place of u_STA, the paper's words to the letter; the
      observer's estimate then cancels every disturbance.
    """

    Gains = PDGains
    state = observer.NAMES
    shown = ("rate", "disturbance")

    def __init__(self, nominal: Nominal, reading: Reading = "force", **gains: Any) -> None:
        """Take a reading, and gains other than the paper's by name."""
        super().__init__(nominal, **gains)
        check_exponent(self.gains.k2_exponent)
        require(reading in READINGS, "reading", reading, ", ".join(READINGS))
        self._reading = READINGS.index(reading)

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """The control (21)."""
        model = self._model
        pd(signals, model.h, model.mass, self.gains, self._reading, state, force)
