"""What a controller of one's own is told in space agrees with the simulation."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import usm_gym
from usm_gym import Scenario, SpatialPath, SpatialScenario, SpatialVehicle, Vehicle
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import SPATIAL_PRESETS

# Everything is nominal and measured exactly.
CALM = replace(
    SPATIAL_PRESETS["field"],
    current_limit=0.0,
    coefficient_range=(1.0, 1.0),
    position_noise=0.0,
    tail_angle_noise=0.0,
    rate_noise=0.0,
)


def swimming(steps, **conditions):
    """A robot that scans under random thrust, its vehicle, and what is seen and kept in the end."""
    scenario = SpatialScenario(
        path=SpatialPath(speed=0.05, ramp=1.0), conditions=replace(CALM, **conditions)
    )
    simulation, vehicle = Simulation([scenario, scenario]), SpatialVehicle(scenario.nominal)
    stream, memory = np.random.default_rng(0), None
    for _ in range(steps):
        _, memory = vehicle.read(simulation.observation, memory)
        simulation.step(stream.uniform(-0.2, 0.2, (2, 7)).astype(np.float32))
    return simulation, vehicle, *vehicle.read(simulation.observation, memory)


@pytest.mark.parametrize("dead_band", [0.0, 2.0])
def test_what_is_seen_is_what_happens(dead_band):
    simulation, _, seen, _ = swimming(60, thruster_dead_band=dead_band)
    np.testing.assert_allclose(seen.position_error, simulation.error, atol=1e-7)
    errors = np.hstack([seen.attitude_error, seen.roll_error])
    np.testing.assert_allclose(errors, simulation.attitude_error, atol=1e-6)
    rates = simulation.read("angular_velocity")[:, 1:]
    np.testing.assert_allclose(seen.attitude_rate, rates, atol=1e-6)
    np.testing.assert_allclose(seen.thruster_forces, simulation.read("force"), atol=1e-4)
    true = simulation.velocity - seen.reference_velocity
    np.testing.assert_allclose(seen.velocity_error, true, atol=2e-3)


def test_an_allocated_wrench_is_what_the_thrusters_make_and_the_cheapest_way_to_it():
    simulation, vehicle, seen, _ = swimming(700)  # the head has turned
    assert np.abs(seen.joint_angles).max() > 0.1
    wanted = np.random.default_rng(1).normal(0.0, 3.0, (2, 5))
    forces = vehicle.allocate(wanted[:, :3], wanted[:, 3:], seen) * seen.thruster_limit
    whole = np.empty((2, 6, 7))
    simulation.world.allocate(simulation.observation, whole)
    for matrix, force, wrench in zip(whole[:, :5], forces, wanted, strict=True):
        np.testing.assert_allclose(matrix @ force, wrench, atol=1e-9)
        idle = np.linalg.svd(matrix)[2][5:]
        np.testing.assert_allclose(idle @ force, 0.0, atol=1e-9)


def test_one_robot_and_a_batch_are_read_alike_and_a_new_episode_forgets():
    simulation, vehicle, _, memory = swimming(30)
    restarted = np.array([False, True])
    seen, kept = vehicle.read(simulation.observation, memory, restarted)
    for i, restart in enumerate(restarted):
        alone, own = vehicle.read(simulation.observation[i], None if restart else memory[i])
        np.testing.assert_array_equal(own, kept[i])
        for name, value in vars(alone).items():
            np.testing.assert_allclose(value, getattr(seen, name)[i], rtol=1e-12, err_msg=name)


class OwnPD:
    """The example of the class's documentation."""

    def __init__(self, nominal):
        self.vehicle = SpatialVehicle(nominal)

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        seen, state = self.vehicle.read(observation, state, episode_start)
        force = -300.0 * seen.position_error - 600.0 * seen.velocity_error
        moment = -100.0 * seen.attitude_error - 170.0 * seen.attitude_rate
        return self.vehicle.allocate(force, moment, seen), state


def test_a_controller_of_one_s_own_holds_the_robot():
    scenarios = [replace(each, duration=15.0) for each in usm_gym.suite("operation3d")[:4]]
    scores = usm_gym.evaluate(OwnPD(scenarios[0].nominal), scenarios)
    assert not scores.failed.any()
    assert max(scores.per_episode[f"max_error_{axis}"].max() for axis in "xyz") < 0.1
    assert scores.per_episode["pitch_error"].max() < 0.2


def test_it_has_mass_inertia_and_drag_and_environments_take_what_is_allocated():
    env = gym.make("usm_gym:USM-Torpedo3D-v0")
    observation, _ = env.reset(seed=0)
    vehicle = SpatialVehicle(env.unwrapped.nominal)
    assert vehicle.mass == vehicle.robot.total_mass
    assert vehicle.mass < vehicle.inertia[0] < vehicle.inertia[1]
    assert vehicle.inertia.shape == vehicle.drag.shape == (3,)
    seen, _ = vehicle.read(observation)
    env.step(vehicle.allocate(np.array([1.0, 0.0, 0.0]), np.zeros(2), seen))


def test_robots_of_the_other_world_are_refused():
    with pytest.raises(ValueError, match="allowed: a robot in space"):
        SpatialVehicle(Scenario().nominal)
    with pytest.raises(ValueError, match="allowed: the planar robot"):
        Vehicle(SpatialScenario().nominal)


@pytest.mark.parametrize(
    ("force", "moment", "message"),
    [
        (np.zeros(2), np.zeros(2), r"shape of the force is \(2,\); allowed: shape \(3,\)"),
        (np.zeros(3), np.zeros(1), r"shape of the moment is \(1,\); allowed: shape \(2,\)"),
    ],
)
def test_wrenches_of_another_shape_are_refused(force, moment, message):
    _, vehicle, _, _ = swimming(0)
    seen, _ = vehicle.read(np.zeros(74))
    with pytest.raises(ValueError, match=message):
        vehicle.allocate(force, moment, seen)
