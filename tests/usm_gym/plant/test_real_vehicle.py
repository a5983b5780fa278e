"""Thrusters with lag, dead-band and gains, and water in waves: what they are by definition."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from support import dense_step

import usm_gym
from usm_gym import Robot, Scenario, Water, Wave
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import sample

Array = NDArray[np.float64]

IDEAL, SEA = PRESETS["ideal"], PRESETS["sea"]
GAINS = (0.5, 0.8, 1.0, 1.3, 2.0)


def forces(simulation: Simulation, robot: int = 0) -> Array:
    return dense_step.read(simulation, robot).thrust


@pytest.mark.parametrize("time_constant", [0.0, 0.05, 0.1])
def test_thrusters_lag_exactly_behind_the_saturated_command(time_constant: float) -> None:
    conditions = replace(IDEAL, thruster_time_constant=time_constant, thruster_limit=20.0)
    simulation = Simulation([Scenario(conditions=conditions)])
    rng = np.random.default_rng(0)
    force = np.zeros(5)
    kept = np.exp(-0.02 / time_constant) if time_constant else 0.0
    saturated = False
    for _ in range(50):
        action = rng.normal(0.0, 1.0, 5).astype(np.float32)
        saturated |= bool((np.abs(action) > 1.0).any())
        simulation.step(action[np.newaxis])
        command = 20.0 * np.clip(action.astype(float), -1.0, 1.0)
        force = command + kept * (force - command)
        np.testing.assert_array_equal(simulation.read("command")[0], command)
        np.testing.assert_allclose(forces(simulation), force, rtol=0, atol=1e-12)
    assert saturated


@pytest.mark.parametrize("copies", [1, 3])
def test_below_the_dead_band_there_is_no_force_and_above_it_all(copies: int) -> None:
    conditions = replace(
        IDEAL, thruster_time_constant=0.0, thruster_limit=8.0, thruster_dead_band=0.5
    )
    simulation = Simulation([Scenario(conditions=conditions)] * copies)
    # Exact in binary: just below, at and just above the edge of either sign.
    asked = np.array([0.0625 - 2**-20, -0.0625, 0.0625 + 2**-20, -0.0625 + 2**-20, 1.0])
    simulation.step(np.tile(asked, (copies, 1)).astype(np.float32))
    for robot in range(copies):
        expected = [0.0, -0.5, 8.0 * asked[2], 0.0, 8.0]
        np.testing.assert_array_equal(forces(simulation, robot), expected)


def test_each_thruster_lags_behind_its_own_gain_times_what_is_asked() -> None:
    conditions = replace(IDEAL, thruster_time_constant=0.1, thruster_dead_band=20.0)
    conditions = replace(conditions, thruster_limit=100.0)
    gained = Simulation([Scenario(conditions=conditions, thruster_gains=GAINS)])
    rng, force, kept = np.random.default_rng(0), np.zeros(5), np.exp(-0.02 / 0.1)
    working = set()
    for _ in range(50):
        action = rng.uniform(-1.0, 1.0, (1, 5)).astype(np.float32)
        gained.step(action)
        command = 100.0 * action[0].astype(float)
        target = [g * c if abs(c) >= 20.0 else 0.0 for g, c in zip(GAINS, command, strict=True)]
        force = target + kept * (force - target)
        np.testing.assert_allclose(forces(gained), force, rtol=0, atol=1e-11)
        working |= set(np.abs(command) >= 20.0)
        # What is known on board is what was asked.
        seen = gained.observation[0] * gained.layout.scale
        np.testing.assert_allclose(seen[gained.layout.slices["thruster_command"]], action[0])
        assert gained.effort[0] == pytest.approx(np.abs(command).mean())
    assert working == {True, False}


def test_gains_of_one_are_the_thrusters_of_before() -> None:
    plain = Scenario(conditions=replace(SEA, thruster_dead_band=0.0))
    given = replace(plain, thruster_gains=(1.0,) * 5, water=Water(link_factors=(1.0,) * 16))
    simulation = Simulation([plain, given])
    for action in np.random.default_rng(0).uniform(-1, 1, (50, 1, 5)).astype(np.float32):
        simulation.step(action.repeat(2, axis=0))
    np.testing.assert_array_equal(*simulation.read("theta"))
    np.testing.assert_array_equal(*simulation.read("position"))


def test_factors_of_links_are_coefficients_of_links() -> None:
    # The same for all links, they are a factor of all coefficients.
    water = Water(current=(0.1, -0.2), coefficients=(1.5, 0.8, 1.2, 0.9, 1.1, 0.7))
    common = tuple(1.3 * ratio for ratio in water.coefficients)
    pair = [
        Scenario(conditions=IDEAL, water=replace(water, link_factors=(1.3,) * 16)),
        Scenario(conditions=IDEAL, water=replace(water, coefficients=common)),
    ]
    simulation = Simulation(pair)
    for action in np.random.default_rng(0).uniform(-0.1, 0.1, (50, 1, 5)).astype(np.float32):
        simulation.step(action.repeat(2, axis=0))
    for quantity in ("theta", "position", "velocity"):
        one, other = simulation.read(quantity)
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(simulation.read("link_factors")[0], np.full(16, 1.3))


@pytest.mark.parametrize("waves", [0, 1, 4])
def test_the_water_moves_as_a_sum_of_sinusoids(waves: int) -> None:
    rng = np.random.default_rng(waves)
    scenario = sample("operation", SEA, rng)
    water = replace(scenario.water, waves=scenario.water.waves[:waves])
    still = replace(Scenario(conditions=SEA), water=Water(current=(0.1, -0.2)))
    simulation = Simulation([replace(scenario, water=water), still])
    h = SEA.physics_step
    for k in range(1, 200):
        simulation.step(np.zeros((2, 5), np.float32))
        t = k * 0.02 - h / 2  # the middle of the last physics step
        expected = np.array(water.current)
        for axis in range(2):
            angle = 2 * np.pi * t / water.period + water.phase[axis]
            expected[axis] += water.amplitude[axis] * np.sin(angle)
            for wave in water.waves:
                angle = 2 * np.pi * t / wave.period + wave.phase
                expected[axis] += wave.amplitude[axis] * np.sin(angle)
        moving, constant = simulation.read("water_velocity")
        np.testing.assert_allclose(moving, expected, rtol=0, atol=1e-14)
        # A neighbour's waves are not one's own.
        np.testing.assert_array_equal(constant, [0.1, -0.2])


def test_waves_alone_carry_a_robot_along() -> None:
    # All water moving alike, a straight neutrally buoyant robot at the water's speed stays in it.
    wave = Wave(amplitude=(0.3, 0.2), phase=0.0, period=5.0)
    quiet = replace(IDEAL, motion=False)
    simulation = Simulation([Scenario(conditions=quiet, water=Water(waves=(wave,)))])
    for k in range(1, 250):
        simulation.step(np.zeros((1, 5), np.float32))
        swing = (1.0 - np.cos(2 * np.pi * k * 0.02 / 5.0)) * 5.0 / (2 * np.pi)
        expected = swing * np.array(wave.amplitude)
        np.testing.assert_allclose(simulation.read("position")[0], expected, atol=1e-5)
        np.testing.assert_allclose(simulation.read("theta")[0], 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"thruster_gains": (1.0, 1.1)}, "thruster_gains is .*one for each of 5 thrusters"),
        ({"thruster_gains": (1.0,) * 6}, "thruster_gains is .*one for each of 5 thrusters"),
        ({"water": Water(link_factors=(1.0,) * 15)}, "link_factors is .*one for each of 16 links"),
    ],
)
def test_gains_and_factors_are_as_many_as_thrusters_and_links(
    fields: dict[str, object], message: str
) -> None:
    scenario = replace(usm_gym.suite("operation")[0], **fields)  # type: ignore[arg-type]
    assert len(Robot().thrusters) == 5
    with pytest.raises(ValueError, match=message) as error:
        Simulation([scenario])
    assert "\n" not in str(error.value)
