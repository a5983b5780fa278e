"""Plant and laws in one compiled loop, an action in every physics step, no thruster limit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baselines.observer import observe, observer_gains
from baselines.pd import PDGains, pd_force
from baselines.super_twisting import SuperTwistingGains, super_twisting_force
from usm_gym.plant.chain import kinematics
from usm_gym.plant.compile import compiled
from usm_gym.plant.lanes import WIDTH, block_at, spread
from usm_gym.plant.layout import *
from usm_gym.plant.motion import line_of_sight, path
from usm_gym.plant.step import move_water, physics_step
from usm_gym.plant.thrusters import allocate, allocation_matrix
from usm_gym.robot import Robot
from usm_gym.scenario import Scenario
from usm_gym.simulation import Simulation
from usm_gym.validation import require

Array = NDArray[np.float64]
SUPER_TWISTING = -1


class Law(NamedTuple):
    """A control law at the paper's step.

    Attributes:
        reading: `SUPER_TWISTING`, or a reading of the PD controller as an index of `pd.READINGS`.
        implicit: Whether observer and super-twisting law are discretised implicitly.
        super_twisting: Gains of the super-twisting controller.
        pd: Gains of the PD controller.
        start: Estimate of the velocity at the start, p2(0), m/s, (2,).
    """

    reading: int = SUPER_TWISTING
    implicit: bool = False
    super_twisting: SuperTwistingGains = SuperTwistingGains(heading_gain=125.0)
    pd: PDGains = PDGains(heading_gain=125.0)
    start: tuple[float, float] = (0.0, 0.0)


class Record(NamedTuple):
    """What a run leaves, at every `every`-th step after the first, (samples, ...).

    Attributes:
        time: Times, s, (samples,).
        reference: Reference of the centre of mass, m, (samples, 2).
        error: Position errors, m, (samples, 2).
        force: Force on the centre of mass, N, (samples, 2).
        sigma: Sliding variable, m/s, (samples, 2).
        observer_error: e1 = p - p1, m, (samples, 2).
        effort: Mean absolute force of the thrusters, N, (samples,).
        theta: Link angles, rad, (samples, links).
    """

    time: Array
    reference: Array
    error: Array
    force: Array
    sigma: Array
    observer_error: Array
    effort: Array
    theta: Array


def record_for(samples: int, links: int) -> Record:
    """An empty record."""
    pairs = np.empty((5, samples, 2))
    return Record(
        time=np.empty(samples),
        reference=pairs[0],
        error=pairs[1],
        force=pairs[2],
        sigma=pairs[3],
        observer_error=pairs[4],
        effort=np.empty(samples),
        theta=np.empty((samples, links)),
    )


def simulate(scenario: Scenario, law: Law, every: int = 100, robot: Robot | None = None) -> Record:
    """Run a law on a scenario, both at its physics step.

    Args:
        scenario: The scenario; its control period has to be its physics step.
        law: The control law.
        every: Record every so many steps.
        robot: The robot; without one, the paper's.

    Raises:
        ValueError: If control period and physics step differ, or the closed loop diverges.
    """
    conditions = scenario.conditions
    require(
        conditions.substeps == 1,
        "control_period",
        conditions.control_period,
        f"the physics step, {conditions.physics_step}",
    )
    body = robot or Robot()
    simulation = Simulation(body, [scenario])
    record = record_for(scenario.steps // every, body.links)
    closed_loop(simulation.fleet.blocks, simulation.plant, body.total_mass, law, every, record)
    require(
        np.isfinite(record.error).all(),
        "physics_step",
        conditions.physics_step,
        "a step at which the closed loop stays finite",
    )
    return record


@compiled
def closed_loop(blocks, plant, mass, law, every, record):
    """Plant, observer, control law and allocation, step by step; fills in the record."""
    links, h = plant.links, plant.h
    block, wide = block_at(blocks, 0, 0.0), spread(0.0)
    row = blocks[0]
    sine = row[row_of(SIN, links) : row_of(SIN, links) + links]
    cosine = row[row_of(COS, links) : row_of(COS, links) + links]
    theta = row[row_of(THETA, links) : row_of(THETA, links) + links]
    thrusters = plant.thruster_links.size
    commands = row[first_command(links) : first_command(links) + thrusters]
    T = np.empty((3, thrusters))
    sta = law.reading == SUPER_TWISTING
    gains = law.super_twisting
    k_sta = observer_gains(gains.observer_gain, gains.k2_exponent)
    k_pd = observer_gains(law.pd.observer_gain, law.pd.k2_exponent)
    k = k_sta if sta else k_pd
    heading_gain = gains.heading_gain if sta else law.pd.heading_gain
    state = np.zeros((2, 6))
    state[:, 5] = gains.alpha_start
    force = np.zeros(2)
    error = np.zeros(2)
    for step in range(record.time.size * every):
        t = step * h
        p_x, p_y, v_x, v_y, a_x, a_y = path(t, row[SPEED], row[SWAY], row[FREQUENCY], row[RAMP])
        error[0], error[1] = row[P_X] - p_x, row[P_Y] - p_y
        for axis in range(2):
            velocity, acceleration = (v_x, a_x) if axis == 0 else (v_y, a_y)
            z1, z2 = observe(
                law.implicit,
                float(step),
                error[axis],
                force[axis] / mass - acceleration,
                velocity - law.start[axis],
                h,
                k,
                state[axis],
            )
            if sta:
                force[axis] = super_twisting_force(
                    z1, z2, acceleration, h, mass, gains, law.implicit, state[axis]
                )
            else:
                force[axis] = pd_force(z1, z2, acceleration, mass, law.pd, law.reading, state[axis])
        if plant.moving_water:
            move_water(block, 0.0, h)
        base = kinematics(block, 0.0, wide, WIDTH, links, plant.body.l)
        heading = theta.mean() if row[HEAD_HEADING] == 0.0 else theta[links - 1]
        distance = row[P_Y] - (p_y if row[CROSS_TRACK] > 0.0 else 0.0)
        moment = -heading_gain * (heading - line_of_sight(distance, row[LOOK_AHEAD]))
        allocation_matrix(
            sine, cosine, plant.body.l, plant.thruster_links, plant.thruster_is_normal, T
        )
        allocate(T, force[0], force[1], moment, commands)
        if step % every == 0:
            n = step // every
            record.time[n] = t
            record.reference[n, 0], record.reference[n, 1] = p_x, p_y
            record.error[n] = error
            record.force[n] = force
            record.effort[n] = np.abs(commands).mean()
            record.theta[n] = theta
            for axis in range(2):
                surface = gains.surface if sta else law.pd.surface
                record.sigma[n, axis] = surface * state[axis, 0] + state[axis, 1]
                record.observer_error[n, axis] = state[axis, 3]
        physics_step(block, 0.0, wide, WIDTH, plant, base)
