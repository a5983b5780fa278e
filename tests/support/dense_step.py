"""One physics step in plain NumPy and dense matrices: what the compiled step is held to."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from support import oracle

from usm_gym import Conditions, Robot, Scenario
from usm_gym.kernels.lanes import padded
from usm_gym.plant import layout
from usm_gym.simulation import Simulation

Array = NDArray[np.float64]


class Moment(NamedTuple):
    """All that changes from one physics step to the next."""

    steps: int  # physics steps since the start
    theta: Array  # (n,) rad
    theta_dot: Array  # (n,) rad/s
    p: Array  # (2,) m
    p_dot: Array  # (2,) m/s
    reference: Array  # (2,) head deflection, rad, and its rate, rad/s
    thrust: Array  # (thrusters,) N
    # Of the step before; zero at the start.
    theta_ddot: Array  # (n,) rad/s^2
    p_ddot: Array  # (2,) m/s^2
    link_ddot: Array  # (n, 2) m/s^2 of the link centres, less that of the water


def random_moment(robot: Robot, rng: np.random.Generator, steps: int) -> Moment:
    """Draw a moment of any shape, heading and motion."""
    return Moment(
        steps=int(rng.integers(steps)),
        theta=rng.uniform(-10.0, 10.0, robot.links),
        theta_dot=rng.normal(0.0, 2.0, robot.links),
        p=rng.normal(0.0, 1.0, 2),
        p_dot=rng.normal(0.0, 1.0, 2),
        reference=rng.normal(0.0, 1.0, 2),
        thrust=rng.normal(0.0, 10.0, len(robot.thrusters)),
        theta_ddot=rng.normal(0.0, 100.0, robot.links),
        p_ddot=rng.normal(0.0, 10.0, 2),
        link_ddot=rng.normal(0.0, 10.0, (robot.links, 2)),
    )


def read(simulation: Simulation, index: int = 0) -> Moment:
    """Return the moment that a robot of a simulation is in."""
    rows = _Rows(simulation.world.robot, simulation.snapshot().arrays["_rows"], index)
    return Moment(
        steps=int(rows.row[layout.CLOCK]),
        theta=rows.links(layout.THETA).copy(),
        theta_dot=rows.links(layout.OMEGA).copy(),
        p=rows.row[[layout.P_X, layout.P_Y]],
        p_dot=rows.row[[layout.V_X, layout.V_Y]],
        reference=rows.row[[layout.DEFLECTION, layout.DEFLECTION_RATE]],
        thrust=rows.forces().copy(),
        theta_ddot=rows.links(layout.ALPHA).copy(),
        p_ddot=rows.row[[layout.A_X, layout.A_Y]],
        link_ddot=np.stack([rows.links(layout.LINK_AX), rows.links(layout.LINK_AY)], axis=1),
    )


def flat(moment: Moment) -> Array:
    """Return all numbers of a moment in one row."""
    return np.concatenate([np.ravel(part) for part in moment])


def place(simulation: Simulation, moment: Moment, index: int = 0) -> None:
    """Put a robot of a simulation into a moment."""
    snapshot = simulation.snapshot()
    rows = _Rows(simulation.world.robot, snapshot.arrays["_rows"], index)
    rows.row[layout.CLOCK] = moment.steps
    rows.links(layout.THETA)[:] = moment.theta
    rows.links(layout.OMEGA)[:] = moment.theta_dot
    rows.row[[layout.P_X, layout.P_Y]] = moment.p
    rows.row[[layout.V_X, layout.V_Y]] = moment.p_dot
    rows.row[[layout.DEFLECTION, layout.DEFLECTION_RATE]] = moment.reference
    rows.forces()[:] = moment.thrust
    rows.links(layout.ALPHA)[:] = moment.theta_ddot
    rows.row[[layout.A_X, layout.A_Y]] = moment.p_ddot
    rows.links(layout.LINK_AX)[:], rows.links(layout.LINK_AY)[:] = moment.link_ddot.T
    simulation.restore(snapshot)


def advance(robot: Robot, scenario: Scenario, moment: Moment, command: Array) -> Moment:
    """Return the moment one physics step later, under thruster commands in N."""
    conditions, water = scenario.conditions, scenario.water
    h = conditions.physics_step
    lead = h / 2 if conditions.integrator == "midpoint" else 0.0
    t = moment.steps * h

    bend, bend_at_end = deflections(scenario, t, h)
    reference = filtered(scenario, moment.reference, bend, bend_at_end)
    if scenario.inspection.filter_frequency is None:
        asked = np.array([bend, 0.0])
    else:
        asked = moment.reference + lead / h * (reference - moment.reference)
    torque, joint_inertia = joint_torques(robot, scenario, moment, asked, lead)

    tau = conditions.thruster_time_constant
    kept = np.exp(-h / tau) if tau > 0.0 else 0.0
    mean_kept = tau / h * (1.0 - kept)  # the integral of exp(-s / tau) over the step, over h
    target = delivered(scenario, command)
    thrust = target + kept * (moment.thrust - target)
    mean_thrust = target + mean_kept * (moment.thrust - target)
    current, current_rate = water_at(scenario, t + lead)

    ahead = moment._replace(
        theta=moment.theta + lead * moment.theta_dot,
        theta_dot=moment.theta_dot + lead * moment.theta_ddot,
        p_dot=moment.p_dot + lead * moment.p_ddot,
    )
    q_ddot, link_ddot = accelerations(
        robot,
        np.outer(
            np.multiply(robot.hydrodynamic_coefficients, water.coefficients),
            water.link_factors or np.ones(robot.links),
        ),
        ahead,
        np.concatenate([torque, mean_thrust]),
        current,
        conditions,
        lead,
        joint_inertia,
    )
    theta_ddot = q_ddot[: robot.links]
    # All water accelerating alike carries a neutrally buoyant robot along.
    p_ddot = q_ddot[robot.links :] + current_rate
    return Moment(
        steps=moment.steps + 1,
        theta=moment.theta + h * (moment.theta_dot + lead * theta_ddot),
        theta_dot=moment.theta_dot + h * theta_ddot,
        p=moment.p + h * (moment.p_dot + lead * p_ddot),
        p_dot=moment.p_dot + h * p_ddot,
        reference=reference,
        thrust=thrust,
        theta_ddot=theta_ddot,
        p_ddot=p_ddot,
        link_ddot=link_ddot,
    )


def delivered(scenario: Scenario, command: Array) -> Array:
    """Return the forces that thrusters come to under commands, N."""
    gains = scenario.thruster_gains or np.ones(command.size)
    working = np.abs(command) >= scenario.conditions.thruster_dead_band
    return np.array(gains) * command * working


def water_at(scenario: Scenario, t: float) -> tuple[Array, Array]:
    """Return velocity and acceleration of the water, (2,) each."""
    water = scenario.water
    velocity, acceleration = np.array(water.current), np.zeros(2)
    waves = [(wave.amplitude, wave.phase, wave.period) for wave in water.waves]
    for amplitude, phase, period in [(water.amplitude, water.phase, water.period), *waves]:
        swing, angle = np.array(amplitude), 2.0 * np.pi / period * t + np.array(phase)
        velocity += swing * np.sin(angle)
        acceleration += swing * 2.0 * np.pi / period * np.cos(angle)
    return velocity, acceleration


def joint_torques(
    robot: Robot, scenario: Scenario, moment: Moment, asked: Array, lead: float
) -> tuple[Array, float]:
    """Return the joint torques of a step, and what they lose per relative acceleration in it.

    The controllers are asked for a deflection and a rate; their answer to the state is
    u_1 - (u_0 - u_-1) / 2 from its values at the ends of this step and of the one before.
    """
    k_p = scenario.joint_stiffness or robot.joint_stiffness
    k_d = scenario.joint_damping or robot.joint_damping
    joints, bending = robot.links - 1, scenario.inspection.bending_joints
    share = (np.arange(joints) >= joints - bending) / bending
    h = 2.0 * lead

    def held(phi: Array, rate: Array) -> Array:
        return -k_p * phi - k_d * rate

    phi, rate = -np.diff(moment.theta), -np.diff(moment.theta_dot)
    before = -np.diff(moment.theta_ddot)
    rate_before = rate - h * before
    last = held(phi - h * (rate_before + rate) / 2, rate_before)
    now, coming = held(phi, rate), held(phi + h * rate, rate)  # but for the new acceleration
    of_state = coming - (now - last) / 2
    return share * (k_p * asked[0] + k_d * asked[1]) + of_state, h * k_d + h**2 / 2 * k_p


def deflections(scenario: Scenario, t: float, h: float) -> tuple[float, float]:
    """Return the deflection that is asked for, as its mean from t to t + h, and at t + h."""
    sizes = np.diff(scenario.inspection.deflections, prepend=0.0)[: len(scenario.shifts)]
    passed = np.clip((t + h - np.array(scenario.shifts)) / h, 0.0, 1.0)
    return float(sizes @ passed), float(sizes @ (passed > 1e-6))


def filtered(scenario: Scenario, reference: Array, target: float, target_at_end: float) -> Array:
    """Return the deflection and its rate a step later, by the matrix exponential of the filter."""
    w, h = scenario.inspection.filter_frequency, scenario.conditions.physics_step
    if w is None:
        return np.array([target_at_end, 0.0])
    rest = np.array([target, 0.0])
    return rest + expm(h * np.array([[0.0, 1.0], [-w * w, -2.0 * w]])) @ (reference - rest)


def accelerations(
    robot: Robot,
    coefficients: Array,
    moment: Moment,
    inputs: Array,
    current: Array,
    conditions: Conditions,
    lead: float,
    joint_inertia: float,
) -> tuple[Array, Array]:
    """Return q_ddot, (n + 2,), and the accelerations of the link centres, (n, 2).

    Every link has coefficients of its own, (6, n). The drag is that of the moment plus its slope
    times lead times what the accelerations have changed by since the step before.
    """
    c_t, c_n, mu, lambda_1, lambda_2, lambda_3 = coefficients
    body = oracle.links(robot, moment.theta)
    omega = moment.theta_dot
    V = body.jacobian @ np.concatenate([omega, moment.p_dot]) - current
    v_t = np.einsum("ic,ic->i", body.t, V)
    v_n = np.einsum("ic,ic->i", body.n, V)

    linear = 0.0 if conditions.drag == "quadratic" else 1.0
    slope_t = lead * c_t * (linear + 2.0 * np.abs(v_t))
    slope_n = lead * c_n * (linear + 2.0 * np.abs(v_n))
    slope_yaw = lead * (linear * lambda_2 + 2.0 * lambda_3 * np.abs(omega))
    F_t = -c_t * (linear * v_t + v_t * np.abs(v_t))
    F_n = -c_n * (linear * v_n + v_n * np.abs(v_n))
    N = -linear * lambda_2 * omega - lambda_3 * omega * np.abs(omega)
    F_t += slope_t * np.einsum("ic,ic->i", body.t, moment.link_ddot)
    F_n += slope_n * np.einsum("ic,ic->i", body.n, moment.link_ddot)
    N += slope_yaw * moment.theta_ddot
    if conditions.hydrodynamics == "consistent":
        F_t += mu * v_n * omega
        F_n += mu * v_t * omega
        N -= mu * v_t * v_n
    else:
        F_n -= mu * omega * (body.t @ current)

    inertia = np.einsum("i,ia,ib->iab", robot.link_mass + slope_t, body.t, body.t)
    inertia += np.einsum("i,ia,ib->iab", robot.link_mass + mu + slope_n, body.n, body.n)
    yaw = robot.link_inertia + lambda_1 + slope_yaw
    G = oracle.input_matrix(robot, moment.theta)
    D = G[:, : robot.links - 1]
    M = np.einsum("iap,iab,ibq->pq", body.jacobian, inertia, body.jacobian)
    M += np.diag(np.concatenate([yaw, np.zeros(2)])) + joint_inertia * D @ D.T

    centripetal = body.centripetal @ omega**2
    F = F_t[:, None] * body.t + F_n[:, None] * body.n
    F -= np.einsum("iab,ib->ia", inertia, centripetal)
    force = np.einsum("icq,ic->q", body.jacobian, F) + G @ inputs
    force[: robot.links] += N
    q_ddot = np.linalg.solve(M, force)
    return q_ddot, body.jacobian @ q_ddot + centripetal


class _Rows:
    """The numbers of one robot in the blocks of a simulation, as views."""

    def __init__(self, robot: Robot, blocks: Array, index: int) -> None:
        lanes = blocks.shape[2]
        self.robot = robot
        self.row = blocks[index // lanes, :, index % lanes]

    def links(self, quantity: int) -> Array:
        first = layout.HEADER + quantity * padded(self.robot.links)
        return self.row[first : first + self.robot.links]

    def forces(self) -> Array:
        thrusters = len(self.robot.thrusters)
        first = layout.thruster_row(layout.FORCE, self.robot.links, thrusters)
        return self.row[first : first + thrusters]
