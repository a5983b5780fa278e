"""The spatial chain in MuJoCo: solid links, their weight and buoyancy, and no other water."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]


def mjcf(robot: SpatialRobot) -> str:
    """Write the chain: the middle link is free, frames are in the links' centres."""
    middle = len(robot.links) // 2
    tail = head = ""
    for link in range(middle):
        tail = body(robot, link, joint=link, side=-1.0, beyond=tail)
    for link in reversed(range(middle + 1, len(robot.links))):
        head = body(robot, link, joint=link - 1, side=1.0, beyond=head)
    root = f'<body name="{middle}"><freejoint/>{solid(robot, middle)}{tail}{head}</body>'
    gravity = f'<option gravity="0 0 {-robot.gravity!r}"/>'
    return f"<mujoco>{gravity}<worldbody>{root}</worldbody></mujoco>"


def body(robot: SpatialRobot, link: int, joint: int, side: float, beyond: str) -> str:
    """Write a link on a side of the root: 1 towards the head, -1 towards the tail.

    Towards the tail it is the near link that turns against the far one, which reverses the axis.
    """
    inner = link - int(side)
    apart = side * float(robot.lengths[inner] + robot.lengths[link]) / 2
    hinge = -side * float(robot.lengths[link]) / 2
    x, y, z = (side * part for part in robot.joint_axes[joint])
    return (
        f'<body name="{link}" pos="{apart!r} 0 0">'
        f'<joint name="{joint}" pos="{hinge!r} 0 0" axis="{x!r} {y!r} {z!r}"/>'
        f"{solid(robot, link)}{beyond}</body>"
    )


def solid(robot: SpatialRobot, link: int) -> str:
    """Write mass and inertia of a link, a cylinder about its lowered centre of mass."""
    part = robot.links[link]
    m, r, L = float(robot.masses[link]), part.radius, part.length
    lean = m * (L**2 / 12 + r**2 / 4)
    inertia = f"{m * r**2 / 2!r} {lean!r} {lean!r}"
    return f'<inertial pos="0 0 {-part.keel!r}" mass="{m!r}" diaginertia="{inertia}"/>'


def accelerations(
    model: mujoco.MjModel,
    robot: SpatialRobot,
    quaternion: Array,
    angular_velocity: Array,
    linear_velocity: Array,
    joint_angles: Array,
    joint_rates: Array,
    joint_torques: Array,
    thruster_forces: Array,
) -> tuple[Array, Array, Array]:
    """Return what `usm_gym.spatial_accelerations` does, for a model of `mjcf`."""
    data = mujoco.MjData(model)
    joints = [model.joint(str(joint)) for joint in range(len(joint_angles))]
    data.qpos[3:7], data.qvel[:3], data.qvel[3:6] = quaternion, linear_velocity, angular_velocity
    for joint, angle, rate, torque in zip(
        joints, joint_angles, joint_rates, joint_torques, strict=True
    ):
        data.qpos[joint.qposadr], data.qvel[joint.dofadr] = angle, rate
        data.qfrc_applied[joint.dofadr] = torque
    mujoco.mj_forward(model, data)
    push = [data.body(str(link)) for link in range(len(robot.links))]
    for link, lifted in zip(push, robot.displaced_masses, strict=True):
        up = np.array([0.0, 0.0, lifted * robot.gravity])
        apply(model, data, up, link.xpos, link.id)
    for thruster, size in zip(robot.thrusters, thruster_forces, strict=True):
        link = push[thruster.link - 1]
        R = link.xmat.reshape(3, 3)
        at = np.array(thruster.position) - [robot.lengths[thruster.link - 1] / 2, 0.0, 0.0]
        apply(model, data, size * R @ thruster.direction, link.xpos + R @ at, link.id)
    mujoco.mj_forward(model, data)
    joint_accelerations = np.concatenate([data.qacc[joint.dofadr] for joint in joints])
    return data.qacc[:3].copy(), data.qacc[3:6].copy(), joint_accelerations


def apply(
    model: mujoco.MjModel, data: mujoco.MjData, force: Array, point: Array, link: int
) -> None:
    """Push a link at a point."""
    mujoco.mj_applyFT(model, data, force, np.zeros(3), point, link, data.qfrc_applied)
