"""The robot on its path with its symbols and their signs, drawn from the model, as SVG."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from usm_gym.rendering.look import Points, link_shapes, outlines
from usm_gym.rendering.picture import Posture
from usm_gym.rendering.svg import (
    arrow,
    box,
    centre_of_mass,
    disc,
    document,
    group,
    line,
    stamp,
    stamped,
    text,
    turn,
)
from usm_gym.robot import Robot
from usm_gym.task.sampling import named

SIZE = 640.0, 470.0
# Left and right end of the body, and the height of its centre of mass.
LEFT, RIGHT, HEIGHT = 74.0, 556.0, 134.0
# Position less its reference, m, and velocity of the water, m/s; larger than in an episode.
ERROR = np.array([0.15, 0.15])
CURRENT = np.array([-0.04, -0.02])
# Length of the arrow of a force, and how far beyond it the thruster's number is.
FORCE, NUMBER = 42.0, 13.0
# The detail: its frame, its joint, half the length of its two links, and their angles.
FRAME, JOINT, DETAIL = ((304.0, 246.0), (318.0, 206.0)), np.array([420.0, 330.0]), 58.1
ANGLES = np.radians([62.0, 14.0])
LINK, HEAD = link_shapes(72)


@dataclass(frozen=True)
class Scene:
    """What is drawn, in the global frame with the centre of mass at its origin, and where.

    Attributes:
        robot: The robot.
        posture: Its posture, with the joints where the nominal scenario wants them, and heading 0.
        path: The path of the centre of mass, m, (k, 2).
        scale: Units of the drawing in a metre.
        centre: Where the centre of mass is drawn.
    """

    robot: Robot
    posture: Posture
    path: Points
    scale: float
    centre: Points

    def at(self, metres: Points) -> Points:
        """Places on the drawing."""
        return np.asarray(self.centre + self.scale * metres * (1, -1))


def robot_drawing(robot: Robot, on_path: bool = True) -> str:
    """Draw a robot with links, thrusters, path, error and current, and a joint in detail.

    Args:
        robot: The robot.
        on_path: Whether path and error of the centre of mass are drawn.

    Returns:
        An SVG document, the same whenever it is made.
    """
    scene = _scene(robot)
    title = f"An underwater swimming manipulator of {robot.links} links"
    error = (
        "The error leads from the reference on the path to the centre of mass. " if on_path else ""
    )
    description = (
        f"From above: a chain of links, 1 at the tail to {robot.links} at the head. A positive "
        f"deflection turns the head clockwise. {len(robot.thrusters)} numbered thrusters push "
        f"along or across their links; arrows show positive forces. {error}A detail shows two "
        "links: link angles run anticlockwise from the x axis, and the joint angle is that of the "
        "link nearer to the tail less that of the other."
    )
    marks = [_path(scene)] if on_path else []
    marks += [_current(), _axes(), _deflection(scene), _body(scene), _thrusters(scene)]
    marks += [_error(scene)] if on_path else []
    marks += [_detail(robot), _words(robot, on_path)]
    return document(SIZE, title, description, marks)


def _scene(robot: Robot) -> Scene:
    scenario = dataclasses.replace(named("nominal", "operation", robot=robot), duration=60.0)
    motion = scenario.inspection
    joints = np.zeros(robot.links - 1)
    joints[-motion.bending_joints :] = motion.deflections[0] / motion.bending_joints
    # phi_i = theta_i - theta_(i+1)
    angles = -np.concatenate([[0.0], np.cumsum(joints)])
    angles -= angles.mean()
    posture = Posture(robot.link_centres(angles, np.zeros(2)), angles)
    across = outlines(robot, posture)[..., 0]
    scale = (RIGHT - LEFT) / float(np.ptp(across))
    centre = np.array([LEFT - scale * across.min(), HEIGHT])
    path = scenario.reference_positions()
    path = path - path[path[:, 1].argmax()] - ERROR
    return Scene(robot, posture, path, scale, centre)


def _axis(angle: float) -> Points:
    """The direction of an angle on the drawing."""
    return np.array([np.cos(angle), -np.sin(angle)])


def _body(scene: Scene) -> str:
    robot, centres, angles = scene.robot, scene.at(scene.posture.centres), scene.posture.angles
    size = scene.scale * np.array([0.97 * robot.half_length, robot.half_width])
    marks = [stamp("link", LINK * size), stamp("head", HEAD * size)]
    for centre, angle in zip(centres[:-1], angles[:-1], strict=True):
        joint = centre + scene.scale * robot.half_length * _axis(angle)
        marks.append(disc("edge", joint, 0.3 * size[1]))
    for i, (centre, angle) in enumerate(zip(centres, angles, strict=True), 1):
        colours = ("head", "head-edge") if i == robot.links else ("body", "edge")
        marks.append(stamped("head" if i == robot.links else "link", *colours, centre, angle))
        marks.append(text(str(i), centre, (0, 4.6), "small", "number", "middle", halo=""))
    marks.append(text("tail", centres[0], (-26, -22), "words", "quiet", "middle"))
    marks.append(text("head", centres[-1], (22, -30), "words", "quiet", "middle"))
    return group("body", *marks)


def _thrusters(scene: Scene) -> str:
    robot, marks = scene.robot, []
    for j, thruster in enumerate(robot.thrusters):
        centre = scene.at(scene.posture.centres[thruster.link - 1])
        angle = float(scene.posture.angles[thruster.link - 1])
        if thruster.direction == "normal":
            ahead = _axis(angle + np.pi / 2)
            start = centre + (scene.scale * robot.half_width + 2) * ahead
            at = start + (FORCE + NUMBER) * ahead
        else:
            ahead = _axis(angle)
            start = centre - (scene.scale * robot.half_length + 4 + FORCE) * ahead
            at = start - NUMBER * ahead
        number = text(str(j + 1), at, (0, 4.8), "small", "panel", "middle", halo="")
        force = arrow("thrust", start, start + FORCE * ahead, 3.2)
        marks.append(group(f"thruster-{j + 1}", force, disc("thrust", at, 9.5), number))
    return group("thrusters", *marks)


def _path(scene: Scene) -> str:
    seen = scene.at(scene.path)
    seen = seen[(seen[:, 0] > 40) & (seen[:, 0] < RIGHT + 14)][::10]
    return group(
        "path",
        line("ink", seen[:-2], 1.8, "0.1 5"),
        arrow("ink", seen[-3], seen[-1], 1.8),
        text("path", seen[len(seen) // 7], (0, 22), anchor="middle"),
    )


def _error(scene: Scene) -> str:
    mass, reference = scene.centre, scene.at(-ERROR)
    ahead = (mass - reference) / np.linalg.norm(mass - reference)
    corner = np.array([mass[0], reference[1]])
    return group(
        "error",
        line("error", np.stack([reference, corner, mass]), 1.2, "3 3"),
        arrow("error", reference, mass - 7 * ahead, 2.6),
        disc("reference", reference, 5.0),
        *centre_of_mass(mass),
        text("*p*", mass, (12, 10)),
        text("*p*_{ref}", reference, (0, 20), anchor="middle"),
        text("*e*", (mass + reference) / 2, (-8, -4), name="error", anchor="end"),
    )


def _current() -> str:
    ahead = CURRENT * (1, -1) / np.linalg.norm(CURRENT)
    starts = np.array([[598.0, 26.0], [614.0, 44.0]])
    arrows = [arrow("current", start, start + 52 * ahead, 2.6) for start in starts]
    return group("current", *arrows, text("current *V*_c", (540.0, 38.0), anchor="end"))


def _axes() -> str:
    origin = 30.0, 76.0
    return group(
        "axes",
        arrow("ink", origin, np.add(origin, (44, 0)), 1.8),
        arrow("ink", origin, np.add(origin, (0, -44)), 1.8),
        text("*x*", origin, (50, 5)),
        text("*y*", origin, (0, -51), anchor="middle"),
    )


def _deflection(scene: Scene) -> str:
    """The turn from the tail's direction to the head's."""
    centre, angles = scene.at(scene.posture.centres[-1]), scene.posture.angles
    rays = [
        line("quiet", [centre, centre + 74 * _axis(angle)], 1.2, "4 3")
        for angle in (angles[0], angles[-1])
    ]
    arc = turn("ink", centre, 60, angles[0], angles[-1])
    middle = centre + 68 * _axis((angles[0] + angles[-1]) / 2)
    return group("deflection", *rays, arc, text("*δ*", middle, (0, 4)))


def _detail(robot: Robot) -> str:
    """Two links, larger and narrower, with their angles and that of the joint between them."""
    first = robot.links // 2 - 1
    angles = np.repeat(ANGLES, (first + 1, robot.links - first - 1))
    scale = DETAIL / robot.half_length
    centres = scale * robot.link_centres(angles, np.zeros(2))[first : first + 2] * (1, -1)
    centres += JOINT - centres[0] - DETAIL * _axis(ANGLES[0])
    size = scale * np.array([0.97 * robot.half_length, 0.5 * robot.half_width])
    marks = [box("card", *FRAME, "rule"), stamp("large-link", LINK * size)]
    for centre, angle in zip(centres, ANGLES, strict=True):
        marks.append(stamped("large-link", "body", "edge", centre, angle))
    marks.append(disc("edge", JOINT, 4))
    near, far = centres
    for start, angle, reach in (
        (near, 0.0, 78),
        (far, 0.0, 96),
        (JOINT, ANGLES[1], 152),
        (JOINT, ANGLES[0], 82),
    ):
        marks.append(line("quiet", [start, start + reach * _axis(angle)], 1.2, "4 3"))
    along, across = _axis(ANGLES[0]), _axis(ANGLES[0] + np.pi / 2)
    named_marks = (
        ("t", arrow("ink", near, near + 44 * along, 2.2), "*t*_i", near + 42 * along, (-32, -14)),
        ("n", arrow("ink", near, near + 44 * across, 2.2), "*n*_i", near + 58 * across, (-2, 2)),
        ("theta", turn("ink", near, 52, 0.0, ANGLES[0]), "*θ*_i", near, (63, -18)),
        ("theta-next", turn("ink", far, 84, 0.0, ANGLES[1]), "*θ*_{*i*+1}", far, (114, -6)),
        ("phi", turn("ink", JOINT, 50, *ANGLES), "*φ*_i", JOINT, (46, -48)),
    )
    for name, mark, words, at, away in named_marks:
        marks.append(group(name, mark, text(words, at, away, anchor="middle", halo="card")))
    marks.append(text("link *i*", near, (12, 50), "small", "quiet", halo="card"))
    marks.append(text("link *i*+1", far, (8, 42), "small", "quiet", halo="card"))
    return group("detail", *marks)


def _words(robot: Robot, on_path: bool) -> str:
    """What the symbols mean."""
    error = {
        "*p*": "centre of mass",
        "*p*_{ref}": "its reference, on the path",
        "*e*": "error *p* − *p*_{ref}",
    }
    meanings = (error if on_path else {}) | {
        "*f*_j": "positive force of thruster *j*",
        "*t*_i, *n*_i": "along link *i*, to its left",
        "*θ*_i": "link angle, from *x* to *t*_i",
        "*φ*_i": "joint angle *θ*_i − *θ*_{*i*+1}",
        "*δ*": f"deflection *φ*_{{1}} + … + *φ*_{{{robot.links - 1}}}",
    }
    colours = {"*e*": "error", "*f*_j": "thrust"}
    marks = []
    for k, (symbol, meaning) in enumerate(meanings.items()):
        y = 264.0 + 25.0 * k
        marks.append(text(symbol, (24.0, y), name=colours.get(symbol, "ink")))
        marks.append(text(meaning, (76.0, y)))
    return group("words", *marks)
