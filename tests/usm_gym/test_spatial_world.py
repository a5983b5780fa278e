"""The spatial robot in its water, as an episode has it: it floats, hangs, drifts, and is pushed."""

import re
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.space import REST, at_rest, mass_motion, place, state_of

from usm_gym import Scan, SpatialScenario, SpatialWater, SpatialWave
from usm_gym.envs.usm3d import USM3DEnv
from usm_gym.simulation import Simulation
from usm_gym.spatial_posture import roll_pitch_yaw, rotation_of
from usm_gym.spatial_robot import EELY
from usm_gym.task.conditions import SPATIAL_PRESETS

# Longer steps, for motion that is slow.
COARSE = replace(REST.conditions, physics_step=5e-3, control_period=0.1)


def drift(simulation: Simulation, seconds: float, action: Any = 0.0) -> Simulation:
    """Let a robot go, under a constant action."""
    given = np.full((simulation.size, 7), action, np.float32)
    for _ in range(round(seconds / simulation.scenarios[0].conditions.control_period)):
        simulation.step(given)
    return simulation


def roll_of(simulation: Simulation) -> float:
    rotation = rotation_of(simulation.read("attitude")[0])
    return float(roll_pitch_yaw(rotation)[0])


@pytest.mark.parametrize("robot", ["eely", "eely-neutral"])
def test_in_still_water_a_robot_keeps_its_place(robot: str) -> None:
    env = gym.make("USM-Operation3D-v0", conditions="ideal", robot=robot)
    asked = replace(REST, robot=robot, duration=10.0)
    env.reset(options={"scenario": asked})
    for _ in range(500):
        *_, truncated, info = env.step(np.zeros(7, np.float32))
    assert truncated
    for name, value in info.items():
        assert abs(value) < 1e-12, name


def test_a_neutral_robot_keeps_any_attitude_and_the_keel_rights_another() -> None:
    attitude = Rotation.from_euler("x", 1.0).as_quat(scalar_first=True)
    for robot, low, high in (("eely-neutral", 1.0 - 1e-9, 1.0 + 1e-9), ("eely", -0.1, 0.1)):
        simulation = at_rest(robot=robot, conditions=COARSE)
        place(simulation, attitude=attitude)
        rolls = [roll_of(drift(simulation, 0.2)) for _ in range(150)]
        assert all(low < roll < high for roll in rolls[-10:])
    # To the other side as well, and beyond it, like a pendulum.
    place(simulation, attitude=attitude * [1, -1, 1, 1], angular_velocity=np.zeros(3))
    rolls = [roll_of(drift(simulation, 0.2)) for _ in range(50)]
    assert min(rolls) < -0.5
    assert max(rolls) > 0.1


@pytest.mark.parametrize("velocity", [(0.0, 0.05, 0.0), (0.0, -0.04, 0.03), (0.05, 0.0, 0.0)])
def test_a_current_carries_the_robot(velocity: tuple[float, float, float]) -> None:
    carried = at_rest(water=SpatialWater(current=velocity), conditions=COARSE, robot="eely-neutral")
    speeds = [drift(carried, 5.0).read("velocity")[0] @ velocity for _ in range(50)]
    square, rounding = np.dot(velocity, velocity), 1e-8
    assert 0.0 < speeds[0] < 0.7 * square
    assert (np.diff(speeds) > -rounding).all()  # ever faster, never faster than the water
    assert 0.99 * square < speeds[-1] < square + rounding
    assert 0.7 * square * 250.0 < carried.error[0] @ velocity < square * 250.0


def test_a_robot_that_moves_with_the_water_feels_no_drag() -> None:
    velocity = np.array([0.04, -0.03, 0.02])
    simulation = at_rest(water=SpatialWater(current=tuple(velocity.tolist())), duration=60.0)
    place(simulation, velocity=velocity)
    drift(simulation, 20.0)
    np.testing.assert_allclose(simulation.read("velocity")[0], velocity, atol=1e-9)
    np.testing.assert_allclose(simulation.error[0], 20.0 * velocity, atol=1e-8)


def test_water_moves_as_its_sinusoids_add_up() -> None:
    waves = (
        SpatialWave((0.02, 0.0, 0.01), (0.0, 0.0, 1.5), 5.0),
        SpatialWave((0.0, 0.03, 0.0), (0.0, 1.0, 0.0), 7.0),
    )
    water = SpatialWater(
        current=(0.01, 0.02, -0.03),
        amplitude=(0.01, 0.0, 0.02),
        phase=(0.3, 0.0, 2.0),
        period=20.0,
        waves=waves,
    )
    simulation = at_rest(water=water)
    for k in range(1, 60):
        simulation.step(np.zeros((1, 7), np.float32))
        time = 0.02 * k
        parts = [(water.amplitude, water.phase, water.period)]
        parts += [(wave.amplitude, wave.phase, wave.period) for wave in waves]
        expected = np.array(water.current)
        for amplitude, phase, period in parts:
            expected += np.array(amplitude) * np.sin(2 * np.pi * time / period + np.array(phase))
        # The water of a step is that of its middle.
        np.testing.assert_allclose(simulation.read("water_velocity")[0], expected, atol=5e-5)


def test_every_thruster_pushes_where_the_documentation_says() -> None:
    table = re.findall(r"\| (\d) \| link (\d)[^|]*\| ([a-z ]+) \|", USM3DEnv.__doc__ or "")
    assert len(table) == len(EELY.thrusters)
    sides = {"ahead": 0, "to the left": 1, "up": 2}
    for index, link, side in table:
        assert EELY.thrusters[int(index)].link == int(link)
        push = np.zeros(7, np.float32)
        push[int(index)] = 0.05
        simulation = drift(at_rest(), 0.1, push)
        _, velocity = mass_motion(EELY, state_of(simulation))
        assert np.argmax(np.abs(velocity)) == sides[side]
        assert velocity[sides[side]] > 0.0


def test_thrusters_lag_and_have_gains_and_a_dead_band() -> None:
    gains = (1.2, 0.9, 1.0, 1.0, 1.0, 1.0, 1.0)
    conditions = replace(REST.conditions, thruster_time_constant=0.2, thruster_dead_band=0.5)
    simulation = at_rest(conditions=conditions, thruster_gains=gains)
    force = 200.0 * np.array([0.01, 0.01, 0.001, -0.02, 0.0, 0.0, 5.0])
    drift(simulation, 0.2, force / 200.0)
    command = np.minimum(force, 200.0)
    np.testing.assert_allclose(simulation.read("command")[0], command, rtol=1e-6)
    expected = np.where(np.abs(command) < 0.5, 0.0, command * gains) * (1.0 - np.exp(-1.0))
    np.testing.assert_allclose(simulation.read("force")[0], expected, rtol=1e-6, atol=1e-12)


def test_joints_follow_the_scan_and_the_head_looks_where_it_shall() -> None:
    scan = Scan(times=(0.5,), pans=(0.6,), tilts=(0.3,))
    simulation = drift(at_rest(scan=scan, robot="eely-neutral"), 6.0)
    angles = simulation.read("joint_angles")[0]
    asked = (simulation.read("pan_shares") * 0.6 + simulation.read("tilt_shares") * 0.3)[0]
    np.testing.assert_allclose(angles, asked, atol=0.01)
    still = drift(at_rest(scan=scan, conditions=replace(REST.conditions, motion=False)), 6.0)
    assert not still.read("joint_angles").any()


def test_other_coefficients_are_other_water() -> None:
    # More drag, more added mass: the same thrust comes less far.
    base: dict[str, Any] = {"robot": "eely-neutral"}
    push = np.array([0, 0, 0, 0.02, 0.02, 0, 0], np.float32)
    ahead = []
    for water in (
        SpatialWater(),
        SpatialWater(coefficients=(3.0, 1.0, 1.0, 1.0, 1.0, 1.0)),
        SpatialWater(coefficients=(1.0, 1.0, 5.0, 5.0, 1.0, 1.0)),
        SpatialWater(link_factors=(5.0,) * 9),
    ):
        simulation = drift(at_rest(water=water, **base), 10.0, push)
        ahead.append(simulation.error[0, 0])
    assert ahead[0] > max(ahead[1:3]) > min(ahead[1:3]) > ahead[3] > 0.0


@pytest.mark.parametrize("preset", ["field", "sea"])
def test_start_is_straight_level_at_rest_and_on_the_reference(preset: str) -> None:
    scenario = SpatialScenario(conditions=SPATIAL_PRESETS[preset])
    simulation = Simulation([scenario])
    assert not simulation.read("velocity").any()
    assert simulation.read("attitude").tolist() == [[1.0, 0.0, 0.0, 0.0]]
    assert not simulation.read("joint_angles").any()
    np.testing.assert_allclose(simulation.error, 0.0, atol=1e-15)
