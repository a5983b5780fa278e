"""Control with a disturbance observer: the inverse of the nominal model behind a low-pass Q.

What the nominal model leaves out is what the measured motion asks for by the inverse of the model,
less the thrust that was applied: d = Q(s) ((s^2 + damping s) e - f - w). It is cancelled, and of
what is left the poles are placed. Q = omega^2 / (s + omega)^2, the least order that leaves nothing
to differentiate; where a navigator estimates the rate, Q = omega / (s + omega) on that.

Sampled, the inverse of the model is unstable (it has the zero at -1 of a sampled double
integrator), but not Q times it. That product is the observer of rate and disturbance alone, the
error being measured, whose poles are both at e^(-omega h). It is realised as this.

Sources: K. Ohnishi, M. Shibata, T. Murakami, Motion control for advanced mechatronics, IEEE/ASME
Transactions on Mechatronics 1, 1996; W.-H. Chen, J. Yang, L. Guo, S. Li, Disturbance-observer-based
control and related methods: an overview, IEEE Transactions on Industrial Electronics 63, 2016.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from usm_baselines.estimation import kalman
from usm_baselines.estimation.kalman import DISTURBANCE, ERROR, RATE, Linear
from usm_baselines.estimation.navigator import is_needed
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled
from usm_gym.task.nominal import Nominal


class DisturbanceObserverGains(NamedTuple):
    """Gains of control with a disturbance observer."""

    observer_bandwidth: float = Gain(
        30.0, "rad/s", "omega of the filter Q", tuned=(1.0, 2000.0), positive=True
    )
    controller_bandwidth: float = Gain(4.0, "rad/s", "omega_c of the loop", tuned=(0.1, 30.0))
    heading_gain: float = HEADING_GAIN


def q_gain(transition: Array, bandwidth: float, h: float) -> Array:
    """Gain on (e, v, d) of the observer that realises Q from positions, (3,).

    Args:
        transition: Transition of the axis, see `kalman`, (4, 6).
        bandwidth: omega of Q, rad/s.
        h: Control period, s.
    """
    unknown = [RATE, DISTURBANCE]
    A, c = transition[np.ix_(unknown, unknown)], transition[ERROR, unknown]
    away = A - math.exp(-bandwidth * h) * np.eye(2)
    # J. Ackermann's formula: A - L c has both poles where `away` is singular.
    L = away @ away @ np.linalg.solve(np.stack([c, c @ A]), [0.0, 1.0])
    return np.array([1.0, *L])


def rate_gain(transition: Array, bandwidth: float, h: float) -> float:
    """Gain on d of the observer that realises Q from rates; arguments as of `q_gain`."""
    return float((1.0 - math.exp(-bandwidth * h)) / transition[RATE, DISTURBANCE])


@compiled
def dob(signals, mass, model, rate_gain, omega, state, force):
    """Observer and law for a batch; fills in the force, N, (batch, axes).

    Args:
        signals: What the law works with.
        mass: Total mass m_t, kg.
        model: The linear model, with the gains of `q_gain`.
        rate_gain: Gains on d where the rate is known, (axes,).
        omega: Bandwidth of the loop, rad/s.
        state: (e, v, d, f), (batch, axes, 4).
        force: Where to write.
    """
    for b, axis in np.ndindex(force.shape):
        own, velocity = state[b, axis], signals.velocity[b, axis]
        y, rate = signals.y[b, axis], signals.rate[b, axis]
        last, known = kalman.inputs(signals, mass, model, b, axis)
        if signals.started[b] == 0.0:
            kalman.start(y, velocity, own)
        else:
            kalman.predict(model.transition[axis], last, known, own)
            if signals.navigated:
                own[DISTURBANCE] += rate_gain[axis] * (rate - own[RATE])
            elif signals.fresh[b]:
                kalman.correct(model.correction[axis], y, own)
        if signals.navigated:
            own[ERROR], own[RATE] = y, rate
        u = -omega * omega * own[ERROR] - (2.0 * omega - model.damping[axis]) * own[RATE]
        force[b, axis] = model.inertia[axis] * (u - own[DISTURBANCE] - known)


class DisturbanceObserver(ScriptedPolicy):
    """Pole placement, what the nominal model leaves out being observed and cancelled."""

    Gains = DisturbanceObserverGains
    # (e, v, d, f) of `kalman`; d is what the nominal model leaves out.
    state = ("error", "rate", "unmodelled", "thrust")
    shown = ("rate", "unmodelled")
    knows_lag = True

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Compute the observer's gains; gains other than the defaults by name."""
        super().__init__(nominal, navigated=is_needed(nominal), **gains)
        omega, h, lag = self.gains.observer_bandwidth, self._model.h, nominal.thruster_time_constant
        inertia, drag = self._world.straight_body
        transition = np.stack([kalman.sampled(each, lag, h) for each in drag / inertia])
        correction = np.stack([q_gain(T, omega, h) for T in transition])
        self._linear = Linear(inertia, drag / inertia, transition, correction)
        self._rate_gain = np.array([rate_gain(T, omega, h) for T in transition])

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Observe, cancel, and place the poles of what is left."""
        omega, mass = self.gains.controller_bandwidth, self._model.mass
        dob(signals, mass, self._linear, self._rate_gain, omega, state, force)
