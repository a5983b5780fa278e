"""The dense spatial plant in plain NumPy: what the fast one is held to.

Every link is a body of its own, with six accelerations that its own Kirchhoff's equations give. A
joint is five constraints; the forces that keep them are unknowns too (maximal coordinates). Axes
and signs are those of `usm_gym.spatial_robot`. A wrench, like a velocity or a momentum of a link,
is a row of six in the axes of the link: three linear at its geometric centre, three angular.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]

# Along a link and in roll the linear drag is this share of that across it.
LINEAR_SHARE = 0.1


class Links(NamedTuple):
    """Where all links are and how they move, in the global frame."""

    rotation: Array  # (n, 3, 3) from link axes
    centre: Array  # (n, 3) m
    omega: Array  # (n, 3) rad/s
    velocity: Array  # (n, 3) of the centres, m/s


def links(
    robot: SpatialRobot,
    quaternion: Array,
    angular_velocity: Array,
    velocity: Array,
    joint_angles: Array,
    joint_rates: Array,
    position: ArrayLike = (0.0, 0.0, 0.0),
) -> Links:
    """Return the motion of all links, given that of the middle one, joint by joint."""
    count = len(robot.links)
    middle = count // 2
    halves = np.outer(robot.lengths / 2, [1.0, 0.0, 0.0])
    rotation, centre, omega, speed = ([np.zeros(3)] * count for _ in range(4))
    rotation[middle] = rotation_of(quaternion)
    centre[middle] = np.asarray(position)
    omega[middle] = rotation[middle] @ angular_velocity
    speed[middle] = velocity
    to_head = [(link, link + 1, 1.0) for link in range(middle, count - 1)]
    to_tail = [(link, link - 1, -1.0) for link in range(middle, 0, -1)]
    for near, far, side in to_head + to_tail:
        joint = min(near, far)
        axis = np.array(robot.joint_axes[joint])
        turn = turned(axis, side * joint_angles[joint])
        rotation[far] = rotation[near] @ turn
        omega[far] = omega[near] + side * joint_rates[joint] * (rotation[near] @ axis)
        to_joint = side * rotation[near] @ halves[near]
        from_joint = side * rotation[far] @ halves[far]
        centre[far] = centre[near] + to_joint + from_joint
        speed[far] = (
            speed[near] + np.cross(omega[near], to_joint) + np.cross(omega[far], from_joint)
        )
    return Links(np.stack(rotation), np.stack(centre), np.stack(omega), np.stack(speed))


def inertia(robot: SpatialRobot) -> Array:
    """Return what makes momenta of velocities, solid and water together, (n, 6, 6)."""
    matrices = np.zeros((len(robot.links), 6, 6))
    along, across = robot.added_mass_along, robot.added_mass_across
    solid = zip(robot.masses, robot.lengths, robot.radii, robot.keels, strict=True)
    for M, (m, L, r, keel), water in zip(matrices, solid, robot.displaced_masses, strict=True):
        c = np.array([0.0, 0.0, -keel])
        lean = m * (L**2 / 12 + r**2 / 4)
        about_mass_centre = np.diag([m * r**2 / 2, lean, lean])
        M[:3, :3] = m * np.eye(3) + water * np.diag([along, across, across])
        M[:3, 3:] = -m * skew(c)  # p = m (v + omega x c)
        M[3:, :3] = m * skew(c)
        M[3:, 3:] = about_mass_centre + m * (c @ c * np.eye(3) - np.outer(c, c))
        M[3:, 3:] += water * L**2 / 12 * np.diag([0.0, across, across])
    return matrices


def accelerations(
    robot: SpatialRobot,
    quaternion: Array,
    angular_velocity: Array,
    linear_velocity: Array,
    joint_angles: Array,
    joint_rates: Array,
    joint_torques: Array,
    thruster_forces: Array,
    current: ArrayLike = (0.0, 0.0, 0.0),
    current_rate: ArrayLike = (0.0, 0.0, 0.0),
    gauss_points: int = 5,
) -> tuple[Array, Array, Array]:
    """Return the accelerations of the middle link and of the joints.

    They are that of its centre, global, m/s^2, (3,); its angular one in its own axes, rad/s^2,
    (3,); those of the joints, rad/s^2, (n - 1,). All water has the velocity `current` and the
    acceleration `current_rate`; drag across a link is summed over `gauss_points` of it.
    """
    relative = linear_velocity - np.asarray(current)
    body = links(robot, quaternion, angular_velocity, relative, joint_angles, joint_rates)
    M = inertia(robot)
    V = in_link_axes(body)
    v, omega = V[:, :3], V[:, 3:]
    momentum = np.einsum("kij,kj->ki", M, V)
    p, h = momentum[:, :3], momentum[:, 3:]
    wrenches = weight(robot, body, np.asarray(current_rate)) + drag(robot, V, gauss_points)
    wrenches += thrust(robot, thruster_forces) + torques(robot, body, joint_torques)
    # Kirchhoff: p' + omega x p and h' + omega x h + v x p are force and moment.
    wrenches -= np.hstack([np.cross(omega, p), np.cross(omega, h) + np.cross(v, p)])

    C, known = constraints(robot, body, joint_rates)
    size, held = wrenches.size, len(C)
    KKT = np.zeros((size + held, size + held))
    for link, matrix in enumerate(M):
        KKT[6 * link : 6 * link + 6, 6 * link : 6 * link + 6] = matrix
    KKT[size:, :size], KKT[:size, size:] = C, C.T
    solution = np.linalg.solve(KKT, np.concatenate([wrenches.ravel(), known]))
    V_dot = solution[:size].reshape(-1, 6)

    middle = len(robot.links) // 2
    R = body.rotation
    centre = R[middle] @ (V_dot[middle, :3] + np.cross(omega[middle], v[middle]))
    alpha = np.einsum("kij,kj->ki", R, V_dot[:, 3:])
    joints = np.einsum("kj,kj->k", global_axes(robot, body), np.diff(alpha, axis=0))
    return centre + np.asarray(current_rate), V_dot[middle, 3:], joints


def constraints(robot: SpatialRobot, body: Links, joint_rates: Array) -> tuple[Array, Array]:
    """Return C and b of C V' = b: ends of links stay together and turn about the axis alone.

    V' is that of the components in link axes, all links in one row.
    """
    count, R = len(robot.links), body.rotation
    V = in_link_axes(body)
    axes = global_axes(robot, body)
    C, b = np.zeros((5 * (count - 1), 6 * count)), np.zeros(5 * (count - 1))
    for joint in range(count - 1):
        point, turn = slice(5 * joint, 5 * joint + 3), slice(5 * joint + 3, 5 * joint + 5)
        across = np.linalg.svd(axes[joint][None])[2][1:]  # two directions that joints do not turn
        for link, side in ((joint, 1.0), (joint + 1, -1.0)):
            v, omega = V[link, :3], V[link, 3:]
            end = side * np.array([robot.lengths[link] / 2, 0.0, 0.0])
            linear = slice(6 * link, 6 * link + 3)
            angular = slice(6 * link + 3, 6 * link + 6)
            C[point, linear] = side * R[link]
            C[point, angular] = -side * R[link] @ skew(end)
            centripetal = np.cross(omega, v) + np.cross(omega, np.cross(omega, end))
            b[point] -= side * R[link] @ centripetal
            C[turn, angular] = -side * across @ R[link]
        b[turn] = across @ np.cross(body.omega[joint], axes[joint]) * joint_rates[joint]
    return C, b


def weight(robot: SpatialRobot, body: Links, current_rate: Array) -> Array:
    """Return weight and buoyancy, (n, 6), in the frame of the water.

    If the water accelerates, weight feels the frame do so, and buoyancy the pressure that makes it.
    """
    falling = np.array([0.0, 0.0, -robot.gravity]) - current_rate
    falling = np.einsum("kji,j->ki", body.rotation, falling)
    solid = robot.masses[:, None] * falling
    water = -robot.displaced_masses[:, None] * falling
    c = np.outer(robot.keels, [0.0, 0.0, -1.0])
    return np.hstack([solid + water, np.cross(c, solid)])


def drag(robot: SpatialRobot, V: Array, gauss_points: int) -> Array:
    """Return the drag on links that move through the water with V, (n, 6)."""
    nodes, shares = np.polynomial.legendre.leggauss(gauss_points)
    rho, r, L = robot.water_density, robot.radii, robot.lengths
    u, p = V[:, 0], V[:, 3]
    wrenches = np.zeros_like(V)
    wrenches[:, 0] = -0.5 * rho * np.pi * r**2 * robot.surge_drag * np.abs(u) * u
    wrenches[:, 0] -= LINEAR_SHARE * robot.linear_drag * rho * r * L * u
    wrenches[:, 3] = -0.5 * rho * L * np.pi * r**4 * robot.roll_drag * np.abs(p) * p
    wrenches[:, 3] -= LINEAR_SHARE * robot.linear_drag * rho * r * L * r**2 * p
    for node, share in zip(nodes, shares, strict=True):
        at = np.outer(node * L / 2, [1.0, 0.0, 0.0])
        across = (V[:, :3] + np.cross(V[:, 3:], at)) * [0.0, 1.0, 1.0]
        speed = np.linalg.norm(across, axis=1)
        slope = rho * r * (robot.cross_flow_drag * speed + robot.linear_drag)
        force = -(share * L / 2 * slope)[:, None] * across
        wrenches += np.hstack([force, np.cross(at, force)])
    return wrenches


def thrust(robot: SpatialRobot, thruster_forces: Array) -> Array:
    """Return what the thrusters do to the links, (n, 6)."""
    wrenches = np.zeros((len(robot.links), 6))
    for thruster, size in zip(robot.thrusters, thruster_forces, strict=True):
        link = thruster.link - 1
        at = np.array(thruster.position) - [robot.lengths[link] / 2, 0.0, 0.0]
        force = size * np.array(thruster.direction)
        wrenches[link] += [*force, *np.cross(at, force)]
    return wrenches


def torques(robot: SpatialRobot, body: Links, joint_torques: Array) -> Array:
    """Return what the joints' drives do to the links, (n, 6)."""
    moments = np.zeros((len(robot.links), 3))
    on_head_side = joint_torques[:, None] * global_axes(robot, body)
    moments[1:] += on_head_side
    moments[:-1] -= on_head_side
    return np.hstack([0.0 * moments, np.einsum("kji,kj->ki", body.rotation, moments)])


def energy(
    robot: SpatialRobot,
    quaternion: Array,
    angular_velocity: Array,
    velocity: Array,
    joint_angles: Array,
    joint_rates: Array,
    position: Array,
) -> float:
    """Return the energy of robot and water, J, seen from the water; `velocity` is relative to it.

    At height 0 weight and buoyancy have no potential.
    """
    body = links(robot, quaternion, angular_velocity, velocity, joint_angles, joint_rates, position)
    V = in_link_axes(body)
    kinetic = 0.5 * np.einsum("ki,kij,kj->", V, inertia(robot), V)
    height = body.centre[:, 2]
    mass_height = height - robot.keels * body.rotation[:, 2, 2]
    potential = robot.masses @ mass_height - robot.displaced_masses @ height
    return kinetic + robot.gravity * potential


def impulse(
    robot: SpatialRobot,
    quaternion: Array,
    angular_velocity: Array,
    velocity: Array,
    joint_angles: Array,
    joint_rates: Array,
    position: Array,
) -> Array:
    """Return Kirchhoff's impulse of robot and water, global, (6,): N s, then N m s.

    The angular one is about the origin of `position`, which the water carries along; `velocity` is
    relative to the water.
    """
    body = links(robot, quaternion, angular_velocity, velocity, joint_angles, joint_rates, position)
    momentum = np.einsum("kij,kj->ki", inertia(robot), in_link_axes(body))
    linear = np.einsum("kij,kj->ki", body.rotation, momentum[:, :3])
    angular = np.einsum("kij,kj->ki", body.rotation, momentum[:, 3:])
    angular = angular + np.cross(body.centre, linear)
    return np.concatenate([linear.sum(axis=0), angular.sum(axis=0)])


def in_link_axes(body: Links) -> Array:
    """Return velocities and angular velocities in link axes, (n, 6)."""
    velocity = np.einsum("kji,kj->ki", body.rotation, body.velocity)
    return np.hstack([velocity, np.einsum("kji,kj->ki", body.rotation, body.omega)])


def global_axes(robot: SpatialRobot, body: Links) -> Array:
    """Return the axes of the joints in the global frame, (n - 1, 3)."""
    return np.einsum("kij,kj->ki", body.rotation[:-1], np.array(robot.joint_axes))


def rotation_of(quaternion: Array) -> Array:
    """Return the rotation from link axes of a unit quaternion (w, x, y, z), (3, 3)."""
    vector = skew(quaternion[1:])
    return np.eye(3) + 2.0 * quaternion[0] * vector + 2.0 * vector @ vector


def turned(axis: Array, angle: float) -> Array:
    """Return the rotation by an angle about a unit vector (Rodrigues), (3, 3)."""
    K = skew(axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def skew(vector: Array) -> Array:
    """Return the matrix whose product with b is the cross product of the vector and b."""
    x, y, z = vector
    return np.array([[0.0 * x, -z, y], [z, 0.0 * x, -x], [-y, x, 0.0 * x]])
