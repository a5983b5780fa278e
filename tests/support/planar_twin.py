"""A spatial robot that moves in the plane as a planar one does, its joints' axes all upright.

They are the links' z axes or, on a robot that lies on its side, their y axes. The planar robot's
drag in yaw has no like in space: a pair of thrusters at the ends of each link brings it.
"""

import numpy as np
from numpy.typing import NDArray
from support import oracle
from support.spatial_swimming import SpatialState, product
from support.swimming import State

from usm_gym import Robot, Thruster
from usm_gym.spatial_robot import Link, SpatialRobot, SpatialThruster

Array = NDArray[np.float64]

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
UPRIGHT = {"z": Z, "y": Y}
LEFT = {"z": Y, "y": (0.0, 0.0, -1.0)}
# Attitude of a link along x: rolled by a quarter turn if its y axis is up.
ROLL = {"z": np.array([1.0, 0.0, 0.0, 0.0]), "y": np.array([1.0, 1.0, 0.0, 0.0]) / np.sqrt(2.0)}


def planar_robot(links: int, drag_coefficient: float = 2.0) -> Robot:
    """Return a planar robot that has a twin.

    Its links have the mass of the water in a cylinder of radius a, and the added inertia stands for
    all that a cylinder has beyond a rod. With the drag coefficient 2, c_t is a tenth of c_n.
    """
    a, b, L = 0.03, 0.3, 0.14
    water = 1000.0 * np.pi * a**2 * L
    beyond_a_rod = water * a**2 / 4 + water * L**2 / 12
    return Robot(
        links=links,
        link_length=L,
        link_mass=water,
        half_height=a,
        half_width=b,
        drag_coefficient=drag_coefficient,
        friction_coefficient=0.8 * a / (np.pi * (a + b)),
        added_inertia_coefficient=96.0 * beyond_a_rod / (1000 * np.pi * (a**2 - b**2) ** 2 * L**3),
        thrusters=(Thruster(1, "axial"), Thruster(1, "normal"), Thruster(links, "normal")),
    )


def twin(robot: Robot, up: str) -> SpatialRobot:
    """Return the spatial robot; `up` is the links' axis that joints turn about.

    Its cross-flow drag is to be taken at the links' centres alone.
    """
    L, radius, n = robot.link_length, robot.half_height, robot.links
    direction = {"axial": X, "normal": LEFT[up]}
    given = [
        SpatialThruster(thruster.link, (L / 2, 0.0, 0.0), direction[thruster.direction])
        for thruster in robot.thrusters
    ]
    couples = [
        SpatialThruster(link, (end, 0.0, 0.0), LEFT[up])
        for end in (0.0, L)
        for link in range(1, n + 1)
    ]
    # A spatial robot must have some that push up; here they do not.
    unused = [SpatialThruster(link, (L / 2, 0.0, 0.0), UPRIGHT[up]) for link in (1, n)]
    return SpatialRobot(
        links=(Link(L, radius, robot.link_mass),) * n,
        joint_axes=(UPRIGHT[up],) * (n - 1),
        thrusters=(*given, *couples, *unused),
        water_density=robot.water_density,
        added_mass_along=0.0,
        added_mass_across=robot.added_mass_coefficient,
        linear_drag=robot.drag_coefficient,
        cross_flow_drag=robot.drag_coefficient,
        surge_drag=2.0 * robot.tangential_drag / (robot.water_density * np.pi * radius**2),
        roll_drag=0.0,
    )


def twin_state(robot: Robot, state: State, linear_yaw_drag: float, up: str) -> SpatialState:
    """Return the state of the twin, whose joints count the other way."""
    middle = robot.links // 2
    body = oracle.links(robot, state.theta)
    theta, rate = state.theta[middle], state.theta_dot
    velocity = body.jacobian[middle] @ np.concatenate([rate, state.p_dot])
    couple = -(linear_yaw_drag + robot.quadratic_yaw_drag * np.abs(rate)) * rate
    pair = couple / robot.link_length
    heading = np.array([np.cos(theta / 2), 0.0, 0.0, np.sin(theta / 2)])
    return SpatialState(
        quaternion=product(heading, ROLL[up]),
        angular_velocity=rate[middle] * np.array(UPRIGHT[up]),
        linear_velocity=np.array([*velocity, 0.0]),
        joint_angles=np.diff(state.theta),
        joint_rates=np.diff(rate),
        joint_torques=-state.joint_torques,
        thruster_forces=np.concatenate([state.thruster_forces, -pair, pair, np.zeros(2)]),
        current=np.array([*state.current, 0.0]),
    )


def twin_accelerations(
    robot: Robot, state: State, theta_ddot: Array, p_ddot: Array, up: str
) -> tuple[Array, Array, Array]:
    """Return the planar robot's accelerations as those of the twin."""
    middle = robot.links // 2
    body = oracle.links(robot, state.theta)
    centre = body.jacobian[middle] @ np.concatenate([theta_ddot, p_ddot])
    centre += body.centripetal[middle] @ state.theta_dot**2
    angular = theta_ddot[middle] * np.array(UPRIGHT[up])
    return np.array([*centre, 0.0]), angular, np.diff(theta_ddot)
