"""The forward dynamics of a robot as one function of plain arrays."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.kernels.lanes import padded
from usm_gym.packing import body_row, plant_of
from usm_gym.plant import layout
from usm_gym.plant.chain import accelerate_all
from usm_gym.plant.plant import Plant
from usm_gym.robot import Drag, Hydrodynamics, Robot
from usm_gym.support.validation import UsageError, brief, real_array, require

Array = NDArray[np.float64]

HYDRODYNAMICS: tuple[Hydrodynamics, ...] = get_args(Hydrodynamics)
DRAG: tuple[Drag, ...] = get_args(Drag)
# States that are worked on at a time; the kernel needs some 3 kB per state.
CHUNK = 1024


def accelerations(
    robot: Robot,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    p_dot: ArrayLike,
    joint_torques: ArrayLike,
    thruster_forces: ArrayLike,
    current: ArrayLike = (0.0, 0.0),
    hydrodynamics: Hydrodynamics = "consistent",
    drag: Drag = "linear and quadratic",
) -> tuple[Array, Array]:
    """Compute the accelerations of a robot in given states (docs/model.md, equation 10).

    Any argument may have axes in front of its last one. They are broadcast against each other as
    NumPy does it, so that an argument without them is shared by all states. Each state gives the
    same bits as it would alone.

    Args:
        robot: The robot; its own joint gains play no part here.
        theta: Link angles, rad, shape (..., n), link 1 = tail first.
        theta_dot: Link rates, rad/s, shape (..., n).
        p_dot: Velocity of the centre of mass in the global frame, m/s, shape (..., 2).
        joint_torques: Torque of joint i on link i (and its opposite on link i + 1), N m, shape
            (..., n-1).
        thruster_forces: Forces of the thrusters in layout order, N, shape (..., thrusters).
        current: Velocity of the water in the global frame, constant, m/s, shape (..., 2).
        hydrodynamics: "consistent" (Kirchhoff's added mass) or "kelasidi2014" (as published).
        drag: "linear and quadratic" (as published) or "quadratic" (without the linear terms).

    Returns:
        Angular accelerations, rad/s^2, shape (..., n), and the acceleration of the centre of mass
        in the global frame, m/s^2, shape (..., 2).

    Raises:
        ValueError: If a shape is wrong, shapes do not broadcast, a value is not finite or a form
            is unknown.
    """
    n = robot.links
    allowed = " or ".join(map(repr, HYDRODYNAMICS))
    require(hydrodynamics in HYDRODYNAMICS, "hydrodynamics", hydrodynamics, allowed)
    require(drag in DRAG, "drag", drag, " or ".join(map(repr, DRAG)))
    given = {
        "theta": vectors("theta", theta, n),
        "theta_dot": vectors("theta_dot", theta_dot, n),
        "p_dot": vectors("p_dot", p_dot, 2),
        "joint_torques": vectors("joint_torques", joint_torques, n - 1),
        "thruster_forces": vectors("thruster_forces", thruster_forces, len(robot.thrusters)),
        "current": vectors("current", current, 2),
    }
    batch, states = broadcast(given)
    plant = plant_of(robot, 0.0, hydrodynamics=hydrodynamics, drag=drag)
    size = len(states[0])
    theta_ddot, p_ddot = np.empty((size, n)), np.empty((size, 2))
    for first in range(0, size, CHUNK):
        part = slice(first, first + CHUNK)
        blocks = _blocks(robot, plant, *(state[part] for state in states))
        accelerate_all(blocks, n, plant)
        alpha = layout.row_of(layout.ALPHA, n)
        theta_ddot[part] = blocks[:, alpha : alpha + n]
        p_ddot[part] = blocks[:, layout.A_X : layout.A_Y + 1]
    return theta_ddot.reshape(*batch, n), p_ddot.reshape(*batch, 2)


def _blocks(
    robot: Robot,
    plant: Plant,
    theta: Array,
    theta_dot: Array,
    p_dot: Array,
    joint_torques: Array,
    thruster_forces: Array,
    current: Array,
) -> Array:
    n, size = robot.links, len(theta)
    blocks = np.tile(body_row(robot, plant), (size, 1))
    quantities = (size, layout.QUANTITIES, padded(n))
    of_links = blocks[:, layout.HEADER : layout.row_of(layout.QUANTITIES, n)]
    links = of_links.reshape(quantities)[:, :, :n]
    links[:, layout.THETA] = theta
    links[:, layout.OMEGA] = theta_dot
    links[:, layout.TORQUE, :-1] = joint_torques
    for j, thruster in enumerate(robot.thrusters):
        push = layout.PUSH_N if thruster.direction == "normal" else layout.PUSH_T
        links[:, push, thruster.link - 1] += thruster_forces[:, j]
    blocks[:, layout.V_X : layout.V_Y + 1] = p_dot
    blocks[:, layout.WATER_X : layout.WATER_Y + 1] = current
    return blocks


def vectors(name: str, value: Any, size: int) -> Array:
    """An argument of vectors, (..., size).

    Raises:
        ValueError: If it has another shape, or a value is not finite.
    """
    array = real_array(name, value)
    allowed = f"an array of shape ({size},) or (..., {size})"
    require(array.ndim >= 1 and array.shape[-1] == size, name, value, allowed)
    require(np.isfinite(array).all(), name, value, "finite numbers")
    return np.asarray(array, np.float64)


def broadcast(given: dict[str, Array]) -> tuple[tuple[int, ...], list[Array]]:
    """The shape of the batch, and the arguments for all of it, (size, ...)."""
    shapes = {name: array.shape[:-1] for name, array in given.items()}
    if not any(shapes.values()):
        return (), [array[np.newaxis] for array in given.values()]
    try:
        batch = np.broadcast_shapes(*shapes.values())
    except ValueError:
        leading = {name: shape for name, shape in shapes.items() if shape}
        allowed = "shapes that NumPy broadcasts"
        raise UsageError(f"the leading axes are {brief(leading)}; allowed: {allowed}") from None
    whole = [np.broadcast_to(array, (*batch, array.shape[-1])) for array in given.values()]
    return batch, [array.reshape(-1, array.shape[-1]) for array in whole]
