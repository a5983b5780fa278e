"""The forward dynamics of a robot as one function of plain arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.plant import layout
from usm_gym.plant.chain import Body, accelerate_one
from usm_gym.robot import Hydrodynamics, Robot
from usm_gym.validation import require

HYDRODYNAMICS: tuple[Hydrodynamics, ...] = get_args(Hydrodynamics)


def accelerations(
    robot: Robot,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    p_dot: ArrayLike,
    joint_torques: ArrayLike,
    thruster_forces: ArrayLike,
    current: Sequence[float] = (0.0, 0.0),
    hydrodynamics: Hydrodynamics = "consistent",
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute the accelerations of a robot in a given state (docs/model.md, equation 10).

    Args:
        robot: The robot; its own joint gains play no part here.
        theta: Link angles, rad, shape (n,), link 1 = tail first.
        theta_dot: Link rates, rad/s, shape (n,).
        p_dot: Velocity of the centre of mass in the global frame, m/s, shape (2,).
        joint_torques: Torque of joint i on link i (and its opposite on link i + 1), N m, (n-1,).
        thruster_forces: Forces of the thrusters in layout order, N.
        current: Velocity of the water in the global frame, constant, m/s.
        hydrodynamics: "consistent" (Kirchhoff's added mass) or "kelasidi2014" (as published).

    Returns:
        Angular accelerations, rad/s^2, shape (n,), and the acceleration of the centre of mass in
        the global frame, m/s^2, shape (2,).

    Raises:
        ValueError: If a shape is wrong, a value is not finite or the form is unknown.
    """
    n = robot.links
    require(
        hydrodynamics in HYDRODYNAMICS,
        "hydrodynamics",
        hydrodynamics,
        " or ".join(map(repr, HYDRODYNAMICS)),
    )
    block = np.zeros(layout.rows(n, 0))
    links = block[layout.HEADER :].reshape(layout.QUANTITIES, layout.padded(n))[:, :n]
    links[layout.THETA] = _vector("theta", theta, n)
    links[layout.OMEGA] = _vector("theta_dot", theta_dot, n)
    links[layout.SIDE] = layout.sides(n)
    links[layout.TORQUE, :-1] = _vector("joint_torques", joint_torques, n - 1)
    forces = _vector("thruster_forces", thruster_forces, len(robot.thrusters))
    normal = robot.thruster_is_normal
    np.add.at(links[layout.PUSH_T], robot.thruster_links[~normal], forces[~normal])
    np.add.at(links[layout.PUSH_N], robot.thruster_links[normal], forces[normal])
    block[layout.V_X : layout.V_Y + 1] = _vector("p_dot", p_dot, 2)
    block[layout.WATER_X : layout.WATER_Y + 1] = _vector("current", current, 2)
    block[layout.C_T : layout.LAMBDA_3 + 1] = robot.hydrodynamic_coefficients
    body = Body(
        l=robot.half_length,
        m=robot.link_mass,
        J=robot.link_inertia,
        implicit=0.0,
        kirchhoff=float(hydrodynamics == "consistent"),
    )
    accelerate_one(block[np.newaxis], n, body)
    return links[layout.ALPHA].copy(), block[layout.A_X : layout.A_Y + 1].copy()


def _vector(name: str, value: Any, size: int) -> NDArray[np.float64]:
    array = np.asarray(value, dtype=np.float64)
    require(array.shape == (size,), name, value, f"an array of shape ({size},)")
    require(np.isfinite(array).all(), name, value, "finite numbers")
    return array
