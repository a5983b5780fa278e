"""The body of a spatial robot: links, joints, thrusters, and the jets of these."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usm_gym.rendering.look import (
    BODY,
    BODY_EDGE,
    HEAD,
    HEAD_EDGE,
    JET,
    TAIL,
)
from usm_gym.rendering.space.mesh import Mesh, Solid, joined, revolved
from usm_gym.spatial_robot import SpatialRobot, SpatialThruster

Array = NDArray[np.float64]

# Lengths over the radius of the link: the gap at either end of it, the length over which its ends
# are rounded, and the longest slice.
GAP, ROUNDING, SLICE = 0.14, 0.35, 1.4
# Over it too: the radius of a joint's ball, and of the pins that show its axis.
JOINT, PIN = 0.7, 0.22
# A thruster's duct: its radius, half its length beside the body, how far it looks out of the body.
DUCT, HALF_DUCT, COLLAR = 0.44, 0.62, 1.13
# The strut that carries it there: its radius.
STRUT = 0.2
# Its jet at the limit: length over the robot's, and radius over the duct's.
JET_LENGTH, JET_RADIUS = 0.13, 0.95


def body(robot: SpatialRobot) -> Mesh:
    """Links, joints and thrusters in the axes of their links."""
    return joined([solid.mesh() for solid in solids(robot)])


def solids(robot: SpatialRobot) -> list[Solid]:
    """Links, joints and thrusters, each of several solids."""
    parts = []
    for i, (length, radius) in enumerate(zip(robot.lengths, robot.radii, strict=True)):
        parts.append(_link(i, length, radius, len(robot.links)))
        if i < len(robot.joint_axes):
            at, joint = np.array([length / 2, 0.0, 0.0]), JOINT * radius
            turns = np.linspace(0.0, np.pi, 7)
            ball = joint * np.stack([-np.cos(turns), np.sin(turns)], axis=1)
            # The links hide what is within them.
            parts.append(Solid(ball, 6 * [BODY_EDGE], BODY_EDGE, i, at, deeper=radius))
            parts += _collars(PIN, radius, i, at, np.array(robot.joint_axes[i]))
    for thruster in robot.thrusters:
        parts += _thruster(robot, thruster)
    return parts


def hull(robot: SpatialRobot) -> Mesh:
    """Links without gaps and thrusters, whose shadow has a smooth edge."""
    parts = []
    for i, (length, radius) in enumerate(zip(robot.lengths, robot.radii, strict=True)):
        turns = np.linspace(0.0, np.pi / 2, 4)
        front = np.array([length / 2, 0.0]) + radius * np.stack([np.sin(turns), np.cos(turns)], 1)
        if i == len(robot.links) - 1:
            front[:, 0] -= radius
        back = front[::-1] * (-1, 1)
        parts.append(revolved(np.concatenate([back, front]), BODY, BODY, i))
    return joined(parts)


def jets(robot: SpatialRobot, thrust: Array) -> list[tuple[Mesh, float]]:
    """The water that leaves the thrusters, against their forces, in the axes of their links.

    Args:
        robot: The robot.
        thrust: Forces over their limit, (thrusters,).

    Returns:
        The jets of the forces that are not next to nothing, and the force of each.
    """
    total, found = float(robot.lengths.sum()), list[tuple[Mesh, float]]()
    for thruster, share in zip(robot.thrusters, thrust, strict=True):
        length = JET_LENGTH * total * abs(share)
        if length < 0.004 * total:
            continue
        at, direction, mouth, wide = jet_place(robot, thruster)
        flow = -np.sign(share) * direction
        profile = [(0.0, 0.0), (0.0, 0.55 * wide), (0.85 * length, wide), (length, 0.0)]
        at = at + mouth * flow
        jet = revolved(profile, JET, JET, thruster.link - 1, at, flow)
        found.append((jet, float(share)))
    return found


def jet_place(robot: SpatialRobot, thruster: SpatialThruster) -> tuple[Array, Array, float, float]:
    """Where jets of a thruster start.

    Returns:
        The middle of the thruster, m, and the direction of a positive force, in link axes, how far
        from there along it or against it they start, m, and how wide they become, m.
    """
    radius = robot.radii[thruster.link - 1]
    mouth = (COLLAR if _is_tunnel(thruster, radius) else HALF_DUCT) * radius
    direction = np.array(thruster.direction)
    return _position(robot, thruster), direction, float(mouth), float(JET_RADIUS * DUCT * radius)


def _link(i: int, length: float, radius: float, links: int) -> Solid:
    is_tail, is_head = i == 0, i == links - 1
    half = length / 2 - min(GAP * radius, 0.2 * length)
    back = min(ROUNDING * radius, 0.4 * half)
    front = back
    if is_tail:
        back = min(0.9 * radius, half)
    if is_head:
        front = min(1.9 * radius, half)
    turns = np.linspace(0.0, np.pi / 2, 6)
    rounded = np.stack([1 - np.sin(turns), np.cos(turns)], axis=1)[::-1]
    ends = [_end(rounded, back, radius, is_tail), _end(rounded, front, radius, is_head)[::-1]]
    ends[0][:, 0] -= half
    ends[1][:, 0] = half - ends[1][:, 0]
    start, stop = ends[0][-1, 0], ends[1][0, 0]
    cuts = np.linspace(start, stop, max(2, round((stop - start) / (SLICE * radius)) + 1))[1:-1]
    side = np.stack([cuts, np.full(len(cuts), radius)], axis=1)
    colour, edge = (TAIL if is_tail else BODY), BODY_EDGE
    if is_head:
        colour, edge = HEAD, HEAD_EDGE
    profile = np.concatenate([ends[0], side, ends[1]])
    colours = [colour] * (len(profile) - 1)
    # The head looks ahead.
    colours[-2 if is_head else -1 :] = 2 * [HEAD_EDGE] if is_head else [BODY_EDGE]
    if not is_tail:
        colours[0] = BODY_EDGE
    # A stripe along the top shows how a link rolls.
    stripe = (len(ends[0]) - 1, len(profile) - len(ends[1]))
    return Solid(profile, colours, edge, i, stripe=stripe)


def _end(rounded: Array, depth: float, radius: float, closed: bool) -> Array:
    """A rounded end: places from 0 to its depth, and radii; blunt unless it is closed."""
    if closed:
        return rounded * (depth, radius)
    blunt = rounded * (depth, 0.3 * radius) + (0.0, 0.7 * radius)
    return np.concatenate([[(0.0, 0.0)], blunt[1:]])


def _thruster(robot: SpatialRobot, thruster: SpatialThruster) -> list[Solid]:
    i = thruster.link - 1
    radius, direction = robot.radii[i], np.array(thruster.direction)
    at = _position(robot, thruster)
    if _is_tunnel(thruster, radius):
        return _collars(DUCT, radius, i, at, direction)
    duct = _duct(_drum(HALF_DUCT * radius, DUCT * radius), i, at, direction)
    arm = at * (0.0, 1.0, 1.0)
    # From within the body to within the duct.
    root, reach = 0.8 * radius, float(np.linalg.norm(arm)) - 0.7 * DUCT * radius
    if reach < root:
        return [duct]
    strut = np.array([(root, 0.0), (root, STRUT * radius), (reach, STRUT * radius), (reach, 0.0)])
    return [Solid(strut, 3 * [TAIL], BODY_EDGE, i, at - arm, arm), duct]


def _collars(width: float, radius: float, link: int, at: Array, axis: Array) -> list[Solid]:
    """The two ends of a tube or a pin across a link, which look out of it."""
    collar = _drum((COLLAR - 0.9) / 2 * radius, width * radius)
    middle = (COLLAR + 0.9) / 2 * radius
    return [_duct(collar, link, at + side * middle * axis, axis) for side in (-1, 1)]


def _duct(profile: Array, link: int, at: Array, direction: Array) -> Solid:
    """A drum with dark openings."""
    colours = [BODY_EDGE, *(len(profile) - 3) * [TAIL], BODY_EDGE]
    return Solid(profile, colours, BODY_EDGE, link, at, direction)


def _drum(half: float, radius: float) -> Array:
    rim = 0.72 * radius
    return np.array(
        [(-half, 0), (-half, rim), (-half, radius), (half, radius), (half, rim), (half, 0)]
    )


def _is_tunnel(thruster: SpatialThruster, radius: float) -> bool:
    """Whether it blows through the body, across its axis."""
    arm = np.array(thruster.position[1:])
    across = abs(thruster.direction[0]) < 0.5
    return bool(across and np.linalg.norm(arm) < 0.5 * radius)


def _position(robot: SpatialRobot, thruster: SpatialThruster) -> Array:
    """Where a thruster is, in link axes from the middle of its link, m, (3,)."""
    half = robot.links[thruster.link - 1].length / 2
    return np.array(thruster.position) - (half, 0.0, 0.0)
