"""Plant and laws in one compiled loop, for control periods down to the paper's step."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.estimation.observer import observe, observer_gains
from usm_baselines.laws.pd import PDGains, pd_force
from usm_baselines.laws.super_twisting import SuperTwistingGains, super_twisting_force
from usm_gym.kernels.compile import compiled, piece
from usm_gym.kernels.lanes import WIDTH, block_at, spread
from usm_gym.plant.chain import directions, kinematics
from usm_gym.plant.layout import *
from usm_gym.plant.push import allocation_matrix
from usm_gym.plant.step import physics_step
from usm_gym.plant.thrusters import allocate, delivered, saturated
from usm_gym.plant.water import move_water
from usm_gym.robot import Robot
from usm_gym.simulation import Simulation
from usm_gym.support.validation import UsageError
from usm_gym.task.guidance import *
from usm_gym.task.loss import LOST_ERROR
from usm_gym.task.scenario import Scenario

Array = NDArray[np.float64]
SUPER_TWISTING = -1


class LostRobotError(UsageError):
    """A run in which the robot was lost."""


class Law(NamedTuple):
    """A control law at the paper's step.

    Attributes:
        reading: `SUPER_TWISTING`, or a reading of the PD controller as an index of `pd.READINGS`.
        measured: Whether the velocity is measured and no observer needed, the paper's first case:
            the sliding variable is then (9).
        implicit: Whether observer and super-twisting law are discretised implicitly.
        super_twisting: Gains of the super-twisting controller.
        pd: Gains of the PD controller.
        start: Estimate of the velocity at the start, p2(0), m/s, (2,).
    """

    reading: int = SUPER_TWISTING
    measured: bool = False
    implicit: bool = False
    super_twisting: SuperTwistingGains = SuperTwistingGains(heading_gain=125.0)
    pd: PDGains = PDGains(heading_gain=125.0)
    start: tuple[float, float] = (0.0, 0.0)


class Record(NamedTuple):
    """What a run leaves, at every `every`-th physics step from the first on, (samples, ...).

    Attributes:
        time: Times, s, (samples,).
        reference: Reference of the centre of mass, m, (samples, 2).
        error: Position errors, m, (samples, 2).
        force: Force on the centre of mass, N, (samples, 2).
        sigma: Sliding variable, m/s, (samples, 2).
        observer_error: e1 = p - p1, m, (samples, 2).
        disturbance: Acceleration less that by the force, f(t) / m_t of (23), m/s^2, (samples, 2).
        effort: Mean absolute command of the thrusters, N, (samples,).
        theta: Link angles, rad, (samples, links).
        joint_torque: Largest torque of a joint from a sample to the next, N m, (samples,).
    """

    time: Array
    reference: Array
    error: Array
    force: Array
    sigma: Array
    observer_error: Array
    disturbance: Array
    effort: Array
    theta: Array
    joint_torque: Array


def record_for(samples: int, links: int) -> Record:
    """An empty record."""
    pairs = np.empty((6, samples, 2))
    return Record(
        time=np.empty(samples),
        reference=pairs[0],
        error=pairs[1],
        force=pairs[2],
        sigma=pairs[3],
        observer_error=pairs[4],
        disturbance=pairs[5],
        effort=np.empty(samples),
        theta=np.empty((samples, links)),
        joint_torque=np.zeros(samples),
    )


def simulate(scenario: Scenario, law: Law, every: int = 100, robot: Robot | None = None) -> Record:
    """Run a law on a scenario.

    Args:
        scenario: The scenario.
        law: The control law.
        every: Record every so many physics steps.
        robot: The robot; without one, the scenario's.

    Raises:
        LostRobotError: If the robot is lost.
    """
    conditions = scenario.conditions
    body = robot or scenario.body
    # Of this simulation only the start is used: it need not hold the noise of a whole episode.
    start = replace(scenario, duration=conditions.control_period, robot=body)
    simulation = Simulation([start])
    noise = scenario.sensing().position if conditions.position_noise else np.zeros((1, 2))
    record = record_for(scenario.steps * conditions.substeps // every, body.links)
    blocks, plant = simulation.fleet.blocks, simulation.shared
    closed_loop(blocks, plant, body.total_mass, law, noise, every, record)
    if not np.abs(record.error).max() <= LOST_ERROR:
        period = conditions.control_period
        allowed = "a period at which the robot is not lost"
        raise LostRobotError(f"control_period is {period}; allowed: {allowed}")
    return record


@piece
def law_force(law, k, started, error, speed, asked_for, force, h, mass, state):
    """One step of observer and law in one axis: the force on the centre of mass, N.

    Arguments in the axis: measured position error (m) and speed (m/s), the reference's rate (m/s)
    and acceleration (m/s^2) with p2(0) (m/s), the force of the last step (N).
    """
    rate, acceleration, start = asked_for
    if law.measured:
        z1, z2 = 0.0, 0.0
        state[0], state[1] = error, speed - rate
    else:
        u = force / mass - acceleration
        z1, z2 = observe(law.implicit, started, error, u, rate - start, h, k, state)
    if law.reading == SUPER_TWISTING:
        gains = law.super_twisting
        return super_twisting_force(z1, z2, acceleration, h, mass, gains, law.implicit, state)
    return pd_force(z1, z2, acceleration, mass, law.pd, law.reading, state)


@piece
def saturate(T, limit, commands, force):
    """Cut thruster commands (N) at the limit; `force` (N) becomes what they then make."""
    beyond = False
    for j in range(commands.size):
        beyond |= abs(commands[j]) > limit
    if beyond:
        force[:] = 0.0
        for j in range(commands.size):
            commands[j] = saturated(commands[j], limit)
            for axis in range(force.size):
                force[axis] += T[axis, j] * commands[j]


@piece
def heading_error(theta, distance, asked):
    """Heading less that of the guidance, rad, at a distance from the line that it aims at, m."""
    heading = 0.0
    for i in range(theta.size):
        heading += theta[i]
    heading = heading / theta.size if asked[HEAD_HEADING] == 0.0 else theta[-1]
    return heading - line_of_sight(distance, asked[LOOK_AHEAD])


@piece
def write_down(record, n, t, reference, error, force, commands, theta, surface, state):
    """Fill in sample `n` of a record, but for the disturbance, which follows the physics step."""
    record.time[n], record.theta[n] = t, theta
    record.effort[n] = np.abs(commands).mean()
    for axis in range(error.size):
        record.reference[n, axis], record.error[n, axis] = reference[axis], error[axis]
        record.force[n, axis] = force[axis]
        record.sigma[n, axis] = surface * state[axis, 0] + state[axis, 1]
        record.observer_error[n, axis] = error[axis] - state[axis, 0]


@piece
def largest_torque(row, links):
    """Largest torque of a joint in the physics step just made, N m, taken where forces are."""
    torque, alpha = row_of(TORQUE, links), row_of(ALPHA, links)
    largest = 0.0
    for i in range(links - 1):
        implicit = row[JOINT_INERTIA] * (row[alpha + i] - row[alpha + i + 1])
        largest = max(largest, abs(row[torque + i] - implicit))
    return largest


@compiled
def closed_loop(blocks, plant, mass, law, noise, every, record):
    """Plant, observer, control law and allocation, step by step; fills in the record.

    `noise` (m) has a row for each control instant; when it ends, its last row stays.
    """
    links, h, thrusters = plant.links, plant.h, plant.thruster_links.size
    period = plant.substeps * h
    block, wide, row = block_at(blocks, 0, 0.0), spread(0.0), blocks[0]
    sine = row[row_of(SIN, links) :][:links]
    cosine = row[row_of(COS, links) :][:links]
    theta = row[row_of(THETA, links) :][:links]
    commands = row[thruster_row(COMMAND, links, thrusters) :][:thrusters]
    delivery = thruster_row(GAIN, links, thrusters)
    targets = thruster_row(TARGET, links, thrusters)
    asked = row[body_rows(links, thrusters) :]
    T, wrench, work = np.empty((3, thrusters)), np.empty(3), np.empty((7, 3))
    sta, gains = law.reading == SUPER_TWISTING, law.super_twisting
    k_sta = observer_gains(gains.observer_gain, gains.k2_exponent)
    k_pd = observer_gains(law.pd.observer_gain, law.pd.k2_exponent)
    k = k_sta if sta else k_pd
    heading_gain = gains.heading_gain if sta else law.pd.heading_gain
    surface = gains.surface if sta else law.pd.surface
    state, force, error = np.zeros((2, 6)), np.zeros(2), np.zeros(2)
    state[:, 5] = gains.alpha_start
    for step in range(record.time.size * every):
        t = step * h
        p_x, p_y, v_x, v_y, a_x, a_y = path(
            t, asked[SPEED], asked[SWAY], asked[FREQUENCY], asked[RAMP]
        )
        position, rate, acceleration = (p_x, p_y), (v_x, v_y), (a_x, a_y)
        error[0], error[1] = row[P_X] - p_x, row[P_Y] - p_y
        if step % plant.substeps == 0:
            directions(block, wide, WIDTH, links)
            instant = step // plant.substeps
            measured = noise[min(instant, noise.shape[0] - 1)]
            for axis in range(error.size):
                y, v = error[axis] + measured[axis], row[V_X + axis]
                asked_for = rate[axis], acceleration[axis], law.start[axis]
                force[axis] = law_force(
                    law, k, float(instant), y, v, asked_for, force[axis], period, mass, state[axis]
                )
            distance = row[P_Y] + measured[1] - (p_y if asked[CROSS_TRACK] > 0.0 else 0.0)
            wrench[:2] = force
            wrench[2] = -heading_gain * heading_error(theta, distance, asked)
            allocation_matrix(
                sine, cosine, plant.l, plant.thruster_links, plant.thruster_is_normal, T
            )
            allocate(T, wrench, 3, 0.0, work, commands)
            saturate(T, row[LIMIT], commands, force)
            for j in range(thrusters):
                row[targets + j] = delivered(commands[j], row[delivery + j], row[DEAD_BAND])
        if step % every == 0:
            write_down(
                record, step // every, t, position, error, force, commands, theta, surface, state
            )
        if plant.sinusoids > 0:
            move_water(block, 0.0, WATER_ROWS, plant.sinusoids, plant.h, plant.lead)
        base = kinematics(block, 0.0, wide, WIDTH, plant)
        physics_step(block, 0.0, wide, WIDTH, plant, base)
        n = step // every
        record.joint_torque[n] = max(record.joint_torque[n], largest_torque(row, links))
        if step % every == 0:
            for axis in range(error.size):
                record.disturbance[n, axis] = row[A_X + axis] - force[axis] / mass
