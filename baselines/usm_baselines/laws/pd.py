"""The PD controller (21) in its three readings, on the same observer as the super-twisting one."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from usm_baselines.estimation.observer import (
    check_exponent,
    compensating_force,
    observe,
    observer_gains,
)
from usm_baselines.laws.policy import HEADING_RANGE, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Range, Space
from usm_gym.kernels.compile import compiled, piece
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal

Reading = Literal["force", "mass", "observer"]
READINGS: tuple[Reading, ...] = ("force", "mass", "observer")
FORCE, MASS, OBSERVER = range(3)

PD_SPACES: dict[Reading, Space] = {
    "force": {
        "k_p": Range(30.0, 30000.0, "N/m"),
        "k_d": Range(10.0, 3000.0, "N s/m"),
        "observer_gain": Range(1e-2, 1000.0, "m/s^3"),
        "heading_gain": HEADING_RANGE,
    },
    "mass": {
        "k_p": Range(3.0, 3000.0, "1/s^2"),
        "k_d": Range(1.0, 300.0, "1/s"),
        "observer_gain": Range(1e-2, 1000.0, "m/s^3"),
        "heading_gain": HEADING_RANGE,
    },
    "observer": {
        "k_p": Range(0.3, 300.0, "1/s^2"),
        "k_d": Range(0.1, 30.0, "1/s"),
        "observer_gain": Range(1e-2, 1000.0, "m/s^3"),
        "surface": Range(0.1, 30.0, "1/s"),
        "heading_gain": HEADING_RANGE,
    },
}


class PDGains(NamedTuple):
    """Gains of the PD controller, those of section 5.2.2 by default.

    Attributes:
        k_p: Proportional gain: N/m in the reading "force", 1/s^2 in the others.
        k_d: Derivative gain: N s/m in the reading "force", 1/s in the others.
        observer_gain: L of the observer, m/s^3.
        k2_exponent: Exponent of L in k2: 0.5 as printed, or 2/3.
        surface: lambda of (19), 1/s; for the reading "observer" only.
        heading_gain: k_psi, N m/rad.
    """

    k_p: float = 200.0
    k_d: float = 6.0
    observer_gain: float = 55.0
    k2_exponent: float = 0.5
    surface: float = 1.0
    heading_gain: float = 100.0


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
        state: The observer's four numbers.
    """
    u_pd = -gains.k_d * state[1] - gains.k_p * state[0]
    if reading == FORCE:
        return u_pd
    if reading == MASS:
        return mass * (acceleration + u_pd)
    return compensating_force(z1, z2, acceleration, mass, gains.surface, u_pd, state)


@compiled
def pd(signals, h, mass, gains, reading, state, force):
    """Observer and controller for a batch, both axes; fills in the force, (batch, 2)."""
    k = observer_gains(gains.observer_gain, gains.k2_exponent)
    for b in range(force.shape[0]):
        for axis in range(2):
            z1, z2 = observe(
                True,
                signals.started[b],
                signals.y[b, axis],
                signals.u[b, axis],
                signals.velocity[b, axis],
                h,
                k,
                state[b, axis],
            )
            acceleration = signals.acceleration[b, axis]
            force[b, axis] = pd_force(z1, z2, acceleration, mass, gains, reading, state[b, axis])


class PD(ScriptedPolicy):
    """The PD controller (21), F being the force on the centre of mass.

    - "force": F = k_d (p_ref' - p2) + k_p (p_ref - p1), as in the paper's reference [1], and the
      only reading that gives errors of the size of Table 1.
    - "mass": F = m_t (p_ref'' + u_PD).
    - "observer": (19) with u_PD in the place of u_STA, the paper's words to the letter; the
      observer's estimate then cancels every disturbance.
    """

    law_size = 4
    positive = ("observer_gain",)

    def __init__(self, nominal: Nominal, reading: Reading = "force", **gains: float) -> None:
        """Take gains other than the paper's by name, see `PDGains`."""
        super().__init__(nominal, PDGains(**gains))
        check_exponent(self.gains.k2_exponent)
        require(reading in READINGS, "reading", reading, ", ".join(READINGS))
        self._reading = READINGS.index(reading)

    def force(self, signals: Signals, law_state: Array) -> Array:
        """The control (21)."""
        force = np.empty_like(signals.y)
        model = self._model
        pd(signals, model.h, model.mass, self.gains, self._reading, law_state, force)
        return force
