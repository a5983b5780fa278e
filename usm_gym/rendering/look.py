"""The look of the robot and its world: colours, and the outlines of the links."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from usm_gym.rendering.picture import Posture
from usm_gym.robot import Robot

Points = NDArray[np.float64]
Colour = tuple[int, int, int]
# Red, green and blue, (height, width, 3).
Frame = NDArray[np.uint8]

# Frames of one robot are laid out on so many points.
WIDTH, HEIGHT = 640, 480

INK, PAPER = (38, 50, 56), (255, 255, 255)
# The colours of Okabe and Ito, which colour-blind people can tell apart, and tints of them.
GREY, FAINT, RULE, WATER = (96, 110, 118), (222, 230, 235), (200, 210, 217), (243, 248, 251)
ERROR_COLOURS = ((0, 114, 178), (213, 94, 0))
AXIS_COLOURS = (*ERROR_COLOURS, (0, 158, 115))
BODY, BODY_EDGE = (203, 215, 224), (84, 104, 120)
HEAD, HEAD_EDGE = (240, 178, 60), (140, 92, 0)
TAIL = (150, 168, 182)
JET, JET_CORE = (176, 218, 243), (86, 180, 233)
CURRENT = (70, 130, 160)
REFERENCE = (196, 120, 164)
TRAIL = (0, 140, 105)
ALARM = (176, 36, 24)
# How much of the ground a pose that is asked for covers.
WANTED = 0.32


def faded(colour: Colour, share: float, ground: Colour = WATER) -> Colour:
    """A share of a colour, the rest of it that of the ground."""
    red, green, blue = (
        round(share * a + (1 - share) * b) for a, b in zip(colour, ground, strict=True)
    )
    return red, green, blue


def link_shapes(corners: int) -> tuple[Points, Points]:
    """Superellipses: a link, and the head, over half length and half width, (corners, 2) each."""
    turn = np.linspace(0.0, 2 * np.pi, corners, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    link = np.sign(circle) * np.abs(circle) ** (0.45, 0.6)
    return link, np.where(circle[:, :1] > 0, circle * (1.35, 1.0), link)


LINK, HEAD_LINK = link_shapes(28)


def outlines(robot: Robot, posture: Posture) -> Points:
    """Outlines of the links in the global frame, m, (links, corners, 2)."""
    shapes = np.repeat(LINK[np.newaxis], robot.links, axis=0)
    shapes[-1] = HEAD_LINK
    shapes = shapes * (0.97 * robot.half_length, robot.half_width)
    along = np.stack([np.cos(posture.angles), np.sin(posture.angles)], axis=1)[:, np.newaxis]
    left = along[..., ::-1] * (-1, 1)
    turned = shapes[..., :1] * along + shapes[..., 1:] * left
    return np.asarray(posture.centres[:, np.newaxis] + turned)
