"""A robot and what it is run with, as the numbers that the plant's kernels take."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.plant import layout as rows
from usm_gym.plant.plant import Plant
from usm_gym.plant.references import NEVER, filter_coefficients
from usm_gym.plant.steering import UNSTEERED, Steering
from usm_gym.plant.thrusters import lag_shares
from usm_gym.robot import Drag, Hydrodynamics, Robot


def plant_of(
    robot: Robot,
    step: float,
    *,
    substeps: int = 1,
    euler: bool = False,
    hydrodynamics: Hydrodynamics = "consistent",
    drag: Drag = "linear and quadratic",
    shifts: int = 0,
    sinusoids: int = 0,
    steering: Steering = UNSTEERED,
) -> Plant:
    """What all copies of a robot share.

    Args:
        robot: The robot.
        step: Physics step, s.
        substeps: Physics steps in a control period.
        euler: Whether to take forces at the beginning of a step, by Euler's forward method, rather
            than in its middle.
        hydrodynamics: Form of the added mass.
        drag: Terms of the drag.
        shifts: Largest number of changes of the joint references in any episode.
        sinusoids: Largest number of sinusoids in the water's velocity in any episode.
        steering: How a policy steers the joints, if it does.
    """
    return Plant(
        l=robot.half_length,
        m=robot.link_mass,
        J=robot.link_inertia,
        lead=0.0 if euler else 0.5 * step,
        kirchhoff=float(hydrodynamics == "consistent"),
        linear_drag=float(drag == "linear and quadratic"),
        links=robot.links,
        thruster_links=robot.thruster_links,
        thruster_is_normal=robot.thruster_is_normal,
        h=step,
        substeps=substeps,
        shifts=shifts,
        sinusoids=sinusoids,
        **steering._asdict(),
    )


def body_row(
    robot: Robot,
    plant: Plant,
    *,
    coefficients: ArrayLike = 1.0,
    joint_gains: tuple[float, float] | None = None,
    filter_frequency: float = 0.0,
    time_constant: float = 0.0,
    dead_band: float = 0.0,
    link_factors: ArrayLike = 1.0,
    thruster_gains: ArrayLike = 1.0,
) -> NDArray[np.float64]:
    """The rows of a robot at rest in still water, straight, nothing being asked of its joints.

    Args:
        robot: The robot.
        plant: What `plant_of` made of it.
        coefficients: True over nominal hydrodynamic coefficients, (6,).
        joint_gains: Stiffness and damping of the joints other than the robot's, N m/rad, N m s/rad.
        filter_frequency: Natural frequency of the joint references' filter, rad/s; 0 for none.
        time_constant: First-order lag of the thrusters, s.
        dead_band: Smallest force that the thrusters make, N.
        link_factors: Coefficients of each link over those common to all, (links,).
        thruster_gains: Force of each thruster over its command, (thrusters,).
    """
    links, thrusters = robot.links, len(robot.thrusters)
    row = np.zeros(rows.body_rows(links, thrusters))
    row[rows.C_T : rows.LAMBDA_3 + 1] = np.multiply(robot.hydrodynamic_coefficients, coefficients)
    k_p, k_d = joint_gains or (robot.joint_stiffness, robot.joint_damping)
    row[rows.STIFFNESS], row[rows.DAMPING] = k_p, k_d
    row[rows.JOINT_INERTIA] = 2.0 * plant.lead * (k_d + plant.lead * k_p)
    side = rows.row_of(rows.SIDE, links)
    row[side : side + links] = rows.sides(links)
    row[rows.FILTER_DD : rows.FILTER_DAMPING + 1] = filter_coefficients(filter_frequency, plant.h)
    row[rows.SHIFT_STEP : rows.SHIFT_SIZE] = NEVER
    factor = rows.row_of(rows.FACTOR, links)
    row[factor : factor + links] = link_factors
    row[rows.LAG], row[rows.MEAN_LAG] = lag_shares(time_constant, plant.h)
    row[rows.DEAD_BAND] = dead_band
    gain = rows.thruster_row(rows.GAIN, links, thrusters)
    row[gain : gain + thrusters] = thruster_gains
    return row
