"""The adaptive super-twisting controller, equations (10)-(14) and (18)-(20) of the paper.

The adaptation (14) lets alpha grow, and never fall. That of its source does: Y. Shtessel, M. Taleb,
F. Plestan, A novel adaptive-gain supertwisting sliding mode controller, Automatica 48, 2012.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from usm_baselines.estimation import observer
from usm_baselines.estimation.observer import (
    DISTURBANCE,
    ERROR,
    K2_EXPONENT,
    OBSERVER_GAIN,
    RATE,
    check_exponent,
    observer_gains,
    perceive,
)
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal

# Where the gains of the sliding variable and of the adaptation are tuned, in every law.
SURFACE, EPSILON, BETA_OFFSET = (0.1, 20.0), (1e-4, 1.0), (1e-4, 1.0)
OMEGA, DEAD_ZONE, ALPHA_START = (1e-4, 1.0), (1e-5, 0.3), (1e-4, 30.0)


class SuperTwistingGains(NamedTuple):
    """Gains of the adaptive super-twisting controller, those of section 5.2.1 by default."""

    observer_gain: float = OBSERVER_GAIN
    k2_exponent: float = K2_EXPONENT
    surface: float = Gain(1.0, "1/s", "lambda of the sliding variable (10)", tuned=SURFACE)
    epsilon: float = Gain(1.0, "(m/s)^(1/2)/s", "epsilon of (13)", tuned=EPSILON)
    beta_offset: float = Gain(
        1.0,
        "m/s^2",
        "lambda of (13), to which the paper gives the same letter as to that of (10)",
        tuned=BETA_OFFSET,
    )
    gamma: float = Gain(1.0, "1", "gamma_1 of (12)")
    omega: float = Gain(8.0, "(m/s)^(1/2)/s^2", "omega_1 of (12)", tuned=OMEGA)
    dead_zone: float = Gain(
        0.05, "m/s", "alpha_m of (14): below it alpha does not grow", tuned=DEAD_ZONE
    )
    alpha_start: float = Gain(
        0.0,
        "(m/s)^(1/2)/s",
        "alpha at the start, which the paper does not print, and the least it falls to",
        tuned=ALPHA_START,
    )
    fall: float = Gain(
        0.0,
        "1",
        "how fast alpha falls inside the dead zone, over how fast it grows outside: 0 as in (14), "
        "1 as in the law of Shtessel et al.",
    )
    heading_gain: float = HEADING_GAIN


# The observer's numbers; v of (11), m/s^2; alpha, m^(1/2)/s^(3/2).
STATE = (*observer.NAMES, "integral", "alpha")
*_, INTEGRAL, ALPHA = range(len(STATE))


@piece
def adapt(sigma, alpha, h, gains):
    """(beta, next alpha) of (12)-(14); alpha grows while |sigma| is outside the dead zone.

    Inside it falls, if it does, down to where it has started.
    """
    beta = 2.0 * gains.epsilon * alpha + gains.beta_offset + 4.0 * gains.epsilon * gains.epsilon
    change = h * (gains.omega * np.sqrt(gains.gamma / 2.0))
    if abs(sigma) > gains.dead_zone:
        return beta, alpha + change
    return beta, max(alpha - gains.fall * change, min(alpha, gains.alpha_start))


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
        own, acceleration = state[b, axis], signals.acceleration[b, axis]
        if signals.started[b] == 0.0:
            own[ALPHA] = gains.alpha_start
        z1, z2 = perceive(signals, b, axis, implicit, h, k, own)
        force[b, axis] = super_twisting_force(z1, z2, acceleration, h, mass, gains, implicit, own)


class SuperTwisting(ScriptedPolicy):
    """The paper's controller: adaptive super-twisting on a third-order sliding-mode observer."""

    Gains = SuperTwistingGains
    state = STATE
    shown = ("rate", "disturbance", "integral", "alpha")

    def __init__(self, nominal: Nominal, implicit: bool = True, **gains: Any) -> None:
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
