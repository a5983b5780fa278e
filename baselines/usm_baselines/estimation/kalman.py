"""The linear nominal model of one axis, and the Kalman filter on it.

The model of an axis is that of the straight body, which lies along x (`World.straight_body`): its
mass with added mass and its linear drag. With the tracking error e, its rate v, a constant unknown
disturbance d, the thrust f and its command u over the inertia, and a known acceleration w:

    e' = v,   v' = -(drag / inertia) v + d + f + w,   d' = 0,   f' = (u - f) / lag.

Sampled exactly with u and w held (K. J. Astrom, B. Wittenmark, Computer-Controlled Systems, 3rd
edition, 1997). The filter is the stationary one (B. D. O. Anderson, J. B. Moore, Optimal Filtering,
1979, chapter 4): white noise drives v and d, the measurement of e has the nominal noise; f is
computed, not corrected.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import piece
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

Array = NDArray[np.float64]

# The state of the filter in one axis, and how many numbers it has.
ERROR, RATE, DISTURBANCE, THRUST = range(4)
STATES = 4
# Columns of the transition beside those of the state.
COMMAND, KNOWN = 4, 5
# A thruster with a lag below this share of the control period counts as one without.
SHORTEST_LAG = 1e-3
# Measurement noise below this, m, is not believed: the model is not that good.
SMALLEST_NOISE = 1e-5


class Linear(NamedTuple):
    """The sampled model and the filter of all axes, in the form that kernels take.

    Attributes:
        inertia: Mass with added mass of the straight body, kg, (axes,).
        damping: Its linear drag over that, 1/s, (axes,).
        transition: (e, v, d, f) at the end of a period from (e, v, d, f, u, w), (axes, 4, 6).
        correction: Gains of the filter on (e, v, d), (axes, 3).
    """

    inertia: Array
    damping: Array
    transition: Array
    correction: Array


def sampled(damping: float, lag: float, h: float) -> Array:
    """The transition of one axis over a period h with u and w held, (4, 6)."""
    from scipy.linalg import expm  # here, because scipy.linalg takes long to import

    lag = max(lag, SHORTEST_LAG * h)
    A = np.zeros((6, 6))
    A[ERROR, RATE] = 1.0
    A[RATE, [RATE, DISTURBANCE, THRUST, KNOWN]] = -damping, 1.0, 1.0, 1.0
    A[THRUST, [THRUST, COMMAND]] = -1.0 / lag, 1.0 / lag
    return np.asarray(expm(h * A)[:STATES])


def process_noise(damping: float, h: float, acceleration: float, disturbance: float) -> Array:
    """Covariance that the noise adds to (e, v, d) in a period, (3, 3), by Van Loan's formula.

    C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Transactions on
    Automatic Control 23, 1978.
    """
    from scipy.linalg import expm

    A = np.zeros((3, 3))
    A[ERROR, RATE] = 1.0
    A[RATE, [RATE, DISTURBANCE]] = -damping, 1.0
    Q = np.diag([0.0, acceleration**2, disturbance**2])
    joint = expm(h * np.block([[-A, Q], [np.zeros((3, 3)), A.T]]))
    return np.asarray(joint[3:, 3:].T @ joint[:3, 3:])


def filter_gain(transition: Array, noise: Array, measurement: float) -> Array:
    """Stationary gain on (e, v, d), (3,).

    Args:
        transition: Transition of the axis, (4, 6).
        noise: Covariance of the process noise of a period, (3, 3).
        measurement: Standard deviation of the measurement, m.
    """
    from scipy.linalg import solve_discrete_are

    A, C = transition[:3, :3], np.array([[1.0, 0.0, 0.0]])
    R = np.array([[measurement**2]])
    P = solve_discrete_are(A.T, C.T, noise, R)
    return np.asarray(P[:, 0] / (P[0, 0] + R[0, 0]))


def linear_model(nominal: Nominal, acceleration_noise: float, disturbance_noise: float) -> Linear:
    """Sample the nominal model and compute the filter.

    Args:
        nominal: Nominal knowledge.
        acceleration_noise: Spectral density of what drives v, m/s^2 / sqrt(Hz).
        disturbance_noise: Spectral density of what drives d, m/s^3 / sqrt(Hz).

    Raises:
        ValueError: If a density is not above 0.
    """
    require(acceleration_noise > 0, "acceleration_noise", acceleration_noise, "a number > 0")
    require(disturbance_noise > 0, "disturbance_noise", disturbance_noise, "a number > 0")
    h, lag = nominal.control_period, nominal.thruster_time_constant
    inertia, drag = world_of(nominal.robot).straight_body
    damping = drag / inertia
    transition = np.stack([sampled(each, lag, h) for each in damping])
    measurement = max(nominal.position_noise, SMALLEST_NOISE)
    correction = [
        filter_gain(T, process_noise(each, h, acceleration_noise, disturbance_noise), measurement)
        for T, each in zip(transition, damping, strict=True)
    ]
    return Linear(inertia, damping, transition, np.stack(correction))


@piece
def start(y, velocity, state):
    """Begin at the measurement and at rest; `state` is (e, v, d, f), filled in."""
    state[ERROR], state[RATE], state[DISTURBANCE], state[THRUST] = y, -velocity, 0.0, 0.0


@piece
def predict(transition, u, w, state):
    """Move an axis on by a period, in place.

    Args:
        transition: Transition of the axis.
        u: Command over the inertia, held, m/s^2.
        w: Known acceleration, held, m/s^2.
        state: (e, v, d, f).
    """
    e, v, d, f = state[ERROR], state[RATE], state[DISTURBANCE], state[THRUST]
    for i in range(STATES):
        row = transition[i]
        state[i] = row[0] * e + row[1] * v + row[2] * d + row[3] * f + row[4] * u + row[5] * w


@piece
def correct(correction, y, state):
    """Take in a measurement of the error, m; `state` is (e, v, d, f), corrected in place."""
    innovation = y - state[ERROR]
    for i in range(3):
        state[i] += correction[i] * innovation


@piece
def inputs(signals, mass, model, b, axis):
    """Last command over the inertia and known acceleration of an axis, m/s^2; see `estimate`."""
    acceleration = signals.acceleration[b, axis]
    last = (signals.u[b, axis] + acceleration) * mass / model.inertia[axis]
    return last, -acceleration - model.damping[axis] * signals.velocity[b, axis]


@piece
def estimate(signals, mass, model, b, axis, state):
    """One period of the filter on what was measured of robot b and applied to it, in place.

    A position that was seen before is no measurement.

    Args:
        signals: `usm_baselines.signals.Signals`.
        mass: Total mass m_t, kg.
        model: `Linear`.
        b: Which robot.
        axis: Which axis.
        state: Its (e, v, d, f).

    Returns:
        Last command over the inertia and known acceleration, m/s^2, and the innovation, m.
    """
    y = signals.y[b, axis]
    last, known = inputs(signals, mass, model, b, axis)
    innovation = 0.0
    if signals.started[b] == 0.0:
        start(y, signals.velocity[b, axis], state)
    else:
        predict(model.transition[axis], last, known, state)
        if signals.fresh[b]:
            innovation = y - state[ERROR]
            correct(model.correction[axis], y, state)
    return last, known, innovation
