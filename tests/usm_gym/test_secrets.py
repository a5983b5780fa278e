"""What no controller is told cannot be had: from nominal knowledge, infos or observations."""

from dataclasses import asdict, fields, is_dataclass, replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import usm_gym
from usm_gym import SpatialWater, Water, Wave
from usm_gym.simulation import Simulation
from usm_gym.task.conditions import PRESETS
from usm_gym.task.modes import AnyScenario, presets_of
from usm_gym.task.nominal import Nominal

KINDS = [
    ("USM-Operation-v0", "operation-basin"),
    ("USM-Operation-v0", "operation-sea"),
    ("USM-Operation3D-v0", "operation3d-basin"),
    ("USM-Operation3D-v0", "operation3d-sea"),
]
# What a controller may know beforehand, all of it the same for every episode of the conditions.
KNOWN = {
    *("robot", "control_period", "thruster_time_constant", "thruster_dead_band", "action_delay"),
    *("position_noise", "position_period", "position_delay"),
    *("velocity_noise", "velocity_period", "velocity_delay"),
    *("tail_angle_noise", "joint_angle_noise", "rate_noise"),
    "joint_time_constant",
}
# These are no conditions.
OF_ROBOT = {"robot", "joint_time_constant"}


def secrets(scenario: AnyScenario) -> set[float]:
    """Every number that was drawn for an episode's water and thrusters."""

    def numbers(value: Any) -> list[float]:
        if is_dataclass(value) and not isinstance(value, type):
            return [n for field in fields(value) for n in numbers(getattr(value, field.name))]
        if isinstance(value, tuple):
            return [n for each in value for n in numbers(each)]
        return [float(value)] if isinstance(value, float) else []

    return set(numbers(scenario.water)) | set(scenario.thruster_gains)


def leaves(value: Any) -> list[float]:
    """Every number anywhere in a nest of dicts and lists."""
    if isinstance(value, dict):
        return [n for each in value.values() for n in leaves(each)]
    if isinstance(value, (list, tuple)):
        return [n for each in value for n in leaves(each)]
    return [float(value)] if isinstance(value, (int, float)) else []


@pytest.mark.parametrize("suite", [suite for _, suite in KINDS])
def test_nominal_knowledge_is_that_of_the_conditions_and_no_more(suite: str) -> None:
    assert {field.name for field in fields(Nominal)} == KNOWN
    episodes = usm_gym.suite(suite)
    conditions = presets_of(episodes[0].mode)[suite.partition("-")[2]]
    (nominal,) = {scenario.nominal for scenario in episodes}
    for name in KNOWN - OF_ROBOT:
        assert getattr(nominal, name) == getattr(conditions, name)
    known = set(leaves(asdict(nominal)))
    for scenario in episodes:
        assert len(secrets(scenario)) > 25
        assert not known & secrets(scenario)


@pytest.mark.parametrize(
    "name", ["water", "thruster_gains", "coefficients", "noise_seed", "current"]
)
@pytest.mark.parametrize("suite", ["operation-sea", "operation3d-sea"])
def test_nominal_knowledge_leads_nowhere_else(suite: str, name: str) -> None:
    nominal = usm_gym.suite(suite)[0].nominal
    for holder in (nominal, nominal.robot):
        with pytest.raises(AttributeError):
            getattr(holder, name)
        with pytest.raises((AttributeError, TypeError)):
            setattr(holder, name, 1.0)


def test_whatever_is_drawn_nominal_knowledge_is_the_same() -> None:
    plain = usm_gym.suite("operation-basin")[0]
    other = replace(
        plain,
        water=Water(
            current=(0.5, 0.5),
            waves=(Wave(amplitude=(0.1, 0.1), phase=0.0, period=5.0),),
            coefficients=(2.0,) * 6,
            link_factors=(0.5,) * 16,
        ),
        thruster_gains=(0.1,) * 5,
        noise_seed=7,
    )
    assert other.nominal == plain.nominal
    assert repr(other.nominal) == repr(plain.nominal)


@pytest.mark.parametrize(("id", "suite"), KINDS)
def test_infos_of_reset_and_step_hold_no_secret(id: str, suite: str) -> None:
    env = gym.make(id, conditions=suite.partition("-")[2])
    _, info = env.reset(seed=0)
    told = [info]
    for _ in range(50):
        *_, info = env.step(np.full(env.action_space.shape, 0.1, np.float32))  # type: ignore[arg-type]
        told.append(info)
    axes = env.unwrapped.world.axes  # type: ignore[attr-defined]
    angles = ("heading",) if len(axes) == 2 else ("pitch", "yaw", "roll")
    keys = {f"{kind}_{axis}" for kind in ("error", "max_error") for axis in axes}
    keys |= {f"{angle}_error" for angle in angles} | {"thrust_effort"}
    scenario = env.unwrapped.scenario  # type: ignore[attr-defined]
    for each in told:
        assert set(each) == keys | {"diverged"}
        assert not set(leaves(each)) & (secrets(scenario) - {0.0})


@pytest.mark.parametrize(
    ("suite", "water", "gains"),
    [
        ("operation-sea", Water(link_factors=(0.5,) * 16), (0.5,) * 5),
        ("operation3d-sea", SpatialWater(link_factors=(0.5,) * 9), (0.5,) * 7),
    ],
)
def test_observations_are_the_same_whatever_cannot_be_measured(
    suite: str, water: Any, gains: tuple[float, ...]
) -> None:
    # At rest at the start, with the same sensors, nothing tells one water or thruster from another.
    plain = usm_gym.suite(suite)[0]
    other = replace(plain, water=water, thruster_gains=gains)
    np.testing.assert_array_equal(*Simulation([plain, other]).observation)


def test_a_missing_fix_is_seen_by_its_age_only_once_it_has_not_come() -> None:
    # Up to the moment at which a fix would have arrived, its loss changes nothing.
    conditions = replace(PRESETS["basin"], position_missing=0.5)
    scenarios = [
        replace(usm_gym.suite("operation-basin")[0], conditions=each)
        for each in (conditions, replace(conditions, position_missing=0.0))
    ]
    period, delay = conditions.position_period, conditions.position_delay
    taken = scenarios[0].sensing().taken[:, 0].tolist()
    lost = next(k for k in range(period, len(taken), period) if k not in taken)
    simulation = Simulation(scenarios)
    for k in range(1, lost + delay + 1):
        simulation.step(np.full((2, 5), 0.1, np.float32))
        one, other = simulation.observation
        assert np.array_equal(one, other) == (k < lost + delay)
