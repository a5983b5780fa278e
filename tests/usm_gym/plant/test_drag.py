"""Drag with and without its linear terms."""

from dataclasses import replace

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from support import oracle
from support.swimming import random_state, relative_difference, swim, swimmer

import usm_gym
from usm_gym import Robot, Scenario
from usm_gym.plant.chain import damping, fluid_force
from usm_gym.robot import Drag
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS
from usm_gym.task.scenario import STILL

Array = NDArray[np.float64]

IDEAL = PRESETS["ideal"]
DRAG: tuple[Drag, ...] = ("linear and quadratic", "quadratic")


@pytest.mark.parametrize("hydrodynamics", ["consistent", "kelasidi2014"])
@pytest.mark.parametrize("links", [2, 3, 10, 16])
def test_quadratic_drag_agrees_with_the_dense_oracle(links: int, hydrodynamics: str) -> None:
    robot = swimmer(links)
    rng = np.random.default_rng(links)
    for _ in range(100):
        state = random_state(robot, rng)
        forms = {"hydrodynamics": hydrodynamics, "drag": "quadratic"}
        actual = usm_gym.accelerations(robot, *state, **forms)  # type: ignore[arg-type]
        expected = oracle.accelerations(robot, *state, **forms)  # type: ignore[arg-type]
        assert relative_difference(actual, expected) < 1e-11


@pytest.mark.parametrize("links", [2, 16])
def test_quadratic_drag_takes_energy_at_every_moment(links: int) -> None:
    robot = swimmer(links)
    state = random_state(robot, np.random.default_rng(links)).coasting()
    still = state._replace(current=np.zeros(2))
    motion = swim(robot, still, 5.0, drag="quadratic")
    moments = zip(motion.theta, motion.theta_dot, motion.p_dot, strict=True)
    energy = np.array([oracle.energy(robot, *moment) for moment in moments])
    assert np.all(np.diff(energy) < 0.0)
    assert energy[-1] < 0.5 * energy[0]


@pytest.mark.parametrize("axis", [0, 1])
def test_a_straight_body_feels_the_quadratic_formula(axis: int) -> None:
    # Along itself (axis 0) or across (axis 1), the water coming towards it at u.
    robot, u = Robot(), 0.05
    current = np.zeros(2)
    current[axis] = -u
    still = np.zeros((3, 16))
    theta_ddot, p_ddot = usm_gym.accelerations(
        robot, *still[:2], np.zeros(2), still[2, 1:], np.zeros(5), current, drag="quadratic"
    )
    coefficient = (robot.tangential_drag, robot.normal_drag)[axis]
    mass = robot.link_mass + (0.0, robot.added_mass)[axis]
    assert p_ddot[axis] == pytest.approx(-coefficient * u**2 / mass)
    np.testing.assert_allclose(theta_ddot, 0.0, atol=1e-12)


@pytest.mark.parametrize("drag", DRAG)
def test_a_gliding_body_slows_down_as_its_drag_says(drag: Drag) -> None:
    # m v' = -c (v + v^2), or m v' = -c v^2, along the body; both have a closed solution.
    robot, start, duration = Robot(), 0.3, 4.0
    conditions = replace(IDEAL, drag=drag)
    simulation = Simulation([Scenario(conditions=conditions, inspection=STILL, duration=duration)])
    velocity = simulation.world.quantities["velocity"]
    simulation.fleet.blocks[0][velocity] = start, 0.0
    for _ in range(simulation.scenarios[0].steps):
        simulation.step(np.zeros((1, 5), np.float32))
    x = duration * robot.tangential_drag / robot.link_mass
    expected = {
        "linear and quadratic": start / (np.exp(x) * (1.0 + start) - start),
        "quadratic": start / (1.0 + x * start),
    }
    assert simulation.read("velocity")[0, 0] == pytest.approx(expected[drag], rel=1e-6)


@numba.njit
def force_and_slope(velocities, coefficients, linear):
    """Force, then slope, along, across and in yaw, where the water has no inertia."""
    v_t, v_n, omega = velocities
    force = fluid_force(v_t, v_n, omega, 0.0, coefficients, 1.0, linear)
    return force, damping(v_t, v_n, omega, coefficients, linear)


@pytest.mark.parametrize("linear", [0.0, 1.0])
def test_the_slope_that_a_step_takes_is_that_of_the_drag(linear: float) -> None:
    without_inertia = (0.3, 8.0, 0.0, 0.0, 0.2, 0.1)
    for velocities in np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3)):
        for k, step in enumerate(1e-6 * np.eye(3)):
            ends = [
                force_and_slope(tuple(velocities + side * step), without_inertia, linear)[0][k]
                for side in (-1.0, 1.0)
            ]
            slope = force_and_slope(tuple(velocities), without_inertia, linear)[1][k]
            assert slope == pytest.approx((ends[0] - ends[1]) / 2e-6, rel=1e-5)


def test_robots_of_different_drag_do_not_swim_side_by_side() -> None:
    pair = [Scenario(conditions=replace(IDEAL, drag=drag)) for drag in DRAG]
    with pytest.raises(ValueError, match="drag"):
        Simulation(pair)
