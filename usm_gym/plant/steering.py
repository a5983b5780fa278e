"""Joints that a policy moves: they follow the rates that it commands, within limits.

The angle that is commanded is the integral of the commanded rate u, and the reference of the
joint controller lags behind it: phi_ref' = (phi_cmd - phi_ref) / tau. So neither rate nor angle of
a reference is ever beyond the limits of what is commanded.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from usm_gym.kernels.compile import piece, shared
from usm_gym.kernels.elementary import exp_of_negative
from usm_gym.kernels.lanes import load, padded, store
from usm_gym.plant.thrusters import saturated

# Quantities of the joints, from the row `Steering.steering` on: reference, its rate, and the rate
# that is commanded.
ANGLE, RATE, COMMAND = range(3)
QUANTITIES = 3


class Steering(NamedTuple):
    """How the joints of all robots of a fleet are steered; a plant has the same fields.

    They are not nested there, because kernels that are shared out among threads take no tuples in
    tuples.

    Attributes:
        steering: First row of what is kept of it; 0 if the joints follow references of the task.
        joint_time_constant: tau, s.
        joint_decay: exp(-h / tau) of a physics step h.
        joint_rate_limit: Largest commanded rate, rad/s.
        joint_angle_limit: Largest commanded angle, rad.
    """

    steering: int
    joint_time_constant: float
    joint_decay: float
    joint_rate_limit: float
    joint_angle_limit: float


UNSTEERED = Steering(0, 1.0, 0.0, 0.0, 0.0)


def steering_of(
    first: int,
    step: float,
    time_constant: float,
    rate_limit: float = np.inf,
    angle_limit: float = np.inf,
) -> Steering:
    """How joints are steered; `step` is the physics step, s, and the rest as in `Steering`."""
    decay = float(exp_of_negative(-step / time_constant))
    return Steering(first, time_constant, decay, rate_limit, angle_limit)


@shared
def steering_row(first: int, quantity: int, links: int) -> int:
    """Row of a quantity of the first joint."""
    return first + quantity * padded(links)


@piece
def steer(row, lanes, lane, plant, action):
    """Set the commanded rates of one robot from its action in [-1, 1]; beyond it saturates.

    Within a control period no commanded angle goes beyond its limit.
    """
    links = plant.links
    period = plant.substeps * plant.h
    angle = steering_row(plant.steering, ANGLE, links)
    rate, command = angle + padded(links), angle + 2 * padded(links)
    for j in range(links - 1):
        wanted = saturated(float(action[j]), 1.0) * plant.joint_rate_limit
        commanded = row[(angle + j) * lanes + lane]
        commanded += plant.joint_time_constant * row[(rate + j) * lanes + lane]
        highest = (plant.joint_angle_limit - commanded) / period
        lowest = (-plant.joint_angle_limit - commanded) / period
        row[(command + j) * lanes + lane] = min(max(wanted, lowest), highest)


@piece
def steered_torque(block, wide, plant, j, k_p, k_d):
    """Move the reference of joint j on by a physics step.

    Returns:
        k_p phi_ref + k_d phi_ref' as of `lead` into the step.
    """
    links, h = plant.links, plant.h
    first = steering_row(plant.steering, ANGLE, links) + j
    angle, rate = load(block, first, wide), load(block, first + padded(links), wide)
    command = load(block, first + 2 * padded(links), wide)
    before = k_p * angle + k_d * rate
    away = plant.joint_decay * (rate - command)
    moved = h * command + plant.joint_time_constant * ((rate - command) - away)
    angle, rate = angle + moved, command + away
    store(block, first, angle)
    store(block, first + padded(links), rate)
    return before + (plant.lead / h) * (k_p * angle + k_d * rate - before)
