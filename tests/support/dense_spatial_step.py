"""One physics step in space in plain NumPy and dense matrices: what the compiled step is held to.

It is that of docs/model_spatial.md, on top of the dense oracle: every link has six accelerations of
its own, and the forces that hold the joints together are unknowns too.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm
from support import spatial_oracle as oracle
from support.spatial_swimming import product, unit_quaternion

from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]

COEFFICIENTS = (
    "added_mass_along",
    "added_mass_across",
    "linear_drag",
    "surge_drag",
    "roll_drag",
    "cross_flow_drag",
)


class Episode(NamedTuple):
    """What a robot is run with."""

    step: float  # h, s
    euler: bool = False
    coefficients: Array = np.ones(6)  # true over nominal ones
    link_factors: Array | None = None  # (n,), None for 1
    current: Array = np.zeros(3)  # m/s, its constant part
    amplitudes: Array = np.zeros((0, 3))  # m/s, of its sinusoids
    phases: Array = np.zeros((0, 3))  # rad
    frequencies: Array = np.zeros(0)  # rad/s
    shifts: Array = np.zeros(0)  # s, when both deflections change
    sizes: Array = np.zeros((0, 2))  # rad, by how much: pan, tilt
    shares: Array | None = (
        None  # (2, joints), of pan and tilt in the joints' references; None for 0
    )
    frequency: float = 0.0  # rad/s, of the filter of both; 0 for none
    time_constant: float = 0.0  # s, of the thrusters
    limit: float = 40.0  # N
    dead_band: float = 0.0  # N
    gains: Array | None = None  # (thrusters,), None for 1

    @property
    def lead(self) -> float:
        """How far into a step forces are taken, s."""
        return 0.0 if self.euler else self.step / 2


class Moment(NamedTuple):
    """All that changes from one physics step to the next."""

    steps: int  # physics steps since the start
    position: Array  # (3,) m, of the root's middle
    quaternion: Array  # (4,) from the root's axes
    velocity: Array  # (3,) m/s
    angular_velocity: Array  # (3,) rad/s, root axes
    joint_angles: Array  # (n - 1,) rad
    joint_rates: Array  # (n - 1,) rad/s
    references: Array  # (2, 3) pan and tilt: rad, rad/s, rad/s^2
    thrust: Array  # (thrusters,) N
    # Of the step before; zero at the start.
    acceleration: Array  # (3,) m/s^2
    angular_acceleration: Array  # (3,) rad/s^2, root axes
    joint_accelerations: Array  # (n - 1,) rad/s^2
    link_accelerations: Array  # (n, 6), of the components in link axes of velocities in the water


def random_episode(robot: SpatialRobot, rng: np.random.Generator, **fixed: object) -> Episode:
    """Draw everything that an episode of 0.2 s can have."""
    joints, waves, shifts = len(robot.joint_axes), 2, 3
    episode = Episode(
        step=1e-3,
        coefficients=rng.uniform(0.5, 1.5, 6),
        link_factors=rng.uniform(0.7, 1.3, joints + 1),
        current=rng.normal(0.0, 0.2, 3),
        amplitudes=rng.normal(0.0, 0.1, (waves, 3)),
        phases=rng.uniform(0.0, 2.0 * np.pi, (waves, 3)),
        frequencies=rng.uniform(0.5, 5.0, waves),
        shifts=np.sort(rng.uniform(0.0, 0.2, shifts)),
        sizes=rng.normal(0.0, 1.0, (shifts, 2)),
        shares=rng.normal(0.0, 0.5, (2, joints)),
        frequency=rng.choice([0.0, 6.0]),
        time_constant=rng.choice([0.0, 0.1]),
        dead_band=5.0,
        gains=rng.uniform(0.8, 1.2, len(robot.thrusters)),
    )
    return episode._replace(**fixed)


def start(robot: SpatialRobot) -> Moment:
    """Return the moment of a straight, level robot at rest."""
    joints = len(robot.joint_axes)
    return Moment(
        0,
        *(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3)),
        *(np.zeros(joints), np.zeros(joints), np.zeros((2, 3)), np.zeros(len(robot.thrusters))),
        *(np.zeros(3), np.zeros(3), np.zeros(joints), np.zeros((joints + 1, 6))),
    )


def random_moment(robot: SpatialRobot, rng: np.random.Generator, steps: int = 200) -> Moment:
    """Draw a moment of any attitude, shape and motion."""
    joints = len(robot.joint_axes)
    return Moment(
        steps=int(rng.integers(steps)),
        position=rng.normal(0.0, 1.0, 3),
        quaternion=unit_quaternion(rng),
        velocity=rng.normal(0.0, 1.0, 3),
        angular_velocity=rng.normal(0.0, 1.0, 3),
        joint_angles=rng.uniform(-1.5, 1.5, joints),
        joint_rates=rng.normal(0.0, 2.0, joints),
        references=rng.normal(0.0, 1.0, (2, 3)),
        thrust=rng.normal(0.0, 20.0, len(robot.thrusters)),
        acceleration=rng.normal(0.0, 10.0, 3),
        angular_acceleration=rng.normal(0.0, 10.0, 3),
        joint_accelerations=rng.normal(0.0, 50.0, joints),
        link_accelerations=rng.normal(0.0, 10.0, (joints + 1, 6)),
    )


def advance(robot: SpatialRobot, episode: Episode, moment: Moment, command: Array) -> Moment:
    """Return the moment one physics step later, under thruster commands in N."""
    h, lead, t = episode.step, episode.lead, moment.steps * episode.step
    asked, references = follow(episode, moment.references, t)
    torque, joint_inertia = joint_torques(robot, episode, moment, asked)
    mean_thrust, thrust = thrust_of(episode, moment.thrust, command)
    current, current_rate = water_at(episode, t + lead)
    ahead = moment._replace(
        quaternion=turned(moment.quaternion, lead * moment.angular_velocity),
        velocity=moment.velocity + lead * moment.acceleration,
        angular_velocity=moment.angular_velocity + lead * moment.angular_acceleration,
        joint_angles=moment.joint_angles + lead * moment.joint_rates,
        joint_rates=moment.joint_rates + lead * moment.joint_accelerations,
    )
    linear, angular, joint, link = accelerations(
        robot, episode, ahead, torque, joint_inertia, mean_thrust, current, current_rate
    )
    turning = moment.angular_velocity + lead * angular
    return Moment(
        steps=moment.steps + 1,
        position=moment.position + h * (moment.velocity + lead * linear),
        quaternion=turned(moment.quaternion, h * turning),
        velocity=moment.velocity + h * linear,
        angular_velocity=moment.angular_velocity + h * angular,
        joint_angles=moment.joint_angles + h * (moment.joint_rates + lead * joint),
        joint_rates=moment.joint_rates + h * joint,
        references=references,
        thrust=thrust,
        acceleration=linear,
        angular_acceleration=angular,
        joint_accelerations=joint,
        link_accelerations=link,
    )


def turned(quaternion: Array, turn: Array) -> Array:
    """Return the attitude after a turn, a rotation vector in body axes."""
    half = np.linalg.norm(turn) / 2
    return product(quaternion, np.array([np.cos(half), *(np.sinc(half / np.pi) * turn / 2)]))


def water_at(episode: Episode, t: float) -> tuple[Array, Array]:
    """Return velocity and acceleration of the water, (3,) each."""
    angle = episode.frequencies[:, None] * t + episode.phases
    swing = episode.amplitudes * np.sin(angle)
    change = episode.amplitudes * episode.frequencies[:, None] * np.cos(angle)
    return episode.current + swing.sum(axis=0), change.sum(axis=0)


def thrust_of(episode: Episode, thrust: Array, command: Array) -> tuple[Array, Array]:
    """Return the mean of the forces over a step, and the forces at its end, N."""
    gains = np.ones(command.size) if episode.gains is None else episode.gains
    target = gains * command * (np.abs(command) >= episode.dead_band)
    h, tau = episode.step, episode.time_constant
    kept = np.exp(-h / tau) if tau > 0.0 else 0.0
    mean_kept = tau / h * (1.0 - kept)  # the integral of exp(-s / tau) over the step, over h
    return target + mean_kept * (thrust - target), target + kept * (thrust - target)


def follow(episode: Episode, references: Array, t: float) -> tuple[Array, Array]:
    """Return what both deflections ask for in a step, (2, 2): angle, rate; and them after it."""
    h, w = episode.step, episode.frequency
    passed = np.clip((t + h - episode.shifts) / h, 0.0, 1.0)
    mean, at_end = passed @ episode.sizes, (passed > 1e-6) @ episode.sizes
    if w == 0.0:
        return np.stack([mean, 0.0 * mean], axis=1), np.stack([at_end, 0 * at_end, 0 * at_end], 1)
    rest, rates = np.stack([mean, 0.0 * mean], axis=1), np.array([[0.0, 1.0], [-w * w, -2.0 * w]])
    before = references[:, :2]
    after = rest + (before - rest) @ expm(h * rates).T
    pull = w * w * (at_end - after[:, 0]) - 2.0 * w * after[:, 1]
    return before + episode.lead / h * (after - before), np.column_stack([after, pull])


def joint_torques(
    robot: SpatialRobot, episode: Episode, moment: Moment, asked: Array
) -> tuple[Array, float]:
    """Return the joint torques of a step, and what they lose per acceleration of the joint in it.

    The controllers are asked for an angle and a rate; their answer to the state is
    u_1 - (u_0 - u_-1) / 2 from its values at the ends of this step and of the one before.
    """
    k_p, k_d, h = robot.joint_stiffness, robot.joint_damping, 2.0 * episode.lead
    phi, rate = moment.joint_angles, moment.joint_rates

    def held(phi: Array, rate: Array) -> Array:
        return -k_p * phi - k_d * rate

    rate_before = rate - h * moment.joint_accelerations
    last = held(phi - h * (rate_before + rate) / 2, rate_before)
    now, coming = held(phi, rate), held(phi + h * rate, rate)  # but for the new acceleration
    shares = np.zeros((2, phi.size)) if episode.shares is None else episode.shares
    wanted = (k_p * asked[:, 0] + k_d * asked[:, 1]) @ shares
    return wanted + coming - (now - last) / 2, h * k_d + h**2 / 2 * k_p


def with_coefficients(robot: SpatialRobot, values: Array) -> SpatialRobot:
    """Return the robot with other hydrodynamic coefficients."""
    return replace(robot, **dict(zip(COEFFICIENTS, values.tolist(), strict=True)))


def accelerations(
    robot: SpatialRobot,
    episode: Episode,
    moment: Moment,
    torque: Array,
    joint_inertia: float,
    thrust: Array,
    current: Array,
    current_rate: Array,
) -> tuple[Array, Array, Array, Array]:
    """Return the accelerations of the root, of the joints and of the links, as in a `Moment`.

    Every link has coefficients of its own. Drag has the factor of the moment, and the velocity of
    the moment with `lead` times what the accelerations have changed by since the step before.
    """
    count, lead = len(robot.links), episode.lead
    factors = np.ones(count) if episode.link_factors is None else episode.link_factors
    known = np.multiply(robot.hydrodynamic_coefficients, episode.coefficients)
    relative = moment.velocity - current
    rates = moment.joint_rates
    body = oracle.links(
        robot, moment.quaternion, moment.angular_velocity, relative, moment.joint_angles, rates
    )
    V = oracle.in_link_axes(body)
    made = [with_coefficients(robot, factor * known) for factor in factors]
    M = np.stack([oracle.inertia(one)[k] for k, one in enumerate(made)])
    D = np.stack([drag_matrix(one, k, V[k]) for k, one in enumerate(made)])

    wrenches = oracle.weight(robot, body, current_rate) + oracle.thrust(robot, thrust)
    wrenches += oracle.torques(robot, body, torque)
    wrenches -= np.einsum("kij,kj->ki", D, V - lead * moment.link_accelerations)
    momentum = np.einsum("kij,kj->ki", M, V)
    v, omega, p, h = V[:, :3], V[:, 3:], momentum[:, :3], momentum[:, 3:]
    wrenches -= np.hstack([np.cross(omega, p), np.cross(omega, h) + np.cross(v, p)])

    axes = oracle.global_axes(robot, body)
    B = np.zeros((count - 1, 6 * count))  # phi'' = B V'
    for joint, axis in enumerate(axes):
        for link, side in ((joint, -1.0), (joint + 1, 1.0)):
            B[joint, 6 * link + 3 : 6 * link + 6] = side * axis @ body.rotation[link]
    inertia = block_diag(*(M + lead * D)) + joint_inertia * B.T @ B
    C, constrained = oracle.constraints(robot, body, rates)
    matrix = np.block([[inertia, C.T], [C, np.zeros((len(C), len(C)))]])
    solution = np.linalg.solve(matrix, np.concatenate([wrenches.ravel(), constrained]))
    V_dot = solution[: 6 * count].reshape(count, 6)

    root = count // 2
    linear = body.rotation[root] @ (V_dot[root, :3] + np.cross(omega[root], v[root]))
    return linear + current_rate, V_dot[root, 3:], B @ V_dot.ravel(), V_dot


def drag_matrix(robot: SpatialRobot, link: int, V: Array) -> Array:
    """Return the drag of a link over its velocity in the water, (6, 6), by five strips of it."""
    rho, r, L = robot.water_density, robot.radii[link], robot.lengths[link]
    linear = oracle.LINEAR_SHARE * robot.linear_drag * rho * r * L
    D = np.zeros((6, 6))
    D[0, 0] = linear + 0.5 * rho * np.pi * r**2 * robot.surge_drag * abs(V[0])
    D[3, 3] = linear * r**2 + 0.5 * rho * L * np.pi * r**4 * robot.roll_drag * abs(V[3])
    for node, weight in zip(*np.polynomial.legendre.leggauss(5), strict=True):
        x = node * L / 2
        across = np.array([[0.0, 1.0, 0.0, 0.0, 0.0, x], [0.0, 0.0, 1.0, 0.0, -x, 0.0]])
        speed = np.linalg.norm(across @ V)
        slope = rho * r * (robot.cross_flow_drag * speed + robot.linear_drag)
        D += weight * L / 2 * slope * across.T @ across
    return D


def flat(moment: Moment) -> Array:
    """Return all numbers of a moment in one row."""
    return np.concatenate([np.ravel(part) for part in moment])
