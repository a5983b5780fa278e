"""Theorem 1 of the paper, numerically: the closed loop (30) under the worst disturbance there is.

One axis of a unit mass under the paper's observer and law, p'' = F + u; the rate of F is bounded,
and its sign chosen at every step so as to do harm.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation.observer import observe, observer_gains
from usm_baselines.laws.super_twisting import SuperTwistingGains, super_twisting_force
from usm_baselines.paper.paper_rate import Record
from usm_gym.kernels.compile import compiled
from usm_gym.kernels.elementary import cube_root

Array = NDArray[np.float64]

# Euler's step, s.
STEP = 1e-4


class Start(NamedTuple):
    """Where the closed loop starts.

    Attributes:
        error: Position error, m.
        sigma: Sliding variable, m/s.
        e1: Observer error in the position, m.
        e2: Observer error in the velocity, m/s.
        e3: Observer error in the disturbance, m/s^2.
    """

    error: float = 0.0
    sigma: float = 0.0
    e1: float = 0.0
    e2: float = 0.0
    e3: float = 0.0


class Trace(NamedTuple):
    """States of (30) along a run.

    Attributes:
        time: Times, s, (samples,).
        error: Position error, m, (samples,).
        sigma: Sliding variable, m/s, (samples,).
        alpha: Adaptive gain, (samples,).
        observer_error: e1 (m), e2 (m/s), e3 (m/s^2), (samples, 3).
    """

    time: Array
    error: Array
    sigma: Array
    alpha: Array
    observer_error: Array


def cascade(
    gains: SuperTwistingGains,
    start: Start,
    duration: float,
    rate: float = 0.0,
    switch: tuple[float, float] = (0.0, 0.0),
) -> Trace:
    """Run (30).

    Args:
        gains: Gains.
        start: The start; the disturbance is e3 there.
        duration: Length, s.
        rate: |F'|, m/s^3.
        switch: Weights of (e2/L)^(1/2), with the sign of e2, and e3/L in the sum whose sign F'
            takes; by default F' is constant.
    """
    samples = round(duration / STEP)
    states = np.empty((6, samples))
    run_cascade(gains, start, rate, np.array(switch), STEP, states)
    error, sigma, alpha = states[:3]
    return Trace(STEP * np.arange(float(samples)), error, sigma, alpha, states[3:].T)


@compiled
def run_cascade(gains, start, rate, switch, h, states):
    """Fill in (error, sigma, alpha, e1, e2, e3) at every step, (6, samples)."""
    L = gains.observer_gain
    k = observer_gains(L, gains.k2_exponent)
    state = np.zeros(6)
    state[0] = start.error - start.e1
    state[1] = start.sigma - gains.surface * state[0]
    state[3] = cube_root(abs(start.e1)) * np.sign(start.e1)
    state[5] = gains.alpha_start
    p, v, F, u = start.error, state[1] + start.e2, start.e3, 0.0
    for i in range(states.shape[1]):
        e1, e2, e3 = p - state[0], v - state[1], F - state[2]
        states[0, i], states[1, i] = p, gains.surface * state[0] + state[1]
        states[2, i] = state[5]
        states[3, i], states[4, i], states[5, i] = e1, e2, e3
        harm = switch[0] * np.sign(e2) * np.sqrt(abs(e2) / L) + switch[1] * e3 / L
        p, v, F = p + h * v, v + h * (F + u), F + h * (-rate if harm < 0.0 else rate)
        z1, z2 = observe(False, 1.0, p, u, 0.0, h, k, state)
        u = super_twisting_force(z1, z2, 0.0, h, 1.0, gains, False, state)


def size(observer_error: Array, L: float) -> Array:
    """Homogeneous norm of the observer error, s, (samples,): in it, any size behaves alike."""
    e1, e2, e3 = np.abs(observer_error.T) / L
    return np.asarray(np.cbrt(e1) + np.sqrt(e2) + e3)


def switches() -> list[tuple[float, float]]:
    """Ways to choose the sign of F': constant, and by e2 and e3 with weights all around."""
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 25).tolist()
    return [(0.0, 0.0), *((math.sin(angle), math.cos(angle)) for angle in angles)]


def growth(rate: float, exponent: float) -> float:
    """How many times larger the observer error becomes under the worst of `switches`.

    The equations (17) are homogeneous: whether an error shrinks does not depend on its size, and
    one start tells of all.

    Args:
        rate: |F'|, m/s^3.
        exponent: Exponent of L in k2.

    Returns:
        Size of the error in the last eighth of 2.7 s over that in the first.
    """
    gains = SuperTwistingGains(k2_exponent=exponent)
    worst = 0.0
    for switch in switches():
        trace = cascade(gains, Start(e2=1.0), 2.7, rate, switch)
        sizes = size(trace.observer_error, gains.observer_gain)
        part = len(sizes) // 8
        worst = max(worst, float(sizes[-part:].max() / sizes[:part].max()))
    return worst


def disturbance_rate(record: Record) -> Array:
    """|F'| in the worse axis between the samples of a run, m/s^3, (samples - 1,)."""
    steps = np.abs(np.diff(record.disturbance, axis=0)).max(axis=1)
    return np.asarray(steps / np.diff(record.time))
