"""Scenarios of the head by name, and drawn at random."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usm_gym.robots import EELY, PAPER, AnyRobot, robot_of, spatial_robot_of
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.support.validation import require
from usm_gym.task.conditions import FIELD, SPATIAL_PRESETS, Conditions
from usm_gym.task.head_path import CHANNELS, HeadPath
from usm_gym.task.head_scenario import (
    HEAD_MODES,
    SPATIAL_HEAD_MODES,
    HeadMode,
    HeadScenario,
    SpatialHeadMode,
    SpatialHeadScenario,
)
from usm_gym.task.sampling import SCAN_DURATION, SCAN_SETTLE_TIME
from usm_gym.task.scenario import require_mode

AnyHeadMode = HeadMode | SpatialHeadMode
AnyHeadScenario = HeadScenario | SpatialHeadScenario

# How far the links of the bent planar body are turned from its line, rad; by how much the joints of
# the spatial one are bent to the side and up, rad.
PLANAR_BEND, SIDEWAYS, UPWARDS = 1.1, 0.7, 0.4
# A path that is drawn takes no more than this share of the limits of rates and angles, and leaves
# no more error to the head than this, m.
SHARE, MISS = 0.8, 0.002
# The centre of a figure from where the head starts, along each axis, m; the direction of the head
# in the plane, and by how much it turns to and fro, rad.
AROUND, DIRECTIONS, TURNS = (-0.12, 0.04), (-0.3, 0.3), (0.0, 0.3)
CIRCLE, LINE, SCAN, POINT = range(4)
# So often a path is drawn that might be one for the robot.
TRIES = 1000


def posture_of(robot: AnyRobot) -> NDArray[np.float64]:
    """Joint angles of a body that is bent like an S, so that its head can be moved ahead, too."""
    if isinstance(robot, SpatialRobot):
        return _spatial_posture(robot)
    along = (np.arange(robot.links) + 0.5) / robot.links
    return -np.diff(PLANAR_BEND * np.sin(2.0 * np.pi * along))


def _spatial_posture(robot: SpatialRobot) -> NDArray[np.float64]:
    """Joints about z and about y bend to and fro, from the middle of the body to either end."""
    angles, root = np.zeros(len(robot.joint_axes)), len(robot.links) // 2
    for half in (range(root, len(angles)), range(root - 1, -1, -1)):
        sides = {1: -UPWARDS, 2: SIDEWAYS}
        for joint in half:
            axis = int(np.argmax(np.abs(robot.joint_axes[joint])))
            if axis in sides:
                angles[joint] = sides[axis]
                sides[axis] = -sides[axis]
    return angles


def _figure(
    axes: int, stream: np.random.Generator
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Draw a circle, a line, a scan along a wall, or a point, for a head a metre ahead.

    Returns:
        Amplitudes, m, as complex numbers that have the phase, too, and frequencies, rad/s, (axes,).
    """
    kind, radius, period = stream.integers(4), stream.uniform(0.08, 0.2), stream.uniform(12.0, 25.0)
    depth, faster = stream.uniform(0.02, 0.05), stream.uniform(2.0, 3.0)
    along, across = np.linalg.qr(stream.standard_normal((axes, 2)))[0].T
    frequencies, amplitudes = np.full(axes, 2.0 * np.pi / period), np.zeros(axes, complex)
    if kind == CIRCLE:
        amplitudes += radius * (along + 1j * across)
    elif kind == LINE:
        amplitudes += radius * along
    elif kind == SCAN:
        # The wall is ahead: to and fro along it, and a little nearer and further meanwhile.
        amplitudes += radius
        amplitudes[0], frequencies[0] = depth, faster * frequencies[0]
        frequencies[1] /= 2.0
    return amplitudes * np.exp(2j * np.pi * stream.random()), frequencies


def sample_head(
    mode: AnyHeadMode,
    conditions: Conditions,
    stream: np.random.Generator,
    robot: str | AnyRobot | None = None,
) -> AnyHeadScenario:
    """Draw a scenario of the head.

    Args:
        mode: "head" or "head3d".
        conditions: Conditions, whose ranges are used.
        stream: Where all randomness comes from.
        robot: The robot, or its name; None: the paper's, in space Eely.

    Raises:
        ValueError: If there is no such mode, or the joints of the robot cannot follow.
    """
    nominal = nominal_head(mode, conditions, robot)
    for _ in range(TRIES):
        path = _draw_path(nominal, stream)
        if _comfortable(dataclasses.replace(nominal, path=path)):
            break
    else:
        require(False, "robot", nominal.robot, "one whose joints can lead its head along figures")
    noise_seed = int(stream.integers(2**63))
    drawn: AnyHeadScenario = dataclasses.replace(nominal, path=path, noise_seed=noise_seed)
    return drawn.under(conditions)


def _comfortable(scenario: AnyHeadScenario) -> bool:
    """Whether the joints can follow a path, and have something left of their limits."""
    demand, robot = scenario.demand, scenario.body
    slow = demand.rate <= SHARE * robot.joint_rate_limit
    return slow and demand.error <= MISS and demand.angle <= SHARE * robot.joint_angle_limit


def _size(scenario: AnyHeadScenario) -> float:
    """Size of the figures of a robot: its head's distance from its centre of mass, in metres."""
    start = scenario.start if scenario.mode in SPATIAL_HEAD_MODES else scenario.start[:2]
    return float(np.linalg.norm(start))


def _draw_path(nominal: AnyHeadScenario, stream: np.random.Generator) -> HeadPath:
    """Draw a path, which may go beyond the reach of the head."""
    start, size = nominal.start, _size(nominal)
    axes = 2 if nominal.mode in HEAD_MODES else 3
    centre, amplitudes, frequencies, phases = np.zeros((4, CHANNELS))
    figure, frequencies[:axes] = _figure(axes, stream)
    amplitudes[:axes], phases[:axes] = size * np.abs(figure), np.angle(figure)
    away = stream.uniform(*AROUND, CHANNELS)
    centre[:axes] = start[:axes] + size * away[:axes]
    if axes < CHANNELS:
        centre[axes] = stream.uniform(*DIRECTIONS)
        amplitudes[axes], phases[axes] = stream.uniform(*TURNS), stream.uniform(0.0, 2.0 * np.pi)
        frequencies[axes] = frequencies[1]
    return _path(centre, amplitudes, frequencies, phases)


def nominal_head(
    mode: AnyHeadMode,
    conditions: Conditions | None = None,
    robot: str | AnyRobot | None = None,
) -> AnyHeadScenario:
    """The nominal scenario of the head: a circle across the body, in 20 s.

    Raises:
        ValueError: If there is no such mode.
    """
    require_mode(mode, (*HEAD_MODES, *SPATIAL_HEAD_MODES))
    planar = mode in HEAD_MODES
    kind: Any = HeadScenario if planar else SpatialHeadScenario
    known: dict[str, Any] = {"conditions": conditions or FIELD, "robot": robot or PAPER}
    if not planar:
        known = {"conditions": conditions or SPATIAL_PRESETS["field"], "robot": robot or EELY}
    body: Any = robot_of(known["robot"]) if planar else spatial_robot_of(known["robot"])
    known["posture"] = tuple(posture_of(body).tolist())
    if known["conditions"].shift_gap_range is not None:
        known |= {"duration": SCAN_DURATION, "settle_time": SCAN_SETTLE_TIME}
    still: AnyHeadScenario = kind(path=HeadPath(centre=(0.0, 0.0, 0.0)), **known)
    size = 0.1 * _size(still)
    turning = 2.0 * np.pi / 20.0
    first, last = (0, 1) if planar else (1, 2)
    amplitudes, frequencies, phases = np.zeros((3, CHANNELS))
    amplitudes[[first, last]], frequencies[[first, last]] = size, turning
    phases[last] = np.pi / 2.0
    centre = still.start - [size, 0.0, 0.0]
    if planar:
        centre[2] = 0.0
    path = _path(centre, amplitudes, frequencies, phases)
    return dataclasses.replace(still, path=path)


def _path(*quantities: NDArray[np.float64]) -> HeadPath:
    numbers: Any = (tuple(values.tolist()) for values in quantities)
    return HeadPath(*numbers)
