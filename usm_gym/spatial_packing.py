"""A spatial robot and what it is run with, as the numbers that the plant's kernels take."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.kernels.lanes import padded
from usm_gym.plant.references import NEVER, filter_coefficients
from usm_gym.plant.spatial import layout as rows
from usm_gym.plant.spatial.links import SpatialPlant
from usm_gym.plant.steering import UNSTEERED, Steering
from usm_gym.plant.thrusters import lag_shares
from usm_gym.spatial_robot import LINEAR_SHARE, SpatialRobot, Vector, Y, Z

Array = NDArray[np.float64]


def spatial_plant(
    robot: SpatialRobot,
    step: float,
    *,
    substeps: int = 1,
    euler: bool = False,
    shifts: int = 0,
    sinusoids: int = 0,
    steering: Steering = UNSTEERED,
) -> SpatialPlant:
    """What all copies of a robot share.

    Args:
        robot: The robot.
        step: Physics step, s.
        substeps: Physics steps in a control period.
        euler: Whether to take forces at the beginning of a step, by Euler's forward method, rather
            than in its middle.
        shifts: Largest number of changes of the joint references in any episode.
        sinusoids: Largest number of sinusoids in the water's velocity in any episode.
        steering: How a policy steers the joints, if it does.
    """
    return _at_rest(robot)._replace(
        lead=0.0 if euler else 0.5 * step,
        h=step,
        substeps=substeps,
        shifts=shifts,
        sinusoids=sinusoids,
        **steering._asdict(),
    )


def spatial_row(
    robot: SpatialRobot,
    plant: SpatialPlant,
    *,
    coefficients: ArrayLike = 1.0,
    filter_frequency: float = 0.0,
    time_constant: float = 0.0,
    dead_band: float = 0.0,
    link_factors: ArrayLike = 1.0,
    thruster_gains: ArrayLike = 1.0,
) -> Array:
    """The rows of a robot at rest in still water, straight along x, nothing asked of its joints.

    Args:
        robot: The robot.
        plant: What `spatial_plant` made of it.
        coefficients: True over nominal hydrodynamic coefficients, (6,).
        filter_frequency: Natural frequency of the joint references' filter, rad/s; 0 for none.
        time_constant: First-order lag of the thrusters, s.
        dead_band: Smallest force that the thrusters make, N.
        link_factors: Coefficients of each link over those common to all, (links,).
        thruster_gains: Force of each thruster over its command, (thrusters,).
    """
    links, thrusters = len(robot.links), len(robot.thrusters)
    row = np.zeros(rows.body_rows(links, thrusters))
    row[rows.Q] = 1.0
    known = np.multiply(robot.hydrodynamic_coefficients, coefficients)
    row[rows.ADDED_ALONG : rows.CROSS_FLOW + 1] = known
    k_p, k_d = robot.joint_stiffness, robot.joint_damping
    row[rows.STIFFNESS], row[rows.DAMPING] = k_p, k_d
    row[rows.JOINT_INERTIA] = 2.0 * plant.lead * (k_d + plant.lead * k_p)
    row[rows.FILTER : rows.FILTER + 6] = filter_coefficients(filter_frequency, plant.h)
    row[rows.SHIFT_STEP : rows.PAN_SHIFT] = NEVER
    factor = rows.row_of(rows.FACTOR, links)
    row[factor : factor + links] = link_factors
    row[rows.LAG], row[rows.MEAN_LAG] = lag_shares(time_constant, plant.h)
    row[rows.DEAD_BAND] = dead_band
    gain = rows.thruster_row(rows.GAIN, links, thrusters)
    row[gain : gain + thrusters] = thruster_gains
    return row


@lru_cache
def _at_rest(robot: SpatialRobot) -> SpatialPlant:
    """What all copies of a robot share, whatever the step."""
    places, shares = _thruster_entries(robot)
    return SpatialPlant(
        links=len(robot.links),
        root=len(robot.links) // 2,
        constants=_constants(robot),
        kinds=np.array([_kind(axis) for axis in robot.joint_axes], np.int64),
        axes=np.array(robot.joint_axes),
        frames=np.array([_frame(axis).ravel() for axis in robot.joint_axes]),
        thrusters=len(robot.thrusters),
        thruster_places=places,
        thruster_shares=shares,
        gravity=robot.gravity,
        lead=0.0,
        h=0.0,
        substeps=1,
        shifts=0,
        sinusoids=0,
        **UNSTEERED._asdict(),
    )


def _constants(robot: SpatialRobot) -> Array:
    links, root = len(robot.links), len(robot.links) // 2
    lengths, radii, masses, keels = robot.lengths, robot.radii, robot.masses, robot.keels
    displaced, density = robot.displaced_masses, robot.water_density
    across = masses * (lengths**2 / 12 + radii**2 / 4)
    strip = density * radii
    quantities = {
        rows.HALF: lengths / 2,
        rows.REACH: np.sign(root - np.arange(links)) * lengths / 2,
        rows.MASS: masses,
        rows.EXCESS: masses - displaced,
        rows.FIRST_MOMENT: -masses * keels,
        rows.INERTIA_X: masses * (radii**2 / 2 + keels**2),
        rows.INERTIA_Y: across + masses * keels**2,
        rows.INERTIA_Z: across,
        rows.ADDED_MASS: displaced,
        rows.ADDED_INERTIA: displaced * lengths**2 / 12,
        rows.STRIP: strip * lengths,
        rows.SURGE_AREA: density * math.pi * radii**2 / 2,
        rows.ROLL_VOLUME: density * math.pi * radii**4 * lengths / 2,
        rows.LINEAR_X: LINEAR_SHARE * strip * lengths,
        rows.LINEAR_ROLL: LINEAR_SHARE * strip * lengths * radii**2,
        # That of the joint to the next link.
        rows.SIDE: np.where(np.arange(links) < root, -1.0, 1.0),
    }
    constants = np.zeros((rows.CONSTANTS, padded(links)))
    for quantity, values in quantities.items():
        constants[quantity, :links] = values
    return constants


def _kind(axis: Vector) -> int:
    return rows.ALONG_Z if axis == Z else rows.ALONG_Y if axis == Y else rows.ANYWHERE


def _frame(axis: Vector) -> Array:
    """Three axes, one per row, of which the third is given."""
    third = np.array(axis) / np.linalg.norm(axis)
    other = np.eye(3)[np.argmin(np.abs(third))]
    first = np.cross(other, third)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(third, first), third])


def _thruster_entries(robot: SpatialRobot) -> tuple[NDArray[np.int64], Array]:
    """Which numbers of the links the thrusters push with, and with which share of their force."""
    places, shares, links = [], [], len(robot.links)
    for j, thruster in enumerate(robot.thrusters):
        arm = np.array(thruster.position)
        arm[0] -= robot.links[thruster.link - 1].length / 2
        wrench = [*thruster.direction, *np.cross(arm, thruster.direction)]
        for k, share in enumerate(wrench):
            if share != 0.0:
                places.append((j, rows.row_of(rows.PUSH + k, links) + thruster.link - 1))
                shares.append(share)
    return np.array(places, np.int64), np.array(shares, np.float64)
