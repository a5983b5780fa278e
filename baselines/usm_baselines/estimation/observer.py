"""The third-order sliding-mode observer, equations (15)-(17) of the paper, for one axis.

It runs on the tracking error, with `u`, the applied force over the mass less the acceleration of
the reference, as its input. Its states are then the estimates of the error (m), of its rate (m/s)
and of the disturbance (m/s^2), which stand for the paper's p1 - p_ref, p2 - p_ref' and p3.
"""

from __future__ import annotations

import numpy as np

from usm_baselines.space import Gain
from usm_gym.kernels.compile import piece
from usm_gym.kernels.elementary import cube_root
from usm_gym.support.validation import require

# The numbers of its state in an axis: p1, p2, p3, and e, which its next step starts from.
NAMES = ("error", "rate", "disturbance", "root")
ERROR, RATE, DISTURBANCE, ROOT = range(len(NAMES))
# Exponent of L in k2: that printed in the paper, and the one that homogeneity asks for.
PRINTED, HOMOGENEOUS = 0.5, 2 / 3
# The gains of the observer, which all laws on it share; the defaults are those of the paper.
OBSERVER_GAIN = Gain(
    55.0,
    "m/s^3",
    "L of the observer; bounds the rate of the disturbance",
    tuned=(1e-2, 1e4),
    positive=True,
)
K2_EXPONENT = Gain(PRINTED, "1", "exponent of L in k2: 0.5 as printed, or 2/3")


def check_exponent(k2_exponent: float) -> None:
    """Refuse an exponent that is neither printed nor homogeneous."""
    allowed = (PRINTED, HOMOGENEOUS)
    require(k2_exponent in allowed, "k2_exponent", k2_exponent, "0.5 or 2/3")


@piece
def observer_gains(L, k2_exponent):
    """(k1, k2, k3) = (6 L^(1/3), 11 L^k2_exponent, 6 L)."""
    root = cube_root(L)
    k2 = 11.0 * (np.sqrt(L) if k2_exponent == PRINTED else root * root)
    return 6.0 * root, k2, 6.0 * L


@piece
def implicit_observer(y, u, h, k, state):
    """One implicit step, exact in its sliding set: (16) with e1 taken at the new time.

    Args:
        y: Measured error, m.
        u: Input over the past step, m/s^2.
        h: Step, s.
        k: Gains (k1, k2, k3).
        state: (p1, p2, p3, e) at the old time, in an array; becomes that at the new time. e is the
            cube root of e1 = y - p1, of the same sign, as the next step needs it.

    Returns:
        The corrections (z1, z2) at the new time, m/s and m/s^2.
    """
    k1, k2, k3 = k
    b = y - state[0] - h * state[1] - h * h * (state[2] + u)
    sliding = h * h * h * k3
    # With r^3 = |e1|: r^3 + h k1 r^2 + h^2 k2 r + h^3 k3 = |b|, a rising function of r > 0.
    r = 0.0
    xi = b / sliding
    if abs(b) > sliding:
        xi = 1.0 if b > 0.0 else -1.0
        # Newton from the right of the root of a convex function descends to it.
        excess = abs(b) - sliding
        r = cube_root(excess)
        for _ in range(50):
            value = ((r + h * k1) * r + h * h * k2) * r - excess
            slope = (3.0 * r + 2.0 * h * k1) * r + h * h * k2
            step = value / slope
            r -= step
            if step <= 1e-15 * r:
                break
    z1 = k1 * r * r * xi
    z2 = k2 * r * xi
    state[2] += h * k3 * xi
    state[1] += h * (state[2] + z2 + u)
    state[3] = r * xi
    state[0] = y - r * r * r * xi
    return z1, z2


@piece
def explicit_observer(y, u, h, k, state):
    """One step of Euler's forward method on (15)-(16), as in the paper; see the implicit one."""
    k1, k2, k3 = k
    e = state[3]
    state[0] += h * (state[1] + k1 * e * abs(e))
    state[1] += h * (state[2] + k2 * e + u)
    state[2] += h * k3 * np.sign(e)
    error = y - state[0]
    e = cube_root(abs(error)) * np.sign(error)
    state[3] = e
    return k1 * e * abs(e), k2 * e


@piece
def observe(implicit, started, y, u, velocity, h, k, state):
    """One step of either observer; at the start, begin at the measurement and at rest.

    Args:
        implicit: Whether to take the implicit step.
        started: 0.0 at the first call of an episode.
        y: Measured error, m.
        u: Input over the past step, m/s^2.
        velocity: Velocity of the reference now, m/s.
        h: Step, s.
        k: Gains (k1, k2, k3).
        state: (p1, p2, p3, e), see `implicit_observer`, advanced in place.

    Returns:
        The corrections (z1, z2), m/s and m/s^2.
    """
    if started == 0.0:
        state[0], state[1], state[2], state[3] = y, -velocity, 0.0, 0.0
        return 0.0, 0.0
    if implicit:
        return implicit_observer(y, u, h, k, state)
    return explicit_observer(y, u, h, k, state)


@piece
def perceive(signals, b, axis, implicit, h, k, state):
    """`observe` on the signals of a robot in an axis; or what a navigator estimates of both.

    With a navigator, position and velocity count as measured, and the disturbance as unknown: the
    paper's first case, in which (9) needs no observer.

    Args:
        signals: `usm_baselines.signals.Signals`.
        b: Which robot.
        axis: Which axis.
        implicit: Whether to take the implicit step.
        h: Step, s.
        k: Gains (k1, k2, k3).
        state: (p1, p2, p3, e), advanced in place.

    Returns:
        The corrections (z1, z2), m/s and m/s^2.
    """
    if signals.navigated:
        state[ERROR], state[RATE] = signals.y[b, axis], signals.rate[b, axis]
        state[DISTURBANCE] = 0.0
        return 0.0, 0.0
    started, velocity = signals.started[b], signals.velocity[b, axis]
    return observe(implicit, started, signals.y[b, axis], signals.u[b, axis], velocity, h, k, state)
