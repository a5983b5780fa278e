"""A spatial robot with its numbers and signs, from three sides, drawn from its data as SVG."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from usm_gym.rendering import svg
from usm_gym.rendering.look import Points
from usm_gym.rendering.svg import arrow, box, disc, document, group, line, shape, text, turn
from usm_gym.spatial_posture import centre_of_mass, link_poses
from usm_gym.spatial_robot import SpatialRobot

Array = NDArray[np.float64]

SIZE = 640.0, 552.0
# Left and right end of the straight body, and the heights of its axis in the two views.
LEFT, RIGHT, ABOVE, BESIDE = 40.0, 552.0, 116.0, 298.0
# Length of the arrow of a force, and how far beyond it the thruster's number is.
FORCE, NUMBER = 34.0, 13.0
# How far from the axis the joints' symbols are, and the lengths' line.
SYMBOL, LENGTHS = 42.0, 58.0
# The angle of the joint that is shown turned.
ANGLE = np.radians(24.0)
# The section: its frame, the place of its axis, units in a metre.
FRAME, SECTION, LARGE = ((356.0, 366.0), (266.0, 170.0)), np.array([514.0, 456.0]), 380.0
# Roundings of a link's ends over its radius: the tail, between links, and the head.
TAIL_END, END, HEAD_END = 0.9, 0.3, 1.7


@dataclass(frozen=True)
class Side:
    """The straight robot as seen from one side, its tail's end at the left.

    Attributes:
        robot: The robot.
        name: From where it is seen.
        letter: The axis that points up in the drawing, "y" or "z".
        height: Height of its axis in the drawing.
    """

    robot: SpatialRobot
    name: str
    letter: str
    height: float

    @property
    def scale(self) -> float:
        """Units of the drawing in a metre."""
        return (RIGHT - LEFT) / float(self.robot.lengths.sum())

    @property
    def up(self) -> int:
        """Number of the axis that points up."""
        return "xyz".index(self.letter)

    @property
    def across(self) -> int:
        """Number of the axis that points at the reader or away."""
        return 3 - self.up

    def at(self, metres: Array) -> Points:
        """Places on the drawing, (..., 2), of points from the tail's end, m, (..., 3)."""
        flat = np.asarray(metres, np.float64)[..., [0, self.up]]
        return np.asarray((LEFT, self.height) + self.scale * flat * (1, -1))

    def joint(self, k: int) -> Points:
        """Place of a joint, counted from 0."""
        return self.at(np.array([self.robot.lengths[: k + 1].sum(), 0.0, 0.0]))

    def outline(self, link: int, rotation: Array, centre: Array) -> Points:
        """Outline of a link, (corners, 2)."""
        last = len(self.robot.links) - 1
        half, radius = 0.98 * self.robot.lengths[link] / 2, self.robot.radii[link]
        back = min(radius * (TAIL_END if link == 0 else END), half)
        front = min(radius * (HEAD_END if link == last else END), half)
        turns = np.linspace(0.0, np.pi / 2, 9)
        along, blunt = 1 - np.cos(turns), radius * np.sqrt(np.sin(turns))
        pointed = radius * np.sin(turns) if link == last else blunt
        tail_end = np.stack([back * along - half, blunt], axis=1)
        head_end = np.stack([half - front * along, pointed], axis=1)[::-1]
        upper = np.concatenate([tail_end, head_end])
        flat = np.concatenate([upper, upper[::-1] * (1, -1)])
        return self.at(centre + flat @ rotation[:, [0, self.up]].T)


def spatial_robot_drawing(robot: SpatialRobot) -> str:
    """Draw a robot from above, from its right side and from behind.

    Returns:
        An SVG document, the same whenever it is made.
    """
    title = f"A swimming manipulator of {len(robot.links)} links in space"
    root = len(robot.links) // 2 + 1
    places = (
        "mass lie below the axis, centres of buoyancy on it"
        if robot.keels.any()
        else "mass and of buoyancy lie on the axis"
    )
    description = (
        f"The straight robot from above and from its right side: links 1 at the tail to "
        f"{len(robot.links)} at the head with their lengths; joints about z turn the head to the "
        "left and joints about y lower it, if their angles are positive; "
        f"{len(robot.thrusters)} numbered thrusters with arrows of positive forces. Link {root} is "
        f"the root. From behind: centres of {places}."
    )
    sides = Side(robot, "from above", "y", ABOVE), Side(robot, "from the right", "z", BESIDE)
    marks = [_side(side) for side in sides]
    marks += [_lengths(sides[0]), _root(sides[1]), _ends(sides[1]), _section(robot), _words(robot)]
    return document(SIZE, title, description, marks)


def _side(side: Side) -> str:
    """The body from one side, with what acts or turns in the plane of the drawing."""
    robot = side.robot
    rotations, centres = _posed(robot, np.zeros(len(robot.joint_axes)))
    marks = [_axes(side), _turned(side)]
    for k, axis in enumerate(robot.joint_axes):
        marks.append(_joint(side, k, abs(axis[side.across]) > 0.5))
    for i in range(len(robot.links)):
        outline = side.outline(i, rotations[i], centres[i])
        name, edge = ("head", "head-edge") if i == len(robot.links) - 1 else ("body", "edge")
        marks += [shape(name, outline), line(edge, [*outline, outline[0]], 1.2)]
        marks.append(_number(side, i, centres[i]))
    for k, axis in enumerate(robot.joint_axes):
        if abs(axis[side.across]) > 0.5:
            marks.append(_joint_symbol(side, k))
    for j in range(len(robot.thrusters)):
        marks.append(_thruster(side, j, centres))
    return group(f"side-{side.letter}", *marks)


def _number(side: Side, i: int, centre: Array) -> str:
    """The number of a link: beside its thrusters, and below it if it is short."""
    length, radius = side.scale * side.robot.lengths[i], side.scale * side.robot.radii[i]
    if length < 3 * radius:
        at, away = side.at(centre), (0.0, radius + 15)
    else:
        carries = any(thruster.link == i + 1 for thruster in side.robot.thrusters)
        at, away = side.at(centre) - (length * (0.35 if carries else 0.0), 0), (0.0, 4.6)
    return text(str(i + 1), at, away, "small", "number", "middle", halo="")


def _posed(robot: SpatialRobot, angles: Array) -> tuple[Array, Array]:
    """Rotations and centres of the links, from the tail's end of the straight robot."""
    root = len(robot.links) // 2
    middle = float(robot.lengths[:root].sum() + robot.lengths[root] / 2)
    return link_poses(robot, (middle, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), angles)


def _axes(side: Side) -> str:
    origin = np.array([26.0, side.height - 42.0])
    return group(
        f"axes-{side.letter}",
        arrow("ink", origin, np.add(origin, (36, 0)), 1.8),
        arrow("ink", origin, np.add(origin, (0, -36)), 1.8),
        text("*x*", origin, (41, 5)),
        text(f"*{side.letter}*", origin, (0, -42), anchor="middle"),
        text(side.name, origin, (16, -38), "title"),
    )


def _joint(side: Side, k: int, faces_reader: bool) -> str:
    """The bolt of a joint: its axis is seen from its end, or from the side."""
    at, radius = side.joint(k), side.scale * side.robot.radii[k]
    if faces_reader:
        return disc("edge", at, 0.3 * radius)
    return line("edge", np.add(at, 1.15 * radius * np.array([(0, -1), (0, 1)])), 3.2, cap="butt")


def _joint_symbol(side: Side, k: int) -> str:
    at, radius = side.joint(k), side.scale * side.robot.radii[k]
    return group(
        f"joint-{k + 1}",
        line("quiet", [at, at - (0, SYMBOL - 3)], 1.0),
        disc("card", at, 0.42 * radius),
        disc("edge", at, 0.3 * radius),
        text(f"*φ*_{k + 1}", at, (0, -SYMBOL - 3), anchor="middle"),
    )


def _turned(side: Side) -> str:
    """What the last joint in the plane of the drawing does, if its angle is positive."""
    robot = side.robot
    turning = [k for k, axis in enumerate(robot.joint_axes) if abs(axis[side.across]) > 0.5]
    if not turning:
        return ""
    joint = turning[-1]
    angles = np.zeros(len(robot.joint_axes))
    angles[joint] = ANGLE
    rotations, centres = _posed(robot, angles)
    marks = []
    for i in range(joint + 1, len(robot.links)):
        outline = side.outline(i, rotations[i], centres[i])
        marks.append(line("quiet", [*outline, outline[0]], 1.2, "4 3"))
    at = side.joint(joint)
    ahead = rotations[-1, :, 0]
    angle = float(np.arctan2(ahead[side.up], ahead[0]))
    reach = side.scale * float(robot.lengths[joint + 1 :].sum()) + 12
    tip = at + (reach + 10) * np.array([np.cos(0.55 * angle), -np.sin(0.55 * angle)])
    words = text(f"*φ*_{joint + 1} > 0", tip, (0, 5))
    return group(f"turned-{side.letter}", *marks, turn("ink", at, reach, 0.0, angle), words)


def _thruster(side: Side, j: int, centres: Array) -> str:
    """A thruster; its force, if that is in the plane of this side and no earlier one's."""
    robot, thruster = side.robot, side.robot.thrusters[j]
    i = thruster.link - 1
    position = np.array(thruster.position)
    place = centres[i] + position - (robot.lengths[i] / 2, 0.0, 0.0)
    at, direction = side.at(place), np.array(thruster.direction)
    radius = side.scale * robot.radii[i]
    arm = abs(position[side.up]) * side.scale
    if abs(direction[side.across]) > 0.5:
        port = [disc("edge", at, 0.42 * radius), disc("panel", at, 0.25 * radius)]
        return group(f"port-{side.letter}-{j + 1}", *port)
    if side.letter == "z" and abs(direction[0]) > 0.5:
        return _duct(at, radius, along=True)
    ahead = direction[[0, side.up]] * (1, -1)
    if abs(direction[0]) > 0.5:
        out = np.array([0.0, -np.sign(position[side.up]) or -1.0])
        start = at + 0.7 * radius * ahead
        number = at + (0.5 * radius + NUMBER) * out
        strut = line("edge", [at, at - (arm - 0.9 * radius) * out], 3.0, cap="butt")
        marks = [strut, _duct(at, radius, along=True)]
        marks.append(arrow("thrust", start, start + 0.8 * FORCE * ahead, 3.0))
    else:
        start = at + (max(radius - arm, 0.0) + 0.35 * radius + 3) * ahead
        number = start + (FORCE + NUMBER) * ahead
        marks = [_duct(at + max(radius - arm, 0.0) * ahead, radius, along=False)]
        marks.append(arrow("thrust", start, start + FORCE * ahead, 3.0))
    marks += [
        disc("thrust", number, 9.5),
        text(str(j + 1), number, (0, 4.8), "small", "panel", "middle", halo=""),
    ]
    return group(f"thruster-{j + 1}", *marks)


def _duct(at: Points, radius: float, along: bool) -> str:
    """The duct of a thruster, along the body or across it."""
    half = np.array([0.6, 0.36] if along else [0.36, 0.3]) * radius
    corners = at + half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return shape("edge", corners)


def _lengths(side: Side) -> str:
    """Lengths of the links, m, below the body."""
    ends = LEFT + side.scale * np.concatenate([[0.0], np.cumsum(side.robot.lengths)])
    y = side.height + LENGTHS
    marks = [line("quiet", [(LEFT, y), (ends[-1], y)], 1.0)]
    marks += [line("quiet", [(x, y - 5), (x, y + 5)], 1.0) for x in ends]
    for left, right, length in zip(ends[:-1], ends[1:], side.robot.lengths, strict=True):
        at = ((left + right) / 2, y + 17)
        marks.append(text(f"{length:g}", at, (0, 0), "small", "quiet", "middle"))
    marks.append(text("m", (ends[-1], y + 17), (8, 0), "small", "quiet"))
    return group("lengths", *marks)


def _root(side: Side) -> str:
    """The root, and the centre of mass of the straight robot."""
    robot = side.robot
    rotations, centres = _posed(robot, np.zeros(len(robot.joint_axes)))
    root = len(robot.links) // 2
    mass = side.at(centre_of_mass(robot, rotations, centres))
    radius = side.scale * robot.radii[root]
    left, right = (np.add(side.joint(k), (0, radius + 9)) for k in (root - 1, root))
    left, right = left + 0.02 * (right - left), right - 0.02 * (right - left)
    bracket = [left - (0, 5), left, right, right - (0, 5)]
    middle = (left + right) / 2
    return group(
        "root",
        line("ink", bracket, 1.4),
        text(f"root: link {root + 1}", middle, (0, 18), anchor="middle"),
        *svg.centre_of_mass(mass, 5.0),
    )


def _ends(side: Side) -> str:
    """Which end is the tail and which the head."""
    lengths, radius = side.scale * side.robot.lengths, side.scale * side.robot.radii[0]
    tail, head = (LEFT + lengths[0] / 2, side.height), (RIGHT - lengths[-1] / 2, side.height)
    marks = [text("tail", tail, (0, radius + 18), "small", "quiet", "middle")]
    marks.append(text("head", head, (4, -radius - 9), "small", "quiet", "middle"))
    return group("ends", *marks)


def _section(robot: SpatialRobot) -> str:
    """The root from behind, with its keel and what pushes it ahead."""
    root = len(robot.links) // 2
    link = robot.links[root]
    marks = [box("card", *FRAME, "rule"), *_section_axes()]
    radius = LARGE * link.radius
    for j, thruster in enumerate(robot.thrusters):
        if thruster.link == root + 1 and abs(thruster.direction[0]) > 0.5:
            at = SECTION - LARGE * np.array(thruster.position[1:])
            marks.append(_from_behind(j, at, radius, thruster.direction[0] > 0))
    turns = np.linspace(0, 2 * np.pi, 73)
    circle = SECTION + radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    mass = np.add(SECTION, (0.0, LARGE * link.keel))
    marks += [shape("body", circle), line("edge", circle, 1.4)]
    marks.append(line("quiet", [SECTION, np.add(SECTION, (0, -radius - 9))], 1.0))
    marks.append(disc("quiet", SECTION, 3.0))
    marks.append(line("quiet", [mass, np.add(SECTION, (0, radius + 9))], 1.0))
    marks += svg.centre_of_mass(mass)
    words = "centre of mass" + (f", {100 * link.keel:g} cm lower" if link.keel else "")
    marks.append(
        text("centre of buoyancy", SECTION, (0, -radius - 14), "small", "ink", "middle", "card")
    )
    marks.append(text(words, SECTION, (0, radius + 24), "small", "ink", "middle", "card"))
    return group("section", *marks)


def _section_axes() -> list[str]:
    origin = np.array([FRAME[0][0] + 50, SECTION[1]])
    return [
        text("from behind", FRAME[0], (14, 25), "title", halo="card"),
        arrow("ink", origin, origin - (28, 0), 1.8),
        arrow("ink", origin, origin - (0, 28), 1.8),
        text("*y*", origin, (-38, 5), anchor="middle", halo="card"),
        text("*z*", origin, (0, -33), anchor="middle", halo="card"),
    ]


def _from_behind(j: int, at: Points, radius: float, ahead: bool) -> str:
    """A thruster on its strut, which pushes away from the reader or towards the reader."""
    cross = 0.3 * radius * np.array([(1, 1), (-1, -1)]) / np.sqrt(2)
    number = np.add(at, (0, 0.42 * radius + NUMBER))
    if ahead:
        force = [line("thrust", at + cross * (1, side), 2.0) for side in (1, -1)]
    else:
        force = [disc("thrust", at, 0.14 * radius)]
    return group(
        f"behind-{j + 1}",
        line("edge", [SECTION, at], 4.0),
        disc("edge", at, 0.44 * radius),
        disc("card", at, 0.34 * radius),
        *force,
        disc("thrust", number, 9.5),
        text(str(j + 1), number, (0, 4.8), "small", "panel", "middle", halo=""),
    )


def _words(robot: SpatialRobot) -> str:
    """What the symbols mean."""
    meanings = [
        ("*x*, *y*, *z*", "ink", "ahead, to the left, up"),
        ("*φ*_i", "ink", "angle of joint *i*, right-handed"),
        ("", "ink", "about *z* (pan): positive to the left"),
        ("", "ink", "about *y* (tilt): positive downwards"),
        ("*f*_j", "thrust", "positive force of thruster *j*"),
        (f"{robot.lengths[0]:g}", "quiet", _sizes(robot)),
        ("", "ink", "thruster across the drawing"),
    ]
    marks = []
    y = FRAME[0][1] - 4.0
    for symbol, colour, meaning in meanings:
        y += 24.0
        marks += [text(symbol, (24.0, y), name=colour)] if symbol else []
        marks.append(text(meaning, (84.0, y)))
    port = np.array([35.0, y - 5])
    marks += [disc("edge", port, 5.8), disc("panel", port, 3.5)]
    return group("words", *marks)


def _sizes(robot: SpatialRobot) -> str:
    radius = robot.radii[0]
    same = bool((robot.radii == radius).all())
    return "length of a link, m" + (f"; radius {radius:g} m" if same else "")
