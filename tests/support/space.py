"""Robots in space as they truly are, and put where a test wants them."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from support import spatial_oracle as oracle

from usm_gym import SpatialPath, SpatialRobot, SpatialScenario
from usm_gym.plant.spatial.layout import CLOCK
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import SPATIAL_PRESETS
from usm_gym.task.spatial_scenario import NO_SCAN

Array = NDArray[np.float64]

STATE = (
    *("position", "velocity", "attitude", "angular_velocity"),
    *("joint_angles", "joint_rates"),
)
# Nothing is asked of the robot, and everything is known and does what it should.
REST = SpatialScenario(
    path=SpatialPath(speed=0.0, sway=0.0, heave=0.0),
    scan=NO_SCAN,
    conditions=SPATIAL_PRESETS["ideal"],
    settle_time=0.0,
)


def at_rest(**changes: Any) -> Simulation:
    """Return a robot of which nothing is asked, with some fields of its scenario changed."""
    return Simulation([replace(REST, **changes)])


def state_of(simulation: Simulation, index: int = 0) -> dict[str, Array]:
    """Return the true state of a robot, by the names of its quantities."""
    return {name: simulation.read(name)[index] for name in STATE}


def place(
    simulation: Simulation, index: int = 0, time: float | None = None, **values: Any
) -> NDArray[np.float32]:
    """Put a robot into a state, at a time of its path; returns what it then observes."""
    block, lane = divmod(index, simulation._lanes)
    row = simulation._rows[block, :, lane]
    for name, value in values.items():
        row[simulation.world.quantities[name]] = value
    if time is not None:
        row[CLOCK] = time / simulation.scenarios[index].conditions.physics_step
    table, lanes = simulation.layout.kernel_table, simulation._lanes
    simulation.world.kernels.observe(simulation.fleet, simulation.shared, table, index, lanes)
    return simulation.observation[index].copy()


def links_of(robot: SpatialRobot, state: dict[str, Array]) -> oracle.Links:
    """Return where the links are and how they move."""
    return oracle.links(
        robot,
        state["attitude"],
        state["angular_velocity"],
        state["velocity"],
        state["joint_angles"],
        state["joint_rates"],
        state["position"],
    )


def mass_motion(robot: SpatialRobot, state: dict[str, Array]) -> tuple[Array, Array]:
    """Return position, m, and velocity, m/s, of the centre of mass, (3,) each."""
    body = links_of(robot, state)
    down = body.rotation @ np.array([0.0, 0.0, -1.0]) * robot.keels[:, None]
    shares = robot.masses / robot.total_mass
    return shares @ (body.centre + down), shares @ (body.velocity + np.cross(body.omega, down))


def wrench_of(robot: SpatialRobot, state: dict[str, Array], forces: Array) -> Array:
    """Return what thrusters do, (6,).

    These are the forces along x, y, z, N, and the moments about y, z, x of the middle link through
    the centre of mass, N m.
    """
    body, middle = links_of(robot, state), len(robot.links) // 2
    centre, _ = mass_motion(robot, state)
    pushes = oracle.thrust(robot, forces)
    force = np.einsum("kij,kj->ki", body.rotation, pushes[:, :3])
    moment = np.einsum("kij,kj->ki", body.rotation, pushes[:, 3:])
    moment += np.cross(body.centre - centre, force)
    x, y, z = body.rotation[middle].T @ moment.sum(axis=0)
    return np.array([*force.sum(axis=0), y, z, x])


def random_state(robot: SpatialRobot, rng: np.random.Generator, bend: float = 1.0) -> Any:
    """Draw a state of any attitude, whose joints are bent by `bend` rad at most, not a place."""
    joints, attitude = len(robot.joint_axes), rng.normal(size=4)
    return {
        "position": np.zeros(3),
        "velocity": rng.normal(0.0, 0.3, 3),
        "attitude": attitude / np.linalg.norm(attitude),
        "angular_velocity": rng.normal(0.0, 0.3, 3),
        "joint_angles": rng.uniform(-bend, bend, joints),
        "joint_rates": rng.normal(0.0, 0.5, joints),
    }
