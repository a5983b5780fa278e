"""Spatial robots and random states that the tests of the spatial plant share."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support.spatial_oracle import rotation_of

import usm_gym
from usm_gym.spatial_robot import EELY, EELY_NEUTRAL, Link, SpatialRobot, SpatialThruster

Array = NDArray[np.float64]


class SpatialMotion(NamedTuple):
    """A run sampled in time, relative to the water, the middle link starting at the origin."""

    time: Array  # (T,) s
    # What the oracle's energy and impulse take, each (T, ...).
    quaternion: Array
    angular_velocity: Array
    velocity: Array
    joint_angles: Array
    joint_rates: Array
    position: Array


class SpatialState(NamedTuple):
    """Everything the accelerations depend on, in the order of `usm_gym.spatial_accelerations`."""

    quaternion: Array  # (4,) (w, x, y, z)
    angular_velocity: Array  # (3,) rad/s
    linear_velocity: Array  # (3,) m/s
    joint_angles: Array  # (n - 1,) rad
    joint_rates: Array  # (n - 1,) rad/s
    joint_torques: Array  # (n - 1,) N m
    thruster_forces: Array  # (thrusters,) N
    current: Array  # (3,) m/s

    def coasting(self) -> "SpatialState":
        """Return this state without joint torque and thrust."""
        return self._replace(
            joint_torques=0.0 * self.joint_torques, thruster_forces=0.0 * self.thruster_forces
        )

    def motion(self) -> tuple[Array, ...]:
        """Return attitude and motion, relative to the water: the arguments of energy, impulse."""
        velocity = self.linear_velocity - self.current
        return (
            self.quaternion,
            self.angular_velocity,
            velocity,
            self.joint_angles,
            self.joint_rates,
        )


def random_chain(links: int) -> SpatialRobot:
    """Return a robot whose links, masses, axes, thrusters and coefficients are all uneven."""
    rng = np.random.default_rng(links)
    made = []
    for _ in range(links):
        length, radius = rng.uniform(0.1, 0.8), rng.uniform(0.04, 0.12)
        mass = rng.uniform(0.7, 1.3) * 1000.0 * np.pi * radius**2 * length
        made.append(Link(length, radius, mass, rng.uniform(0.0, 0.5) * radius))
    thrusters = []
    for number in (1, *range(1, links + 1), links):
        link = made[number - 1]
        y, z = rng.uniform(-2.0, 2.0, 2) * link.radius
        at = (rng.uniform(0.0, link.length), y, z)
        thrusters += [SpatialThruster(number, at, unit(rng)) for _ in range(2)]
    return SpatialRobot(
        links=tuple(made),
        joint_axes=tuple(unit(rng) for _ in range(links - 1)),
        thrusters=tuple(thrusters),
        water_density=1000.0,
        added_mass_along=rng.uniform(0.0, 0.5),
        added_mass_across=rng.uniform(0.5, 1.5),
        linear_drag=rng.uniform(0.05, 0.5),
        surge_drag=rng.uniform(0.1, 1.0),
        roll_drag=rng.uniform(0.1, 1.0),
        cross_flow_drag=rng.uniform(0.2, 1.0),
    )


def unit(rng: np.random.Generator) -> tuple[float, float, float]:
    """Draw a direction."""
    x, y, z = rng.normal(size=3)
    size = np.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size


UNEVEN_EELY = replace(
    EELY,
    links=tuple(
        replace(link, radius=0.05 + 0.01 * number, mass=12.0 - number)
        for number, link in enumerate(EELY.links)
    ),
)
ROBOTS = {
    "eely": EELY,
    "eely-neutral": EELY_NEUTRAL,
    "eely-uneven": UNEVEN_EELY,
    **{f"{links} links": random_chain(links) for links in (2, 3, 4, 8, 16)},
}


def without_drag(robot: SpatialRobot) -> SpatialRobot:
    """Return the robot in a fluid that has inertia and weight only."""
    return replace(robot, linear_drag=0.0, surge_drag=0.0, roll_drag=0.0, cross_flow_drag=0.0)


def random_state(robot: SpatialRobot, rng: np.random.Generator) -> SpatialState:
    """Draw a state of any attitude and shape, with every input and a current."""
    joints = len(robot.joint_axes)
    return SpatialState(
        quaternion=unit_quaternion(rng),
        angular_velocity=rng.normal(0.0, 1.0, 3),
        linear_velocity=rng.normal(0.0, 1.0, 3),
        joint_angles=rng.uniform(-1.5, 1.5, joints),
        joint_rates=rng.normal(0.0, 2.0, joints),
        joint_torques=rng.normal(0.0, 10.0, joints),
        thruster_forces=rng.normal(0.0, 20.0, len(robot.thrusters)),
        current=rng.normal(0.0, 0.3, 3),
    )


def at_rest(robot: SpatialRobot) -> SpatialState:
    """Return the straight and level robot, at rest in still water, without torque and thrust."""
    state = random_state(robot, np.random.default_rng(0))
    still = SpatialState(*(np.zeros_like(part) for part in state))
    return still._replace(quaternion=np.array([1.0, 0.0, 0.0, 0.0]))


def unit_quaternion(rng: np.random.Generator) -> Array:
    """Draw an attitude."""
    quaternion = rng.normal(size=4)
    return quaternion / np.linalg.norm(quaternion)


def rotated(state: SpatialState, turn: Array) -> SpatialState:
    """Return the state as it is when robot and water are turned by a unit quaternion."""
    R = rotation_of(turn)
    return state._replace(
        quaternion=product(turn, state.quaternion),
        linear_velocity=R @ state.linear_velocity,
        current=R @ state.current,
    )


def moved(state: SpatialState, velocity: Array) -> SpatialState:
    """Return the state seen from a frame in which robot and water have that velocity more."""
    return state._replace(
        linear_velocity=state.linear_velocity + velocity, current=state.current + velocity
    )


def relative_difference(
    actual: tuple[Array, Array, Array], expected: tuple[Array, Array, Array]
) -> float:
    """Return the largest difference of any two accelerations over the largest acceleration."""
    difference, size = np.concatenate(actual) - np.concatenate(expected), np.concatenate(expected)
    return float(np.max(np.abs(difference)) / np.max(np.abs(size)))


def product(p: Array, q: Array) -> Array:
    """Return the product of two quaternions."""
    w = p[:1] * q[:1] - p[1:] @ q[1:]
    return np.concatenate([w, p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])])


def attitude_rate(quaternion: Array, angular_velocity: Array) -> Array:
    """Return the derivative of an attitude, whose angular velocity is in link axes."""
    return product(quaternion, np.concatenate([[0.0], angular_velocity])) / 2


def swim(robot: SpatialRobot, state: SpatialState, duration: float) -> SpatialMotion:
    """Integrate the plant under constant inputs, so closely that only its own errors show."""
    parts = (*state.motion(), np.zeros(3))
    ends = np.cumsum([part.size for part in parts])[:-1]

    def derivative(_: float, y: Array) -> Array:
        quaternion, omega, velocity, angles, rates, _ = np.split(y, ends)
        quaternion /= np.linalg.norm(quaternion)
        moving = (quaternion, omega, velocity + state.current, angles, rates)
        linear, angular, joints = usm_gym.spatial_accelerations(robot, *moving, *state[5:])
        turning = attitude_rate(quaternion, omega)
        return np.concatenate([turning, angular, linear, rates, joints, velocity])

    def headroom(_: float, y: Array) -> float:
        return 1e3 - float(np.max(np.abs(y)))

    headroom.terminal = True  # type: ignore[attr-defined]  # a faulty plant shall fail, not hang
    time = np.linspace(0.0, duration, 26)
    solution = solve_ivp(
        derivative,
        (0.0, duration),
        np.concatenate(parts),
        method="DOP853",
        t_eval=time,
        events=headroom,
        rtol=1e-12,
        atol=1e-12,
    )
    assert solution.status == 0, solution.message
    return SpatialMotion(time, *np.split(solution.y.T, ends, axis=1))
