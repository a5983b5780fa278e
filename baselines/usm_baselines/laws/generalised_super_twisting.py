"""The generalised super-twisting controller, with constant and with adaptive gains.

A linear term joins each half of the super-twisting law, so that disturbances that grow with the
state are met as well:

    u = -k_1 phi_1(sigma) + v,   v' = -k_2 phi_2(sigma),
    phi_1 = |sigma|^(1/2) sgn(sigma) + linear sigma,   phi_2 = phi_1' phi_1.

Sliding variable, observer and compensation are those of the paper, (10) and (15)-(19).

Sources: J. A. Moreno, A linear framework for the robust stability analysis of a generalized
super-twisting algorithm, CCE 2009. I. Castillo, L. Fridman, J. A. Moreno, Super-twisting algorithm
in presence of time and state dependent perturbations, International Journal of Control 91, 2018.
Adaptive: I.-L. G. Borlaug, K. Y. Pettersen, J. T. Gravdahl, The generalized super-twisting
algorithm with adaptive gains, European Control Conference 2020.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from usm_baselines.estimation.observer import (
    ERROR,
    K2_EXPONENT,
    OBSERVER_GAIN,
    RATE,
    check_exponent,
    observer_gains,
    perceive,
)
from usm_baselines.laws.super_twisting import (
    ALPHA,
    ALPHA_START,
    BETA_OFFSET,
    DEAD_ZONE,
    EPSILON,
    INTEGRAL,
    OMEGA,
    STATE,
    SURFACE,
    adapt,
    compensating_force,
)
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece
from usm_gym.task.nominal import Nominal

# What both forms share.
SLOPE = Gain(0.6, "1/s", "lambda of (10)", tuned=SURFACE)
LINEAR = Gain(
    50.0, "(s/m)^(1/2)", "weight of the linear term beside the square root", tuned=(0.01, 1000.0)
)


class GeneralisedGains(NamedTuple):
    """Gains of the generalised super-twisting controller."""

    observer_gain: float = OBSERVER_GAIN
    k2_exponent: float = K2_EXPONENT
    surface: float = SLOPE
    linear: float = LINEAR
    heading_gain: float = HEADING_GAIN
    k_1: float = Gain(0.02, "(m/s)^(1/2)/s", "gain of the proportional half", tuned=(1e-4, 100.0))
    k_2: float = Gain(0.015, "m/s^2", "gain of the integral half", tuned=BETA_OFFSET)


class AdaptiveGains(NamedTuple):
    """Gains of the adaptive form: k_1 is alpha and k_2 is beta of (12)-(14) of the paper."""

    observer_gain: float = OBSERVER_GAIN
    k2_exponent: float = K2_EXPONENT
    surface: float = SLOPE
    linear: float = LINEAR
    heading_gain: float = HEADING_GAIN
    epsilon: float = Gain(0.01, "(m/s)^(1/2)/s", "epsilon of (13)", tuned=EPSILON)
    beta_offset: float = Gain(0.015, "m/s^2", "lambda of (13)", tuned=BETA_OFFSET)
    gamma: float = Gain(1.0, "1", "gamma_1 of (12)")
    omega: float = Gain(0.01, "(m/s)^(1/2)/s^2", "omega_1 of (12)", tuned=OMEGA)
    dead_zone: float = Gain(
        0.03, "m/s", "alpha_m of (14): below it alpha does not grow", tuned=DEAD_ZONE
    )
    alpha_start: float = Gain(0.02, "(m/s)^(1/2)/s", "alpha at the start", tuned=ALPHA_START)
    fall: float = Gain(0.0, "1", "how fast alpha falls inside the dead zone, as in `sta`")


@piece
def implicit_generalised(sigma, h, k_1, k_2, linear, state):
    """The generalised super-twisting law by an implicit step, exact in its sliding set: u.

    With r = |sigma|^(1/2) at the new time, sigma + h v = sigma_new + h k_1 phi_1 + h^2 k_2 phi_2 is
    a quadratic in r, and its constant term the size of the sliding set.

    Args:
        sigma: Sliding variable, m/s.
        h: Step, s.
        k_1: Gain of the proportional half.
        k_2: Gain of the integral half.
        linear: Weight of the linear term.
        state: v at its beginning, advanced in place.
    """
    b = sigma + h * state[0]
    sliding = 0.5 * h * h * k_2
    if abs(b) <= sliding:
        state[0] -= b / h
        return state[0]
    square = 1.0 + h * linear * (k_1 + h * k_2 * linear)
    half = 0.5 * h * (k_1 + 1.5 * h * k_2 * linear)
    excess = abs(b) - sliding
    r = excess / (half + np.sqrt(half * half + square * excess))
    sign = 1.0 if b > 0.0 else -1.0
    phi_1 = r * (1.0 + linear * r)
    state[0] -= h * k_2 * (0.5 + linear * r) * (1.0 + linear * r) * sign
    return state[0] - k_1 * phi_1 * sign


@compiled
def generalised_super_twisting(signals, h, mass, gains, state, force):
    """Observer and controller for a batch; fills in the force, N, (batch, axes)."""
    k = observer_gains(gains.observer_gain, gains.k2_exponent)
    for b, axis in np.ndindex(force.shape):
        own, acceleration = state[b, axis], signals.acceleration[b, axis]
        if signals.started[b] == 0.0:
            own[INTEGRAL], own[ALPHA] = 0.0, gains.alpha_start
        z1, z2 = perceive(signals, b, axis, True, h, k, own)
        sigma = gains.surface * own[ERROR] + own[RATE]
        alpha = own[ALPHA]
        beta, own[ALPHA] = adapt(sigma, alpha, h, gains)
        u = implicit_generalised(sigma, h, alpha, beta, gains.linear, own[INTEGRAL:])
        force[b, axis] = compensating_force(z1, z2, acceleration, mass, gains.surface, u, own)


class AdaptiveGeneralisedSuperTwisting(ScriptedPolicy):
    """The generalised super-twisting controller with the paper's adaptation of its gains."""

    Gains: type[Any] = AdaptiveGains
    state = STATE

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Take gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        check_exponent(self.gains.k2_exponent)
        self._adaptive = self.gains

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """The control (19) with the generalised law."""
        model = self._model
        generalised_super_twisting(signals, model.h, model.mass, self._adaptive, state, force)


class GeneralisedSuperTwisting(AdaptiveGeneralisedSuperTwisting):
    """The generalised super-twisting controller: the adaptive one, whose gains keep still."""

    Gains = GeneralisedGains

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Take gains other than the defaults by name."""
        super().__init__(nominal, **gains)
        own = self.gains
        self._adaptive = AdaptiveGains(
            observer_gain=own.observer_gain,
            k2_exponent=own.k2_exponent,
            surface=own.surface,
            linear=own.linear,
            heading_gain=own.heading_gain,
            epsilon=0.0,
            beta_offset=own.k_2,
            omega=0.0,
            alpha_start=own.k_1,
        )
