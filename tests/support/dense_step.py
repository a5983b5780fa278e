"""One physics step in plain NumPy and dense matrices: what the compiled step is held to."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from support import oracle

from usm_gym import Robot, Scenario
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
    )


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
    simulation.restore(snapshot)


def advance(robot: Robot, scenario: Scenario, moment: Moment, command: Array) -> Moment:
    """Return the moment one physics step later, under thruster commands in N."""
    conditions, water = scenario.conditions, scenario.water
    h = conditions.physics_step
    implicit = conditions.integrator == "midpoint"
    t = moment.steps * h

    reference = filtered(scenario, moment.reference, t, h)
    tau = conditions.thruster_time_constant
    kept = np.exp(-h / tau) if tau > 0.0 else 0.0
    thrust = kept * moment.thrust + (1.0 - kept) * command

    # Joint controllers: symplectic Euler takes them at the end of the step, as far as known there.
    k_p = scenario.joint_stiffness or robot.joint_stiffness
    k_d = scenario.joint_damping or robot.joint_damping
    joints = robot.links - 1
    bends = np.arange(joints) >= joints - scenario.inspection.bending_joints
    asked, asked_rate = reference if implicit else moment.reference
    share = bends / scenario.inspection.bending_joints
    phi, phi_dot = -np.diff(moment.theta), -np.diff(moment.theta_dot)
    ahead = h * phi_dot if implicit else 0.0
    torque = k_p * (share * asked - phi - ahead) + k_d * (share * asked_rate - phi_dot)

    angle = 2.0 * np.pi / water.period * t + np.array(water.phase)
    swing = np.array(water.amplitude)
    current = water.current + swing * np.sin(angle)
    current_rate = swing * 2.0 * np.pi / water.period * np.cos(angle)
    q_ddot = accelerations(
        robot,
        np.array(robot.hydrodynamic_coefficients) * water.coefficients,
        moment,
        np.concatenate([torque, thrust]),
        current,
        conditions.hydrodynamics,
        step=h if implicit else 0.0,
        joint_inertia=h * k_d + h**2 * k_p if implicit else 0.0,
    )
    theta_dot = moment.theta_dot + h * q_ddot[: robot.links]
    # All water accelerating alike carries a neutrally buoyant robot along.
    p_dot = moment.p_dot + h * (q_ddot[robot.links :] + current_rate)
    return Moment(
        steps=moment.steps + 1,
        theta=moment.theta + h * (theta_dot if implicit else moment.theta_dot),
        theta_dot=theta_dot,
        p=moment.p + h * (p_dot if implicit else moment.p_dot),
        p_dot=p_dot,
        reference=reference,
        thrust=thrust,
    )


def filtered(scenario: Scenario, reference: Array, t: float, h: float) -> Array:
    """Return the deflection and its rate h later, by the matrix exponential of the filter."""
    past = [
        size
        for time, size in zip(scenario.shifts, scenario.inspection.deflections, strict=False)
        if t >= time
    ]
    target = np.array([past[-1] if past else 0.0, 0.0])
    w = scenario.inspection.filter_frequency
    if w is None:
        return target
    return target + expm(h * np.array([[0.0, 1.0], [-w * w, -2.0 * w]])) @ (reference - target)


def accelerations(
    robot: Robot,
    coefficients: Array,
    moment: Moment,
    inputs: Array,
    current: Array,
    hydrodynamics: str,
    step: float,
    joint_inertia: float,
) -> Array:
    """Return q_ddot, (n + 2,), with step times the slope of the drag added to the inertia."""
    c_t, c_n, mu, lambda_1, lambda_2, lambda_3 = coefficients
    body = oracle.links(robot, moment.theta)
    omega = moment.theta_dot
    V = body.jacobian @ np.concatenate([omega, moment.p_dot]) - current
    v_t = np.einsum("ic,ic->i", body.t, V)
    v_n = np.einsum("ic,ic->i", body.n, V)

    F_t = -c_t * (v_t + v_t * np.abs(v_t))
    F_n = -c_n * (v_n + v_n * np.abs(v_n))
    N = -lambda_2 * omega - lambda_3 * omega * np.abs(omega)
    if hydrodynamics == "consistent":
        F_t += mu * v_n * omega
        F_n += mu * v_t * omega
        N -= mu * v_t * v_n
    else:
        F_n -= mu * omega * (body.t @ current)

    along = robot.link_mass + step * c_t * (1.0 + 2.0 * np.abs(v_t))
    across = robot.link_mass + mu + step * c_n * (1.0 + 2.0 * np.abs(v_n))
    yaw = robot.link_inertia + lambda_1 + step * (lambda_2 + 2.0 * lambda_3 * np.abs(omega))
    inertia = np.einsum("i,ia,ib->iab", along, body.t, body.t)
    inertia += np.einsum("i,ia,ib->iab", across, body.n, body.n)
    G = oracle.input_matrix(robot, moment.theta)
    D = G[:, : robot.links - 1]
    M = np.einsum("iap,iab,ibq->pq", body.jacobian, inertia, body.jacobian)
    M += np.diag(np.concatenate([yaw, np.zeros(2)])) + joint_inertia * D @ D.T

    known = np.einsum("iab,ibj,j->ia", inertia, body.centripetal, omega**2)
    F = F_t[:, None] * body.t + F_n[:, None] * body.n - known
    force = np.einsum("icq,ic->q", body.jacobian, F) + G @ inputs
    force[: robot.links] += N
    return np.linalg.solve(M, force)


class _Rows:
    """The numbers of one robot in the blocks of a simulation, as views."""

    def __init__(self, robot: Robot, blocks: Array, index: int) -> None:
        lanes = blocks.shape[2]
        self.robot = robot
        self.row = blocks[index // lanes, :, index % lanes]

    def links(self, quantity: int) -> Array:
        first = layout.HEADER + quantity * layout.padded(self.robot.links)
        return self.row[first : first + self.robot.links]

    def forces(self) -> Array:
        thrusters = len(self.robot.thrusters)
        first = layout.first_command(self.robot.links) + thrusters
        return self.row[first : first + thrusters]
