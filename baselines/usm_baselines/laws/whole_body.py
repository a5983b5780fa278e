"""Whole-body control: one quadratic program allots thrusters and joints, within all limits.

It minimises, over the forces f of the thrusters and the rates q of the joints,

    |J q + (what f adds to the head within a horizon) - v|^2 + body^2 |T f - w|^2
    + reaction^2 |B q|^2 + posture^2 |q - q_home|^2 + effort^2 |f|^2,

where v is the velocity wanted of the head, as of `resolved_rates`, w the force and the moments that
the law for the body asks for, and B q the rates at which the body turns when joints turn at rates q
and nothing else acts, by the nominal plant with its added mass. The thrusters are slow, so that a
body that the joints turn stays turned for a while; a head that is moved with little reaction is
moved more exactly. Forces, rates and angles keep within their limits.

Sources: Y. Umetani, K. Yoshida, Resolved motion rate control of space manipulators with generalized
Jacobian matrix, IEEE Transactions on Robotics and Automation 5, 1989; D. N. Nenchev, K. Yoshida,
Impact analysis and post-impact motion control issues of a free-floating space robot subject to a
force impulse, ibidem 15, 1999 (reaction null space); A. Escande, N. Mansard, P.-B. Wieber,
Hierarchical quadratic programming, International Journal of Robotics Research 33, 2014.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from usm_baselines.head import (
    HEAD_GAIN,
    HEADING_LEAD,
    LEAD,
    POSTURE_GAIN,
    HeadLaw,
    HeadPercept,
    reactions,
)
from usm_baselines.laws.resolved_rates import wanted_velocities
from usm_baselines.planning import solve
from usm_baselines.policy import ScriptedPolicy
from usm_baselines.signals import Array
from usm_baselines.space import Gain
from usm_gym.kernels.compile import compiled
from usm_gym.plant.thrusters import saturated
from usm_gym.task.nominal import Nominal

# The active-set method takes about as many steps as numbers meet their limits, and no more than
# this times all numbers.
ROUNDS = 4
# Smallest curvature, relative to that of a joint that moves the head by 1 m/rad: none is singular.
LEAST = 1e-9
# Joints take at least this long to the limits of their angles, s.
BRAKING = 0.5


class WholeBodyGains(NamedTuple):
    """Gains of whole-body control."""

    head_gain: float = HEAD_GAIN
    lead: float = LEAD
    posture_gain: float = POSTURE_GAIN
    posture_weight: float = Gain(
        0.02, "m/rad", "rate of the head as bad as that of a joint", tuned=(1e-3, 0.3)
    )
    reaction_weight: float = Gain(
        0.1, "m/rad", "rate of the head as bad as that of the body", tuned=(1e-3, 1.0)
    )
    horizon: float = Gain(
        0.1, "s", "time in which thrusters are taken to move the head", tuned=(0.01, 1.0)
    )
    wrench_weight: float = Gain(
        0.1, "m/(N s)", "rate of the head as bad as a force that is wrong", tuned=(1e-4, 1.0)
    )
    heading_lead: float = HEADING_LEAD


@compiled
def bounded(H, g, low, high, x):
    """Fill in x that minimises x H x / 2 - g x, low <= x <= high, by an active-set method.

    Args:
        H: Curvature, (n, n), positive definite.
        g: Slope at 0, negated, (n,).
        low: Lower limits, (n,).
        high: Upper limits, (n,).
        x: Where to write, (n,).
    """
    n = g.size
    for i in range(n):
        x[i] = min(max(0.0, low[i]), high[i])
    held, A, b = np.zeros(n, np.bool_), np.empty((n, n)), np.empty((n, 1))
    for _ in range(ROUNDS * n):
        for i in range(n):
            b[i, 0] = x[i] if held[i] else g[i]
            for j in range(n):
                free = not (held[i] or held[j])
                A[i, j] = H[i, j] if free else 1.0 if i == j else 0.0
                if held[j] and not held[i]:
                    b[i, 0] -= H[i, j] * x[j]
        solve(A, b)
        # As far as the first limit in the way.
        way, stop = 1.0, -1
        for i in range(n):
            step = b[i, 0] - x[i]
            limit = high[i] if step > 0.0 else low[i]
            if abs(step) > abs(limit - x[i]) and abs(limit - x[i]) < way * abs(step):
                way, stop = (limit - x[i]) / step, i
        for i in range(n):
            x[i] = min(max(x[i] + way * (b[i, 0] - x[i]), low[i]), high[i])
        if stop >= 0:
            x[stop] = high[stop] if b[stop, 0] > x[stop] else low[stop]
            held[stop] = True
            continue
        # Let go of the limit that costs most.
        worst, most = -1, 0.0
        for i in range(n):
            if held[i]:
                slope = -g[i]
                for j in range(n):
                    slope += H[i, j] * x[j]
                cost = slope if x[i] == high[i] else -slope
                if cost > most:
                    worst, most = i, cost
        if worst < 0:
            break
        held[worst] = False


@compiled
def whole_body(known, model, correction, turns, wrenches, home, limits, gains, x):
    """Fill in forces, N, and rates, rad/s, of a batch, (batch, thrusters + joints).

    Args:
        known: What is known.
        model: Nominal knowledge.
        correction: What is added to the velocities wanted of the heads, (batch, channels).
        turns: How the bodies turn with the joints, (batch, angles, joints).
        wrenches: What the law for the body asks for, (batch, rows).
        home: Posture to return to, rad, (joints,).
        limits: Limits of the thrusters, N, (batch,).
        gains: The gains.
        x: Where to write.
    """
    channels, joints, pushes = model.channels, model.joints, known.body.signals.allocation
    thrusters = pushes.shape[2]
    n, rows, angles = thrusters + joints, pushes.shape[1], turns.shape[1]
    H, g, wanted = np.empty((n, n)), np.empty(n), np.empty(channels)
    low, high = np.empty(n), np.empty(n)
    A = np.zeros((channels + rows + angles, n))
    t = np.zeros(channels + rows + angles)
    for b in range(known.seen.shape[0]):
        seen, offset, jacobian = known.seen[b], known.offsets[b], known.jacobians[b]
        gain, lead = gains.head_gain, gains.lead
        wanted_velocities(seen, model, offset, correction[b], gain, lead, wanted)
        for c in range(channels):
            t[c] = wanted[c]
            for j in range(joints):
                A[c, thrusters + j] = jacobian[c, j]
            if c < model.axes:
                # Beyond what the law for the body does, which is not the head's business.
                for k in range(thrusters):
                    A[c, k] = gains.horizon / model.mass * pushes[b, c, k]
                t[c] += gains.horizon / model.mass * wrenches[b, c]
        for r in range(rows):
            t[channels + r] = gains.wrench_weight * wrenches[b, r]
            for k in range(thrusters):
                A[channels + r, k] = gains.wrench_weight * pushes[b, r, k]
        for a in range(angles):
            for j in range(joints):
                A[channels + rows + a, thrusters + j] = gains.reaction_weight * turns[b, a, j]
        for i in range(n):
            g[i] = 0.0
            for r in range(t.size):
                g[i] += A[r, i] * t[r]
            for j in range(n):
                H[i, j] = 0.0
                for r in range(t.size):
                    H[i, j] += A[r, i] * A[r, j]
            H[i, i] += LEAST
        for k in range(thrusters):
            low[k], high[k] = -limits[b], limits[b]
        square = gains.posture_weight * gains.posture_weight
        for j in range(joints):
            i, k = thrusters + j, model.joint_angles + j
            back = -gains.posture_gain * (seen[k] * model.scale[k] - home[j])
            H[i, i] += square
            g[i] += square * back
            # No faster towards the limit of the angle than to be there a while later.
            angle = seen[k] * model.scale[k]
            high[i] = saturated((model.angle_limit - angle) / BRAKING, model.rate_limit)
            low[i] = -saturated((model.angle_limit + angle) / BRAKING, model.rate_limit)
        bounded(H, g, low, high, x[b])


class WholeBody(HeadLaw):
    """Whole-body control by one quadratic program, over a law that asks for a wrench."""

    Gains: type[Any] = WholeBodyGains

    def __init__(self, nominal: Nominal, body: ScriptedPolicy, **gains: float) -> None:
        """Take the law for the body, and gains other than the defaults by name."""
        super().__init__(nominal, body, **gains)
        self._limit = self._world.layout.slices["thruster_limit"].start

    def act(self, known: HeadPercept, thrust: Array, correction: Array) -> tuple[Array, Array]:
        """Allot forces and rates together."""
        model, seen, thrusters = self._model, known.seen, thrust.shape[1]
        limits = seen[:, self._limit] * model.scale[self._limit]
        pushes = known.body.signals.allocation
        wrenches = np.einsum("brk,bk->br", pushes, thrust * limits[:, np.newaxis])
        turns = reactions(self._robot, seen, self._world.layout)
        found, home = np.zeros((len(seen), thrusters + model.joints)), self._home
        whole_body(known, model, correction, turns, wrenches, home, limits, self.gains, found)
        return found[:, :thrusters] / limits[:, np.newaxis], found[:, thrusters:]
