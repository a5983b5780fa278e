"""Pictures of the spatial robot: what they say of the simulation."""

import dataclasses
from functools import cache

import numpy as np
import pytest
import usm_baselines

from usm_gym.rendering.depiction import depiction_of
from usm_gym.rendering.picture import drift, velocity
from usm_gym.simulation import Simulation
from usm_gym.spatial_posture import centre_of_mass, roll_pitch_yaw, rotation_of
from usm_gym.task.conditions import SPATIAL_PRESETS
from usm_gym.task.spatial_sampling import sample_in_space

ROOT = 4


def scenario_of(mode, conditions="ideal", seed=0):
    return sample_in_space(mode, SPATIAL_PRESETS[conditions], np.random.default_rng(seed))


@cache
def swum(mode, steps):
    """A simulation some steps into an episode, and a picture of it."""
    scenario = scenario_of(mode)
    simulation, recorder = Simulation([scenario]), depiction_of(scenario.body).recorder()
    policy, state = usm_baselines.make("sta", scenario.nominal), None
    for _ in range(steps):
        recorder.note(simulation)
        action, state = policy.predict(simulation.observation, state)
        simulation.step(action)
    return simulation, recorder.picture(simulation)


def joint_angles(robot, pose):
    """Angles by which each link is turned about the axis of the joint before it, rad."""
    turns = np.swapaxes(pose.rotations[:-1], 1, 2) @ pose.rotations[1:]
    # A turn by an angle about a unit vector has 2 sin(angle) times that vector off its diagonal.
    off = turns - np.swapaxes(turns, 1, 2)
    vectors = np.stack([off[:, 2, 1], off[:, 0, 2], off[:, 1, 0]], axis=1) / 2
    return np.arcsin((vectors * robot.joint_axes).sum(axis=1))


def test_a_picture_is_the_simulations():
    simulation, picture = swum("operation3d", 640)
    robot = picture.robot
    assert picture.time == pytest.approx(12.8)
    root = simulation.read("position")[0], rotation_of(simulation.read("attitude")[0])
    np.testing.assert_allclose(picture.body.centres[ROOT], root[0], atol=1e-9)
    np.testing.assert_allclose(picture.body.rotations[ROOT], root[1], atol=1e-12)
    ahead = picture.body.rotations[..., 0] * robot.lengths[:, np.newaxis] / 2
    heads, tails = picture.body.centres + ahead, picture.body.centres - ahead
    np.testing.assert_allclose(heads[:-1], tails[1:], atol=1e-12)  # the links hang together
    bent = simulation.read("joint_angles")[0]
    np.testing.assert_allclose(joint_angles(robot, picture.body), bent, atol=1e-12)
    assert np.abs(bent).max() > 0.1
    np.testing.assert_allclose(picture.track[-1], centre_of_mass(robot, *picture.body), atol=1e-9)
    np.testing.assert_array_equal(picture.times, 0.02 * np.arange(641))
    np.testing.assert_allclose(picture.path[:641] + picture.errors, picture.track)
    np.testing.assert_array_equal(picture.errors[-1], simulation.error[0])
    assert picture.thrust == pytest.approx(simulation.read("force")[0] / simulation.limit[0])


def test_the_reference_is_where_the_robot_shall_be():
    simulation, picture = swum("operation3d", 640)
    layout = simulation.layout
    observed = simulation.observation[0] * layout.scale
    wanted = observed[layout.slices["joint_references"]]
    assert np.abs(wanted).max() > 0.1
    # Nothing is measured wrongly under ideal conditions.
    np.testing.assert_allclose(joint_angles(picture.robot, picture.wanted), wanted, atol=1e-6)
    mass = centre_of_mass(picture.robot, *picture.wanted)
    np.testing.assert_allclose(mass, picture.reference, atol=1e-12)
    np.testing.assert_allclose(picture.wanted.rotations[ROOT], np.eye(3), atol=1e-9)


def test_the_reference_aims_along_the_line_of_sight():
    simulation, picture = swum("torpedo3d", 300)
    look_ahead = simulation.scenarios[0].look_ahead
    _, y, z = picture.track[-1]
    expected = 0.0, np.arctan(z / look_ahead), -np.arctan(y / look_ahead)
    roll_to_yaw = roll_pitch_yaw(picture.wanted.rotations[ROOT])
    np.testing.assert_allclose(roll_to_yaw, expected, atol=1e-9)
    assert np.abs(expected).max() > 1e-3


def test_the_water_drifts_as_fast_as_the_simulations():
    scenario = dataclasses.replace(scenario_of("operation3d", "sea"), duration=4.0)
    simulation, period = Simulation([scenario]), scenario.conditions.control_period
    velocities = []
    for _ in range(scenario.steps):
        simulation.step(np.zeros((1, 7)))
        velocities.append(simulation.read("water_velocity")[0])
    times = period * np.arange(1, scenario.steps + 1)
    told = [velocity(scenario.water, time) for time in times]
    np.testing.assert_allclose(told, velocities, atol=2e-3)
    moved = np.array([drift(scenario.water, time) for time in times])
    speeds = np.gradient(moved, period, axis=0)
    np.testing.assert_allclose(speeds[1:-1], np.array(told)[1:-1], atol=1e-3)
    assert np.ptp(velocities, axis=0).min() > 0.01  # it changes


def test_an_unknown_robot_is_named():
    with pytest.raises(TypeError, match="nothing draws dict"):
        depiction_of({})
