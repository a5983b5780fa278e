"""The dense plant in plain NumPy, straight from docs/model.md: what the fast plant is held to."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym import Robot

Array = NDArray[np.float64]


class Links(NamedTuple):
    """Axes and Jacobians of all links, over q = (theta_1 .. theta_n, p_x, p_y)."""

    t: Array  # (n, 2) along the link, tail to head
    n: Array  # (n, 2) to the left of it
    jacobian: Array  # (n, 2, n + 2) of the link centres
    centripetal: Array  # (n, 2, n) what multiplies theta_dot**2 in their acceleration


def links(robot: Robot, theta: Array) -> Links:
    """Return the kinematics of X = e p - l K^T (cos theta, sin theta)."""
    count = robot.links
    D = np.eye(count - 1, count) - np.eye(count - 1, count, k=1)
    A = np.eye(count - 1, count) + np.eye(count - 1, count, k=1)
    K = A.T @ np.linalg.solve(D @ D.T, D)
    lever = -robot.half_length * K.T
    t = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    n = np.stack([-np.sin(theta), np.cos(theta)], axis=1)
    by_theta = np.einsum("ij,jc->icj", lever, n)
    by_p = np.broadcast_to(np.eye(2), (count, 2, 2))
    return Links(
        t=t,
        n=n,
        jacobian=np.concatenate([by_theta, by_p], axis=2),
        centripetal=-np.einsum("ij,jc->icj", lever, t),
    )


def translational_inertia(robot: Robot, n: Array) -> Array:
    """Return m I + mu_n n n^T of every link, (n, 2, 2): mass plus Kirchhoff added mass."""
    return robot.link_mass * np.eye(2) + robot.added_mass * np.einsum("ia,ib->iab", n, n)


def mass_matrix(robot: Robot, theta: Array) -> Array:
    """Return M(theta), (n + 2, n + 2), of robot and fluid together."""
    body = links(robot, theta)
    inertia = translational_inertia(robot, body.n)
    M = np.einsum("iap,iab,ibq->pq", body.jacobian, inertia, body.jacobian)
    angles = np.arange(robot.links)
    M[angles, angles] += robot.link_inertia + robot.added_inertia
    return M


def input_matrix(robot: Robot, theta: Array) -> Array:
    """Return G, (n + 2, n - 1 + thrusters): generalized force per joint torque and thrust."""
    body = links(robot, theta)
    count = robot.links
    D = np.eye(count - 1, count + 2) - np.eye(count - 1, count + 2, k=1)
    D[:, count:] = 0.0  # the superdiagonal ends in the last angle, never in p
    thrust = [
        body.jacobian[thruster.link - 1].T
        @ (body.t if thruster.direction == "axial" else body.n)[thruster.link - 1]
        for thruster in robot.thrusters
    ]
    return np.column_stack([*D, *thrust])


def accelerations(
    robot: Robot,
    theta: Array,
    theta_dot: Array,
    p_dot: ArrayLike,
    joint_torques: ArrayLike,
    thruster_forces: ArrayLike,
    current: ArrayLike = (0.0, 0.0),
    hydrodynamics: str = "consistent",
    drag: str = "linear and quadratic",
) -> tuple[Array, Array]:
    """Return (theta_ddot, p_ddot) by a dense solve of M q_ddot = projected forces."""
    body = links(robot, theta)
    mu = robot.added_mass
    V = body.jacobian @ np.concatenate([theta_dot, p_dot]) - np.asarray(current)
    v_t = np.einsum("ic,ic->i", body.t, V)
    v_n = np.einsum("ic,ic->i", body.n, V)

    F_t = -robot.tangential_drag * v_t * np.abs(v_t)
    F_n = -robot.normal_drag * v_n * np.abs(v_n)
    N = -robot.quadratic_yaw_drag * theta_dot * np.abs(theta_dot)
    if drag == "linear and quadratic":
        F_t -= robot.tangential_drag * v_t
        F_n -= robot.normal_drag * v_n
        N -= robot.linear_yaw_drag * theta_dot
    elif drag != "quadratic":
        raise ValueError(f"unknown drag {drag!r}")
    if hydrodynamics == "consistent":
        F_t += mu * v_n * theta_dot
        F_n += mu * v_t * theta_dot
        N -= mu * v_t * v_n
    elif hydrodynamics == "kelasidi2014":
        F_n -= mu * theta_dot * (body.t @ np.asarray(current))
    else:
        raise ValueError(f"unknown hydrodynamics {hydrodynamics!r}")

    # The part of mass times acceleration that is already known moves to the right.
    inertia = translational_inertia(robot, body.n)
    known = np.einsum("iab,ibj,j->ia", inertia, body.centripetal, theta_dot**2)
    F = F_t[:, None] * body.t + F_n[:, None] * body.n - known
    force = np.einsum("icq,ic->q", body.jacobian, F)
    force[: robot.links] += N
    force += input_matrix(robot, theta) @ np.concatenate([joint_torques, thruster_forces])
    q_ddot = np.linalg.solve(mass_matrix(robot, theta), force)
    return q_ddot[: robot.links], q_ddot[robot.links :]


def energy(robot: Robot, theta: Array, theta_dot: Array, velocity: Array) -> float:
    """Return the energy, J, of robot and fluid; velocity is the CM's relative to the water."""
    q_dot = np.concatenate([theta_dot, velocity])
    return float(0.5 * q_dot @ mass_matrix(robot, theta) @ q_dot)


def linear_momentum(robot: Robot, theta: Array, theta_dot: Array, velocity: Array) -> Array:
    """Return the linear momentum (Kirchhoff's impulse), (2,) N s, of robot and fluid."""
    momentum = mass_matrix(robot, theta) @ np.concatenate([theta_dot, velocity])
    return momentum[robot.links :]


def angular_momentum(
    robot: Robot, theta: Array, theta_dot: Array, p: Array, velocity: Array
) -> float:
    """Return the angular momentum, N m s, about the origin of p, which the water carries along."""
    momentum = mass_matrix(robot, theta) @ np.concatenate([theta_dot, velocity])
    P_x, P_y = momentum[robot.links :]
    # A turn of everything by d raises every angle by d and moves p by d (-p_y, p_x).
    return float(momentum[: robot.links].sum() + p[0] * P_y - p[1] * P_x)
