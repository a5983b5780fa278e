"""Incremental control: the force changes by what the acceleration is off, times an inertia.

Incremental nonlinear dynamic inversion (INDI). It has no model of drag, water or joint motion: what
acts now is in the acceleration that is estimated now, so that F = F_0 + m (a_wanted - a_0). The
acceleration a_0 is filtered, and the force F_0 alike, for both to be of the same time. F_0 is what
the thrusters make of their commands with the nominal lag. Without navigator, position errors are
differentiated twice, behind a first-order filter each; with one, its rates are, once.

Sources: S. Sieberling, Q. P. Chu, J. A. Mulder, Robust flight control using incremental nonlinear
dynamic inversion and angular acceleration prediction, Journal of Guidance, Control, and Dynamics
33, 2010; E. J. J. Smeur, Q. P. Chu, G. C. H. E. de Croon, Adaptive incremental nonlinear dynamic
inversion for attitude control of micro air vehicles, Journal of Guidance, Control, and Dynamics 39,
2016 (the same filter on both).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from usm_baselines.estimation.navigator import is_needed
from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.plant.thrusters import lag_shares
from usm_gym.task.nominal import Nominal


class IncrementalGains(NamedTuple):
    """Gains of incremental control."""

    filter_bandwidth: float = Gain(
        30.0,
        "rad/s",
        "omega of the filters on acceleration and force",
        tuned=(1.0, 2000.0),
        positive=True,
    )
    controller_bandwidth: float = Gain(4.0, "rad/s", "omega_c of the loop", tuned=(0.1, 30.0))
    inertia: float = Gain(
        17.0,
        "kg",
        "force over the acceleration that it is taken to cause",
        tuned=(2.0, 200.0),
        positive=True,
    )
    heading_gain: float = HEADING_GAIN


# Last measured error, m, and its rate, m/s; filtered acceleration of the error, and that which the
# thrust accounts for, m/s^2; thrust, N; and, m/s^2, what the thrust of the last period accounts for
# and that behind the first filter.
STATE = ("last_error", "rate", "acceleration", "thrust_share", "thrust", "last_push", "push")
LAST_ERROR, RATE, ACCELERATION, THRUST_SHARE, THRUST, LAST_PUSH, PUSH = range(len(STATE))


@piece
def track(y, rate, navigated, u, h, share, state):
    """Bring the filters to the present, in place.

    Args:
        y: Measured error, m.
        rate: The navigator's estimate of its rate, m/s.
        navigated: Whether there is one.
        u: What thrust and reference accelerated the error by over the past period, m/s^2.
        h: Control period, s.
        share: Share of the way to its input that a filter covers in a period.
        state: The numbers of `STATE`.
    """
    before = state[RATE]
    if navigated:
        state[RATE], state[PUSH] = rate, u
    else:
        # A second difference of positions is the mean acceleration of the last two periods.
        state[RATE] += share * ((y - state[LAST_ERROR]) / h - before)
        state[PUSH] += share * (0.5 * (u + state[LAST_PUSH]) - state[PUSH])
    state[ACCELERATION] += share * ((state[RATE] - before) / h - state[ACCELERATION])
    state[THRUST_SHARE] += share * (state[PUSH] - state[THRUST_SHARE])
    state[LAST_ERROR], state[LAST_PUSH] = y, u


@piece
def wanted(omega, error, rate):
    """The acceleration of the error that places both poles at -omega, m/s^2."""
    return -omega * omega * error - 2.0 * omega * rate


@compiled
def indi(signals, h, mass, lag, mean_lag, gains, state, force):
    """Filters and law for a batch; fills in the force, N, (batch, axes).

    Args:
        signals: What the law works with.
        h: Control period, s.
        mass: Total mass m_t, kg.
        lag: Share of the way to its command that a thruster covers in a period.
        mean_lag: The mean of that share over a period.
        gains: Gains.
        state: The numbers of `STATE`, (batch, axes, 7).
        force: Where to write.
    """
    share = 1.0 - exp_of_negative(-gains.filter_bandwidth * h)
    for b, axis in np.ndindex(force.shape):
        own, acceleration = state[b, axis], signals.acceleration[b, axis]
        y = signals.y[b, axis]
        way = mass * (signals.u[b, axis] + acceleration) - own[THRUST]
        u = (own[THRUST] + mean_lag * way) / gains.inertia - acceleration
        own[THRUST] += lag * way
        if signals.started[b] == 0.0:
            own[LAST_ERROR], own[RATE] = y, -signals.velocity[b, axis]
        else:
            track(y, signals.rate[b, axis], signals.navigated, u, h, share, own)
        increment = wanted(gains.controller_bandwidth, y, own[RATE]) - own[ACCELERATION]
        force[b, axis] = gains.inertia * (own[THRUST_SHARE] + increment + acceleration)


class Incremental(ScriptedPolicy):
    """Incremental nonlinear dynamic inversion."""

    Gains = IncrementalGains
    state = STATE
    shown = ("rate", "acceleration", "thrust_share")

    def __init__(self, nominal: Nominal, **gains: Any) -> None:
        """Take gains other than the defaults by name."""
        # The law models the lag itself: a navigator takes commands.
        super().__init__(nominal, lag=False, navigated=is_needed(nominal), **gains)
        self._lag = lag_shares(nominal.thruster_time_constant, nominal.control_period)

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Increment the force."""
        model, (lag, mean_lag) = self._model, self._lag
        indi(signals, model.h, model.mass, lag, mean_lag, self.gains, state, force)
