"""Times MuJoCo on the same chains, in its ellipsoid model of a fluid."""

from __future__ import annotations

import numpy as np

from usm_cli.speed import Timing
from usm_gym.robot import Robot
from usm_gym.spatial_robot import SpatialRobot


def mujoco_timing(name: str, steps: int, model: str) -> Timing:
    """Time MuJoCo's C loop on a model that `planar_chain` or `spatial_chain` has written.

    Raises:
        ImportError: If MuJoCo is not installed.
    """
    import mujoco
    from mujoco import rollout

    chain = mujoco.MjModel.from_xml_string(model)
    data = mujoco.MjData(chain)
    data.qvel[:] = 0.1 * np.random.default_rng(0).standard_normal(chain.nv)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    state = np.zeros((1, mujoco.mj_stateSize(chain, kind)))
    mujoco.mj_getState(chain, data, state[0], kind)
    return Timing(name, lambda: rollout.rollout(chain, data, state, nstep=steps), steps)


def planar_chain(robot: Robot) -> str:
    """Write the planar robot without thrusters as a MuJoCo model."""
    half = robot.half_length
    geom = (
        f'<geom type="ellipsoid" size="{half} {robot.half_height} {robot.half_width}" '
        f'mass="{robot.link_mass}" fluidshape="ellipsoid" contype="0" conaffinity="0"/>'
    )
    joint = (
        f'<joint axis="0 0 1" pos="{-half} 0 0" stiffness="{robot.joint_stiffness}" '
        f'damping="{robot.joint_damping}"/>'
    )
    bodies = ""
    for _ in range(robot.links - 1):
        bodies = f'<body pos="{2 * half} 0 0">{joint}{geom}{bodies}</body>'
    root = '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint/>'
    option = f'<option timestep="0.001" gravity="0 0 0" density="{robot.water_density}"/>'
    world = f"<worldbody><body>{root}{geom}{bodies}</body></worldbody>"
    return f"<mujoco>{option}{world}</mujoco>"


def spatial_chain(robot: SpatialRobot, integrator: str) -> str:
    """Write the spatial robot without thrusters, keel and weight as a MuJoCo model.

    Args:
        robot: The robot.
        integrator: "Euler", or "implicitfast", which MuJoCo's documentation advises with fluids.
    """
    root = len(robot.links) // 2
    tail = head = ""
    for i in range(root):
        tail = _body(robot, i, i, -1.0, tail)
    for i in range(len(robot.links) - 1, root, -1):
        head = _body(robot, i, i - 1, 1.0, head)
    option = (
        f'<option timestep="0.001" gravity="0 0 0" density="{robot.water_density}" '
        f'integrator="{integrator}"/>'
    )
    body = f"<body><freejoint/>{_geom(robot, root)}{tail}{head}</body>"
    return f"<mujoco>{option}<worldbody>{body}</worldbody></mujoco>"


def _body(robot: SpatialRobot, i: int, joint: int, side: float, beyond: str) -> str:
    """Link i, its joint towards the root, and what lies beyond it, on a side of the root."""
    half, inner = robot.lengths[i] / 2, robot.lengths[i - int(side)] / 2
    x, y, z = (side * part for part in robot.joint_axes[joint])
    hinge = (
        f'<joint axis="{x} {y} {z}" pos="{-side * half} 0 0" '
        f'stiffness="{robot.joint_stiffness}" damping="{robot.joint_damping}"/>'
    )
    place = f'pos="{side * (half + inner)} 0 0"'
    return f"<body {place}>{hinge}{_geom(robot, i)}{beyond}</body>"


def _geom(robot: SpatialRobot, i: int) -> str:
    """Link i as an ellipsoid of its half axes and its mass."""
    link = robot.links[i]
    return (
        f'<geom type="ellipsoid" size="{link.length / 2} {link.radius} {link.radius}" '
        f'mass="{robot.masses[i]}" fluidshape="ellipsoid" contype="0" conaffinity="0"/>'
    )
