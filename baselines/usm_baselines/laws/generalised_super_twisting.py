"""The generalised super-twisting controller, with constant and with adaptive gains.

A linear term joins each half of the super-twisting law, so that disturbances that grow with the
state are met as well:

    u = -k_1 phi_1(sigma) + v,   v' = -k_2 phi_2(sigma),
    phi_1 = |sigma|^(1/2) sgn(sigma) + linear sigma,   phi_2 = phi_1' phi_1.

Sliding variable, observer and compensation are those of the paper, (10) and (15)-(19), the
observer with its homogeneous exponent.

Sources: J. A. Moreno, A linear framework for the robust stability analysis of a generalized
super-twisting algorithm, CCE 2009. I. Castillo, L. Fridman, J. A. Moreno, Super-twisting algorithm
in presence of time and state dependent perturbations, International Journal of Control 91, 2018.
Adaptive: I.-L. G. Borlaug, K. Y. Pettersen, J. T. Gravdahl, The generalized super-twisting
algorithm with adaptive gains, European Control Conference 2020.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_baselines.estimation.observer import (
    HOMOGENEOUS,
    compensating_force,
    observe,
    observer_gains,
)
from usm_baselines.laws.policy import HEADING_RANGE, ScriptedPolicy
from usm_baselines.laws.super_twisting import adapt
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Range, Space
from usm_gym.kernels.compile import compiled, piece
from usm_gym.task.nominal import Nominal

_SHARED: Space = {
    "observer_gain": Range(1e-2, 100.0, "m/s^3"),
    "surface": Range(0.3, 30.0, "1/s"),
    "linear": Range(0.1, 100.0, "(s/m)^(1/2)"),
    "heading_gain": HEADING_RANGE,
}
GENERALISED_SPACE: Space = {
    **_SHARED,
    "k_1": Range(1e-3, 10.0, "(m/s)^(1/2)/s"),
    "k_2": Range(1e-4, 10.0, "m/s^2"),
}
ADAPTIVE_SPACE: Space = {
    **_SHARED,
    "epsilon": Range(1e-3, 1.0, "(m/s)^(1/2)/s"),
    "omega": Range(1e-3, 10.0, "(m/s)^(1/2)/s^2"),
    "dead_zone": Range(1e-4, 0.1, "m/s"),
}


class GeneralisedGains(NamedTuple):
    """Gains of the generalised super-twisting controller.

    Attributes:
        observer_gain: L of the observer, m/s^3.
        surface: lambda of (10), 1/s.
        linear: Weight of the linear term beside the square root, (s/m)^(1/2).
        k_1: Gain of the proportional half, (m/s)^(1/2)/s.
        k_2: Gain of the integral half, m/s^2.
        heading_gain: k_psi, N m/rad.
    """

    observer_gain: float = 25.0
    surface: float = 0.6
    linear: float = 50.0
    k_1: float = 0.02
    k_2: float = 0.015
    heading_gain: float = 100.0


class AdaptiveGains(NamedTuple):
    """Gains of the adaptive form: k_1 is alpha and k_2 is beta of (12)-(14) of the paper.

    Attributes:
        observer_gain: L of the observer, m/s^3.
        surface: lambda of (10), 1/s.
        linear: Weight of the linear term beside the square root, (s/m)^(1/2).
        epsilon: epsilon of (13).
        beta_offset: lambda of (13), m/s^2.
        gamma: gamma_1 of (12).
        omega: omega_1 of (12).
        dead_zone: alpha_m of (14), m/s.
        alpha_start: alpha at the start.
        heading_gain: k_psi, N m/rad.
    """

    observer_gain: float = 25.0
    surface: float = 0.6
    linear: float = 50.0
    epsilon: float = 0.01
    beta_offset: float = 0.015
    gamma: float = 1.0
    omega: float = 0.01
    dead_zone: float = 0.03
    alpha_start: float = 0.02
    heading_gain: float = 100.0


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
        state: (v,) in an array; becomes that of the next step.
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
    """Observer and controller for a batch, both axes; fills in the force, (batch, 2)."""
    k = observer_gains(gains.observer_gain, HOMOGENEOUS)
    for b in range(force.shape[0]):
        for axis in range(2):
            own = state[b, axis]
            started, y, u = signals.started[b], signals.y[b, axis], signals.u[b, axis]
            velocity, acceleration = signals.velocity[b, axis], signals.acceleration[b, axis]
            if started == 0.0:
                own[4], own[5] = 0.0, gains.alpha_start
            z1, z2 = observe(True, started, y, u, velocity, h, k, own)
            sigma = gains.surface * own[0] + own[1]
            alpha = own[5]
            beta, own[5] = adapt(sigma, alpha, h, gains)
            u = implicit_generalised(sigma, h, alpha, beta, gains.linear, own[4:])
            force[b, axis] = compensating_force(z1, z2, acceleration, mass, gains.surface, u, own)


class AdaptiveGeneralisedSuperTwisting(ScriptedPolicy):
    """The generalised super-twisting controller with the paper's adaptation of its gains.

    The law's state is (p1, p2, p3, e) of the observer, v and alpha for each axis.
    """

    law_size = 6
    positive = ("observer_gain",)

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Take gains other than the defaults by name, see `AdaptiveGains`."""
        super().__init__(nominal, AdaptiveGains(**gains))
        self._law = self.gains

    def force(self, signals: Signals, law_state: Array) -> Array:
        """The control (19) with the generalised law."""
        force = np.empty_like(signals.y)
        model = self._model
        generalised_super_twisting(signals, model.h, model.mass, self._law, law_state, force)
        return force


class GeneralisedSuperTwisting(AdaptiveGeneralisedSuperTwisting):
    """The generalised super-twisting controller: the adaptive one, whose gains keep still."""

    def __init__(self, nominal: Nominal, **gains: float) -> None:
        """Take gains other than the defaults by name, see `GeneralisedGains`."""
        ScriptedPolicy.__init__(self, nominal, GeneralisedGains(**gains))
        own = self.gains
        self._law = AdaptiveGains(
            observer_gain=own.observer_gain,
            surface=own.surface,
            linear=own.linear,
            epsilon=0.0,
            beta_offset=own.k_2,
            omega=0.0,
            alpha_start=own.k_1,
            heading_gain=own.heading_gain,
        )
