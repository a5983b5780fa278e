"""The physics steps of a control period, for blocks of robots.

Every quantity is a float64 or a `Lanes`, as in `chain`. `implicit` is the physics step h for
symplectic Euler with implicit drag and joints, and 0 for explicit Euler.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import piece
from usm_gym.kernels.elementary import sincos
from usm_gym.kernels.lanes import load, store
from usm_gym.plant.chain import accelerate, kinematics
from usm_gym.plant.joints import advance_references, joint_torques
from usm_gym.plant.layout import *
from usm_gym.plant.thrusters import push


class Plant(NamedTuple):
    """What all robots of a fleet share; with its first fields it serves as a `chain.Body`.

    Attributes:
        l, m, J, implicit, kirchhoff: As in `chain.Body`.
        links: Number of links.
        thruster_links: Zero-based link of each thruster, int64.
        thruster_is_normal: Whether each thruster pushes across its link.
        h: Physics step, s.
        substeps: Physics steps in a control period.
        shifts: Largest number of changes of the joint references in any episode.
        moving_water: Whether the water's velocity changes in any episode.
    """

    l: float
    m: float
    J: float
    implicit: float
    kirchhoff: float
    links: int
    thruster_links: NDArray[np.int64]
    thruster_is_normal: NDArray[np.bool_]
    h: float
    substeps: int
    shifts: int
    moving_water: bool


@piece
def move_water(block, like, h):
    """Velocity and acceleration of the water now."""
    frequency = load(block, WATER_FREQUENCY, like)
    angle = frequency * (load(block, CLOCK, like) * h)
    s, c = sincos(angle + load(block, PHASE_X, like))
    amplitude = load(block, AMPLITUDE_X, like)
    store(block, WATER_X, load(block, MEAN_X, like) + amplitude * s)
    store(block, WATER_AX, amplitude * (frequency * c))
    s, c = sincos(angle + load(block, PHASE_Y, like))
    amplitude = load(block, AMPLITUDE_Y, like)
    store(block, WATER_Y, load(block, MEAN_Y, like) + amplitude * s)
    store(block, WATER_AY, amplitude * (frequency * c))


@piece
def integrate(block, like, wide, stride, links, h, implicit):
    """Positions from the new velocities, or from the old ones where `implicit` is 0."""
    symplectic = implicit > 0.0
    theta, omega, alpha = row_of(THETA, links), row_of(OMEGA, links), row_of(ALPHA, links)
    for i in range(0, links, stride):
        old = load(block, omega + i, wide)
        new = old + h * load(block, alpha + i, wide)
        rate = new if symplectic else old
        store(block, omega + i, new)
        store(block, theta + i, load(block, theta + i, wide) + h * rate)
    for axis in range(2):
        old = load(block, V_X + axis, like)
        new = old + h * load(block, A_X + axis, like)
        rate = new if symplectic else old
        store(block, V_X + axis, new)
        store(block, P_X + axis, load(block, P_X + axis, like) + h * rate)
    store(block, CLOCK, load(block, CLOCK, like) + 1.0)


@piece
def physics_step(block, like, wide, stride, plant, base):
    """One physics step from kinematics that are known; arguments as in `chain.accelerate`."""
    links, h, implicit = plant.links, plant.h, plant.implicit
    if implicit > 0.0:
        advance_references(block, like, plant.shifts, h)
    push(block, like, plant)
    joint_torques(block, like, wide, stride, links, implicit)
    accelerate(block, like, wide, stride, links, base, plant)
    if implicit == 0.0:
        advance_references(block, like, plant.shifts, h)
    integrate(block, like, wide, stride, links, h, implicit)


@piece
def advance(block, like, wide, stride, plant):
    """Advance one block by a control period; `like`, `wide` and `stride` as in `chain`."""
    for _ in range(plant.substeps):
        if plant.moving_water:
            move_water(block, like, plant.h)
        base = kinematics(block, like, wide, stride, plant.links, plant.l)
        physics_step(block, like, wide, stride, plant, base)
