"""One control period of the plant: command, then all physics steps, for blocks of robots.

Every quantity is a float64 or a `Lanes`, as in `chain`. `implicit` is the physics step h for
symplectic Euler with implicit drag and joints, and 0 for explicit Euler.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import compiled, parallel, piece
from usm_gym.kernels.elementary import sincos
from usm_gym.kernels.lanes import WIDTH, block_at, load, spread, store, where
from usm_gym.plant.chain import accelerate, kinematics
from usm_gym.plant.layout import *
from usm_gym.plant.measure import command, measure


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


class Fleet(NamedTuple):
    """The robots simulated side by side, `size` of them in blocks of `lanes`.

    Attributes:
        blocks: All their numbers, see `layout`, shape (blocks, rows * lanes).
        instant: Control periods since the start, int64, (size,).
        noise: Measurement errors of the position, m, (size, control instants, 2).
        settled: Control period from which on errors count, int64, (size,).
        error: True position errors, m, (size, 2).
        max_error: Their largest absolute values since settling, m, (size, 2).
        heading_error: Heading errors as known on board, rad, (size,).
        effort: Mean absolute thruster commands, N, (size,).
        observation: Observations, float32, (size, numbers).
    """

    blocks: NDArray[np.float64]
    instant: NDArray[np.int64]
    noise: NDArray[np.float64]
    settled: NDArray[np.int64]
    error: NDArray[np.float64]
    max_error: NDArray[np.float64]
    heading_error: NDArray[np.float64]
    effort: NDArray[np.float64]
    observation: NDArray[np.float32]


@piece
def advance_references(block, like, shifts, h):
    """Move the joint references on by one physics step, towards the deflection now asked for."""
    t = load(block, CLOCK, like) * h
    target = like
    for k in range(shifts):
        reached = t >= load(block, SHIFT_TIME + k, like)
        target += where(reached, load(block, SHIFT_SIZE + k, like), like)
    x = load(block, DEFLECTION, like) - target
    rate = load(block, DEFLECTION_RATE, like)
    moved = load(block, FILTER_DD, like) * x + load(block, FILTER_DR, like) * rate
    turned = load(block, FILTER_RD, like) * x + load(block, FILTER_RR, like) * rate
    store(block, DEFLECTION, target + moved)
    store(block, DEFLECTION_RATE, turned)
    pull = load(block, FILTER_STIFFNESS, like) * moved + load(block, FILTER_DAMPING, like) * turned
    store(block, DEFLECTION_ACCELERATION, -pull)


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
def push(block, like, plant):
    """First-order lag of every thruster, and its force on its link."""
    links, thrusters = plant.links, plant.thruster_links.size
    along, across = row_of(PUSH_T, links), row_of(PUSH_N, links)
    for j in range(thrusters):
        store(block, along + plant.thruster_links[j], like)
        store(block, across + plant.thruster_links[j], like)
    lag = load(block, LAG, like)
    commands = first_command(links)
    forces = commands + thrusters
    for j in range(thrusters):
        force = load(block, forces + j, like)
        force += lag * (load(block, commands + j, like) - force)
        store(block, forces + j, force)
        target = plant.thruster_links[j] + (across if plant.thruster_is_normal[j] else along)
        store(block, target, load(block, target, like) + force)


@piece
def joint_torques(block, like, wide, stride, links, implicit):
    """Torque of every joint controller, less the part that is in the joint-space inertia.

    u = k_p (phi_ref - phi - h phi') + k_d (phi_ref' - phi') - (h k_d + h^2 k_p) phi''.
    """
    k_p, k_d = load(block, STIFFNESS, like), load(block, DAMPING, like)
    target = k_p * load(block, DEFLECTION, like) + k_d * load(block, DEFLECTION_RATE, like)
    damping = k_d + implicit * k_p
    theta, omega = row_of(THETA, links), row_of(OMEGA, links)
    for i in range(0, links - 1, stride):
        phi = load(block, theta + i, wide) - load(block, theta + i + 1, wide)
        phi_dot = load(block, omega + i, wide) - load(block, omega + i + 1, wide)
        wanted = target * load(block, row_of(SHARE, links) + i, wide)
        store(block, row_of(TORQUE, links) + i, wanted - k_p * phi - damping * phi_dot)


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


@piece
def run(fleet, plant, table, actions, like, lanes, stride, first, last):
    """One control period of blocks `first` to `last`: command, advance, measure."""
    size = actions.shape[0]
    for k in range(first, last):
        for robot in range(k * lanes, min((k + 1) * lanes, size)):
            fleet.effort[robot] = command(
                fleet.blocks[k], lanes, robot - k * lanes, plant.links, actions[robot]
            )
        advance(block_at(fleet.blocks, k, like), like, spread(0.0), stride, plant)
        for robot in range(k * lanes, min((k + 1) * lanes, size)):
            fleet.instant[robot] += 1
            observe(fleet, plant, table, robot, lanes)
            if fleet.instant[robot] >= fleet.settled[robot]:
                for axis in range(2):
                    size_now = abs(fleet.error[robot, axis])
                    if size_now > fleet.max_error[robot, axis]:
                        fleet.max_error[robot, axis] = size_now


@piece
def observe(fleet, plant, table, robot, lanes):
    """Measure one robot."""
    fleet.heading_error[robot] = measure(
        fleet.blocks[robot // lanes],
        lanes,
        robot % lanes,
        plant.links,
        plant.h,
        # A robot whose episode has ended may be stepped on until it is restarted.
        fleet.noise[robot, min(fleet.instant[robot], fleet.noise.shape[1] - 1)],
        table,
        fleet.error[robot],
        fleet.observation[robot],
    )


@compiled
def observe_one(fleet, plant, table, robot, lanes):
    """Measure one robot outside a control period: at the start of its episode."""
    observe(fleet, plant, table, robot, lanes)


@compiled
def run_singles(fleet, plant, table, actions, first, last):
    """`run` for blocks of one robot each."""
    run(fleet, plant, table, actions, 0.0, 1, WIDTH, first, last)


@compiled
def run_lanes(fleet, plant, table, actions, first, last):
    """`run` for blocks of `lanes.WIDTH` robots each."""
    run(fleet, plant, table, actions, spread(0.0), WIDTH, 1, first, last)


@parallel
def run_threads(fleet, plant, table, actions):
    """`run_lanes` for all blocks, shared out among threads."""
    for k in numba.prange(fleet.blocks.shape[0]):
        run_lanes(fleet, plant, table, actions, k, k + 1)
