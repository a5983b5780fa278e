"""The adaptive super-twisting controller, equations (10)-(14) and (18)-(20) of the paper."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.estimation import observer
from usm_baselines.estimation.observer import (
    DISTURBANCE,
    ERROR,
    RATE,
    check_exponent,
    observe,
    observer_gains,
)
from usm_baselines.policy import ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal


class SuperTwistingGains(NamedTuple):
    """Gains of the adaptive super-twisting controller, those of section 5.2.1 by default."""

    observer_gain: float = Gain(
        55.0,
        "m/s^3",
        "L of the observer; bounds the rate of the disturbance",
        tuned=(1e-2, 100.0),
        positive=True,
    )
    k2_exponent: float = Gain(0.5, "1", "exponent of L in k2: 0.5 as printed, or 2/3")
    surface: float = Gain(1.0, "1/s", "lambda of the sliding variable (10)", tuned=(0.3, 30.0))
    epsilon: float = Gain(1.0, "(m/s)^(1/2)/s", "epsilon of (13)", tuned=(1e-3, 1.0))
    beta_offset: float = Gain(
        1.0,
        "m/s^2",
        "lambda of (13), to which the paper gives the same letter as to that of (10)",
        tuned=(1e-4, 10.0),
    )
    gamma: float = Gain(1.0, "1", "gamma_1 of (12)")
    omega: float = Gain(8.0, "(m/s)^(1/2)/s^2", "omega_1 of (12)", tuned=(1e-3, 10.0))
    dead_zone: float = Gain(
        0.05, "m/s", "alpha_m of (14): below it alpha keeps still", tuned=(1e-4, 0.1)
    )
    alpha_start: float = Gain(
        0.0,
        "(m/s)^(1/2)/s",
        "alpha at the start, which the paper does not print",
        tuned=(1e-2, 10.0),
    )
    heading_gain: float = Gain(100.0, "N m/rad", "heading gain k_psi")


# The observer's numbers; v of (11), m/s^2; alpha, m^(1/2)/s^(3/2).
STATE = (*observer.NAMES, "integral", "alpha")
*_, INTEGRAL, ALPHA = range(len(STATE))


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
def compensating_force(z1, z2, acceleration, mass, surface, u, state):
    """The force (19), N, which makes sigma' = u for the estimated sigma = surface p1 + p2.

    Args:
        z1: First correction of the observer, m/s.
        z2: Second correction of the observer, m/s^2.
        acceleration: Acceleration of the reference, m/s^2.
        mass: Total mass m_t, kg.
        surface: lambda of (10), 1/s.
        u: What sigma' is to be, m/s^2.
        state: The observer's numbers.
    """
    return mass * (-surface * (state[RATE] + z1) - state[DISTURBANCE] - z2 + acceleration + u)


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
        state: The numbers of `STATE`; v and alpha are advanced in place.
    """
    sigma = gains.surface * state[ERROR] + state[RATE]
    v, alpha = state[INTEGRAL], state[ALPHA]
    if implicit:
        u_sta, v, alpha = implicit_super_twisting(sigma, h, gains, v, alpha)
    else:
        u_sta, v, alpha = explicit_super_twisting(sigma, h, gains, v, alpha)
    state[INTEGRAL], state[ALPHA] = v, alpha
    return compensating_force(z1, z2, acceleration, mass, gains.surface, u_sta, state)


@compiled
def super_twisting(signals, h, mass, gains, implicit, state, force):
    """Observer and controller for a batch; fills in the force, N, (batch, axes)."""
    k = observer_gains(gains.observer_gain, gains.k2_exponent)
    for b, axis in np.ndindex(force.shape):
        own, started = state[b, axis], signals.started[b]
        y, u = signals.y[b, axis], signals.u[b, axis]
        velocity, acceleration = signals.velocity[b, axis], signals.acceleration[b, axis]
        if started == 0.0:
            own[ALPHA] = gains.alpha_start
        z1, z2 = observe(implicit, started, y, u, velocity, h, k, own)
        force[b, axis] = super_twisting_force(z1, z2, acceleration, h, mass, gains, implicit, own)


class SuperTwisting(ScriptedPolicy):
    """The paper's controller: adaptive super-twisting on a third-order sliding-mode observer."""

    Gains = SuperTwistingGains
    state = STATE
    shown = ("rate", "disturbance", "integral", "alpha")

    def __init__(self, nominal: Nominal, implicit: bool = True, **gains: float) -> None:
        """Take gains other than the paper's by name, and whether to discretise implicitly."""
        super().__init__(nominal, **gains)
        check_exponent(self.gains.k2_exponent)
        require(
            self.gains.beta_offset + self.gains.epsilon > 0,
            "beta_offset",
            self.gains.beta_offset,
            "a number > 0 where epsilon is 0, for beta to be positive",
        )
        self._implicit = implicit

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """The control (19)."""
        model = self._model
        super_twisting(signals, model.h, model.mass, self.gains, self._implicit, state, force)
