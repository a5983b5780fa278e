"""The adaptive super-twisting controller, equations (10)-(14) and (18)-(20) of the paper."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.estimation.observer import (
    check_exponent,
    compensating_force,
    observe,
    observer_gains,
)
from usm_baselines.laws.policy import ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Range, Space
from usm_gym.kernels.compile import compiled, piece
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal

SUPER_TWISTING_SPACE: Space = {
    "observer_gain": Range(1e-2, 100.0, "m/s^3"),
    "surface": Range(0.3, 30.0, "1/s"),
    "epsilon": Range(1e-3, 1.0, "(m/s)^(1/2)/s"),
    "beta_offset": Range(1e-4, 10.0, "m/s^2"),
    "omega": Range(1e-3, 10.0, "(m/s)^(1/2)/s^2"),
    "dead_zone": Range(1e-4, 0.1, "m/s"),
    "alpha_start": Range(1e-2, 10.0, "(m/s)^(1/2)/s"),
}


class SuperTwistingGains(NamedTuple):
    """Gains of the adaptive STA, those of section 5.2.1 by default.

    Attributes:
        observer_gain: L of the observer, m/s^3; bounds the rate of the disturbance.
        k2_exponent: Exponent of L in k2: 0.5 as printed, or 2/3.
        surface: lambda of the sliding variable (10), 1/s.
        epsilon: epsilon of (13).
        beta_offset: lambda of (13), which the paper gives the same letter as that of (10).
        gamma: gamma_1 of (12).
        omega: omega_1 of (12).
        dead_zone: alpha_m of (14), m/s: below it alpha keeps still.
        alpha_start: alpha at the start, which the paper does not print.
        heading_gain: k_psi, N m/rad.
    """

    observer_gain: float = 55.0
    k2_exponent: float = 0.5
    surface: float = 1.0
    epsilon: float = 1.0
    beta_offset: float = 1.0
    gamma: float = 1.0
    omega: float = 8.0
    dead_zone: float = 0.05
    alpha_start: float = 0.0
    heading_gain: float = 100.0


@piece
def adapt(sigma, alpha, h, gains):
    """(beta, next alpha) of (12)-(14); alpha grows while |sigma| is outside the dead zone."""
    beta = 2.0 * gains.epsilon * alpha + gains.beta_offset + 4.0 * gains.epsilon * gains.epsilon
    growth = gains.omega * np.sqrt(gains.gamma / 2.0) if abs(sigma) > gains.dead_zone else 0.0
    return beta, alpha + h * growth


@piece
def implicit_super_twisting(sigma, h, gains, v, alpha):
    """u_STA of (11) by an implicit step, exact in its sliding set.

    Args:
        sigma: Sliding variable, m/s.
        h: Step, s.
        gains: Gains.
        v: Integral term, m/s^2.
        alpha: Adapted gain.

    Returns:
        u_STA, and v and alpha of the next step.
    """
    beta, alpha_next = adapt(sigma, alpha, h, gains)
    b = sigma + h * v
    sliding = h * h * beta
    xi, root = b / sliding, 0.0
    if abs(b) > sliding:
        xi = 1.0 if b > 0.0 else -1.0
        half = 0.5 * h * alpha
        root = np.sqrt(half * half + abs(b) - sliding) - half
    v -= h * beta * xi
    return v - alpha * root * xi, v, alpha_next


@piece
def explicit_super_twisting(sigma, h, gains, v, alpha):
    """u_STA of (11) by Euler's forward method; see the implicit one."""
    beta, alpha_next = adapt(sigma, alpha, h, gains)
    sign = np.sign(sigma)
    return v - alpha * np.sqrt(abs(sigma)) * sign, v - h * beta * sign, alpha_next


@piece
def super_twisting_force(z1, z2, acceleration, h, mass, gains, implicit, state):
    """Force on the centre of mass in one axis, (19), N.

    Args:
        z1: First correction of the observer, m/s.
        z2: Second correction of the observer, m/s^2.
        acceleration: Acceleration of the reference, m/s^2.
        h: Control period, s.
        mass: Total mass m_t, kg.
        gains: Gains.
        implicit: Whether to discretise implicitly.
        state: The observer's four numbers, v and alpha; these two are advanced in place.
    """
    sigma = gains.surface * state[0] + state[1]
    if implicit:
        u_sta, state[4], state[5] = implicit_super_twisting(sigma, h, gains, state[4], state[5])
    else:
        u_sta, state[4], state[5] = explicit_super_twisting(sigma, h, gains, state[4], state[5])
    return compensating_force(z1, z2, acceleration, mass, gains.surface, u_sta, state)


@compiled
def super_twisting(signals, h, mass, gains, implicit, state, force):
    """Observer and controller for a batch, both axes; fills in the force, (batch, 2)."""
    k = observer_gains(gains.observer_gain, gains.k2_exponent)
    for b in range(force.shape[0]):
        for axis in range(2):
            own = state[b, axis]
            if signals.started[b] == 0.0:
                own[5] = gains.alpha_start
            z1, z2 = observe(
                implicit,
                signals.started[b],
                signals.y[b, axis],
                signals.u[b, axis],
                signals.velocity[b, axis],
                h,
                k,
                own,
            )
            acceleration = signals.acceleration[b, axis]
            force[b, axis] = super_twisting_force(
                z1, z2, acceleration, h, mass, gains, implicit, own
            )


class SuperTwisting(ScriptedPolicy):
    """The paper's controller: adaptive super-twisting on a third-order sliding-mode observer."""

    law_size = 6
    positive = ("observer_gain",)

    def __init__(self, nominal: Nominal, implicit: bool = True, **gains: float) -> None:
        """Take gains other than the paper's by name, see `SuperTwistingGains`."""
        super().__init__(nominal, SuperTwistingGains(**gains))
        check_exponent(self.gains.k2_exponent)
        require(
            self.gains.beta_offset + self.gains.epsilon > 0,
            "beta_offset",
            self.gains.beta_offset,
            "a number > 0 where epsilon is 0, for beta to be positive",
        )
        self._implicit = implicit

    def force(self, signals: Signals, law_state: Array) -> Array:
        """The control (19)."""
        force = np.empty_like(signals.y)
        model = self._model
        super_twisting(signals, model.h, model.mass, self.gains, self._implicit, law_state, force)
        return force
