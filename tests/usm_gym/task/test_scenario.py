"""Scenarios say everything about an episode, are drawn as documented, and read back as written."""

import dataclasses
import json
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.episodes import assert_fills

from usm_gym import Conditions, Scenario
from usm_gym.robot import Robot, Thruster
from usm_gym.support.seeding import (
    EVALUATION,
    RECORDING,
    SUITE,
    TRAINING,
    TUNING,
    VALIDATION,
    stream,
)
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named, sample
from usm_gym.task.scenario import MODES, Mode
from usm_gym.task.sensing import POSITION
from usm_gym.task.water import WATER

Array = NDArray[np.float64]

DRAWS = 2000


def drawn(mode: Mode, preset: str, count: int = DRAWS) -> list[Scenario]:
    random = np.random.default_rng(0)
    return [sample(mode, PRESETS[preset], random) for _ in range(count)]


def everything() -> list[Scenario]:
    """Return scenarios in which every field differs from its default at least once."""
    return [
        *(
            sample(mode, conditions, stream(1, EVALUATION, 0))
            for mode in MODES
            for conditions in PRESETS.values()
        ),
        *(named("table1", mode) for mode in MODES),
        dataclasses.replace(
            Scenario(),
            conditions=Conditions(
                control_period=0.01,
                physics_step=5e-5,
                integrator="explicit",
                hydrodynamics="kelasidi2014",
                drag="quadratic",
                motion=False,
            ),
            duration=3.0,
            settle_time=0.5,
            heading="head",
            look_ahead=1.0,
            cross_track=True,
        ),
    ]


def test_json_gives_back_the_same_scenario() -> None:
    for scenario in everything():
        text = json.dumps(scenario.to_dict(), allow_nan=False)
        again = Scenario.from_dict(json.loads(text))
        assert again == scenario
        assert json.dumps(again.to_dict()) == text
        assert isinstance(again.inspection.times, tuple)  # so that it stays hashable
        assert hash(again) == hash(scenario)


def test_fields_left_out_have_their_defaults() -> None:
    assert Scenario.from_dict({}) == Scenario()
    partial = Scenario.from_dict({"path": {"speed": 0.01}, "conditions": {"motion": False}})
    assert partial.path == dataclasses.replace(Scenario().path, speed=0.01)
    assert partial.conditions == dataclasses.replace(PRESETS["field"], motion=False)


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"pace": 1.0}, ["pace"]),
        ({"path": {"sped": 0.1}}, ["path", "sped"]),
        ({"conditions": {"thruster_lag": 0.1}}, ["conditions", "thruster_lag"]),
        ({"duration": "40"}, ["duration", "40"]),
        ({"duration": -1.0}, ["duration", "-1.0"]),
        ({"duration": 40.01}, ["duration", "40.01", "control_period"]),
        ({"duration": float("nan")}, ["duration"]),
        ({"duration": float("inf")}, ["duration"]),
        ({"mode": "diving"}, ["mode", "diving", "operation", "torpedo"]),
        ({"heading": "tail"}, ["heading", "tail"]),
        ({"noise_seed": -1}, ["noise_seed", "-1"]),
        ({"noise_seed": 0.5}, ["noise_seed", "0.5"]),
        ({"cross_track": 1}, ["cross_track"]),
        ({"look_ahead": 0.0}, ["look_ahead"]),
        ({"joint_stiffness": -1.0}, ["joint_stiffness"]),
        ({"settle_time": -1.0}, ["settle_time"]),
        ({"path": {"speed": True}}, ["path", "speed"]),
        ({"path": {"ramp": -2.0}}, ["path", "ramp"]),
        ({"path": 3}, ["path"]),
        ({"inspection": {"bending_joints": 0}}, ["inspection", "bending_joints"]),
        ({"inspection": {"bending_joints": 5.0}}, ["inspection", "bending_joints"]),
        ({"inspection": {"times": [1.0, 2.0]}}, ["times", "deflections"]),
        ({"inspection": {"times": [20.0, 10.0, 30.0]}}, ["times", "20.0"]),
        ({"inspection": {"filter_frequency": 0.0}}, ["filter_frequency"]),
        (
            {"inspection": {"times": list(range(17)), "deflections": [0.0] * 17}},
            ["times", "16"],
        ),
        ({"conditions": {"motion": "on"}}, ["conditions", "motion"]),
        ({"conditions": {"integrator": "rk4"}}, ["integrator", "rk4", "explicit"]),
        ({"conditions": {"thruster_limit": 0.0}}, ["thruster_limit"]),
        ({"conditions": {"control_period": 0.0015}}, ["control_period", "0.0015", "physics_step"]),
        ({"conditions": {"coefficient_range": [1.2, 0.8]}}, ["coefficient_range", "1.2"]),
        ({"conditions": {"coefficient_range": [0.0, 0.8]}}, ["coefficient_range"]),
        ({"conditions": {"filter_range": [8.0]}}, ["filter_range"]),
        ({"water": {"coefficients": [1.0] * 5}}, ["water", "coefficients"]),
        ({"water": {"period": 0.0}}, ["water", "period"]),
        ({"water": {"current": [0.0, None]}}, ["water", "current"]),
        ({"water": {"waves": [{"amplitude": [0.1, 0.0], "phase": 0.0}]}}, ["waves", "period"]),
        (
            {"water": {"waves": [{"amplitude": [9, 0], "phase": 0, "period": 5}]}},
            ["waves", "amplitude", "less than or equal to 5"],
        ),
        (
            {"water": {"waves": [{"amplitude": [0, 0], "phase": 0, "period": 5}] * 5}},
            ["waves", "4"],
        ),
        ({"water": {"link_factors": [0.0] * 16}}, ["link_factors", "0.01"]),
        ({"thruster_gains": [101.0] * 5}, ["thruster_gains", "100"]),
    ],
)
def test_what_is_wrong_is_named(fields: dict[str, Any], names: list[str]) -> None:
    with pytest.raises(ValueError, match=re.escape(names[0])) as error:
        Scenario.from_dict(fields)
    for name in names:
        assert name in str(error.value)


@pytest.mark.parametrize("mode", MODES)
def test_named_scenarios(mode: Mode) -> None:
    torpedo = mode == "torpedo"
    nominal, table1 = named("nominal", mode), named("table1", mode)
    for scenario in (nominal, table1):
        assert scenario.mode == mode
        assert (scenario.duration, scenario.settle_time) == (40.0, 5.0)
        assert (scenario.path.amplitude, scenario.path.frequency) == (0.18, 0.065)
        assert scenario.look_ahead == (2.24 if torpedo else None)
        assert (scenario.heading, scenario.cross_track) == ("mean", False)
        motion = scenario.inspection
        if torpedo:
            assert motion.deflections == ()
        else:
            assert motion.bending_joints == 11
            assert motion.times == (10.0, 20.0, 30.0)
            assert motion.deflections == (0.98, -0.98, 0.0)
    assert (nominal.path.speed, nominal.path.ramp) == (0.1 if torpedo else 0.042, 2.0)
    assert (table1.path.speed, table1.path.ramp) == (0.042, 0.0)
    assert (nominal.joint_stiffness, nominal.joint_damping) == (None, None)
    assert (table1.joint_stiffness, table1.joint_damping) == (9000.0, 150.0)
    if not torpedo:
        assert nominal.inspection.filter_frequency == 8.0
        assert table1.inspection.filter_frequency is None
    assert nominal.conditions == PRESETS["field"]
    assert table1.conditions == PRESETS["ideal"]
    assert named("nominal", mode, PRESETS["sea"]).conditions == PRESETS["sea"]
    with pytest.raises(ValueError, match="nominal, table1"):
        named("table2", mode)


@pytest.mark.parametrize(
    ("deflections", "frequencies"), [((0.7, 1.75), (6.0, 12.0)), ((0.9, 2.1), (8.0, 14.0))]
)
def test_operation_is_drawn_from_its_ranges(
    deflections: tuple[float, float], frequencies: tuple[float, float]
) -> None:
    random = np.random.default_rng(0)
    conditions = Conditions(deflection_range=deflections, filter_range=frequencies)
    scenarios = [sample("operation", conditions, random) for _ in range(DRAWS)]
    assert_fills([s.path.speed for s in scenarios], 0.0, 0.1)
    assert_fills([s.path.amplitude for s in scenarios], 0.0, 0.25)
    assert_fills([s.path.frequency for s in scenarios], 0.03, 0.15)
    joints, counts = np.unique([s.inspection.bending_joints for s in scenarios], return_counts=True)
    assert joints.tolist() == [5, 6, 7, 8, 9, 10, 11]
    np.testing.assert_allclose(counts / DRAWS, 1 / 7, atol=0.04)
    sizes = np.array([s.inspection.deflections for s in scenarios])
    sides = np.sign(sizes)
    assert (sides[:, 0] == -sides[:, 1]).all()
    assert 0.4 < (sides[:, 0] > 0).mean() < 0.6
    assert_fills(np.abs(sizes[:, 0]), *deflections)
    assert_fills(np.abs(sizes[:, 1]), *deflections)
    assert abs(np.corrcoef(np.abs(sizes[:, 0]), np.abs(sizes[:, 1]))[0, 1]) < 0.1
    assert_fills(sizes[:, 2], -0.35, 0.35)
    times = np.array([s.inspection.times for s in scenarios])
    for shift, middle in zip(times.T, (10.0, 20.0, 30.0), strict=True):
        assert_fills(shift, middle - 2.0, middle + 2.0)
    assert_fills([s.inspection.filter_frequency for s in scenarios], *frequencies)
    fixed = {
        (s.mode, s.path.ramp, s.duration, s.settle_time, s.look_ahead, s.joint_stiffness, s.heading)
        for s in scenarios
    }
    assert fixed == {("operation", 2.0, 40.0, 5.0, None, None, "mean")}


def test_torpedo_is_drawn_from_its_ranges() -> None:
    scenarios = drawn("torpedo", "field")
    assert_fills([s.path.speed for s in scenarios], 0.05, 0.3)
    assert_fills([s.path.amplitude for s in scenarios], 0.0, 0.5)
    assert_fills([s.path.frequency for s in scenarios], 0.03, 0.12)
    fixed = {(s.mode, s.path.ramp, s.duration, s.look_ahead, s.shifts) for s in scenarios}
    assert fixed == {("torpedo", 2.0, 40.0, 2.24, ())}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("preset", "current", "coefficients"),
    [("field", 0.05, (0.8, 1.2)), ("sea", 0.15, (0.5, 2.0))],
)
def test_water_is_drawn_from_its_ranges(
    mode: Mode, preset: str, current: float, coefficients: tuple[float, float]
) -> None:
    waters = [s.water for s in drawn(mode, preset)]
    currents = np.array([w.current for w in waters])
    ratios = np.array([w.coefficients for w in waters])
    for component in currents.T:
        assert_fills(component, -current, current)
    for ratio in ratios.T:
        assert_fills(ratio, *coefficients)
    correlation = np.corrcoef(np.column_stack([currents, ratios]).T)
    np.testing.assert_allclose(correlation, np.eye(8), atol=0.1)
    amplitudes = np.abs([w.amplitude for w in waters])
    if preset == "sea":
        assert_fills(amplitudes, 0.0, PRESETS["sea"].current_variation)
        assert_fills([w.period for w in waters], 10.0, 40.0)
        assert_fills([w.phase for w in waters], 0.0, 2 * np.pi)
    else:
        assert not amplitudes.any()


@pytest.mark.parametrize("preset", ["basin", "sea"])
def test_gains_and_factors_are_drawn_from_their_ranges_each_for_itself(preset: str) -> None:
    scenarios, conditions = drawn("operation", preset), PRESETS[preset]
    gains = np.array([s.thruster_gains for s in scenarios])
    factors = np.array([s.water.link_factors for s in scenarios])
    assert (gains.shape, factors.shape) == ((DRAWS, 5), (DRAWS, 16))
    for gain in gains.T:
        assert_fills(gain, *conditions.thruster_gain_range)
    spread = conditions.coefficient_spread
    for factor in factors.T:
        assert_fills(factor, 1.0 - spread, 1.0 + spread)
    ratios = np.array([s.water.coefficients for s in scenarios])
    correlation = np.corrcoef(np.hstack([gains, factors, ratios]).T)
    np.testing.assert_allclose(correlation, np.eye(27), atol=0.1)


def test_waves_are_drawn_from_their_ranges_and_never_beyond_the_limit() -> None:
    waters = [s.water for s in drawn("torpedo", "sea")]
    limit = PRESETS["sea"].wave_limit
    sizes = np.array([[np.hypot(*wave.amplitude) for wave in w.waves] for w in waters])
    assert sizes.shape == (DRAWS, 4)
    for size in sizes.T:
        assert_fills(size, 0.0, limit / 4)
    waves = [wave for w in waters for wave in w.waves]
    assert_fills([wave.period for wave in waves], 4.0, 10.0)
    assert_fills([wave.phase for wave in waves], 0.0, 2 * np.pi)
    assert_fills([np.arctan2(*wave.amplitude) for wave in waves], -np.pi, np.pi)


def test_ideal_water_is_still_and_as_in_the_book() -> None:
    for scenario in drawn("operation", "ideal", 50):
        assert not np.any(scenario.water.current)
        assert not np.any(scenario.water.amplitude)
        assert scenario.water.coefficients == (1.0,) * 6
        assert not scenario.sensing().position.any()
        assert (scenario.water.waves, scenario.water.link_factors) == ((), ())
        assert scenario.thruster_gains == ()


def test_same_seed_same_scenario_and_no_two_seeds_alike() -> None:
    def first(*key: int) -> Scenario:
        return sample("operation", PRESETS["sea"], stream(*key))

    assert first(3, EVALUATION, 7) == first(3, EVALUATION, 7)
    purposes = (SUITE, EVALUATION, TRAINING, TUNING, VALIDATION, RECORDING)
    keys = [(seed, purpose, k) for seed in (0, 1) for purpose in purposes for k in range(20)]
    scenarios = [first(*key) for key in keys]
    assert len(set(scenarios)) == len(keys)
    assert len({s.noise_seed for s in scenarios}) == len(keys)


def test_other_robots_bend_their_own_joints() -> None:
    random = np.random.default_rng(0)
    thrusters = (Thruster(1, "axial"), Thruster(1, "normal"), Thruster(2, "normal"))
    for joints in (1, 2, 4, 9):
        robot = Robot(links=joints + 1, thrusters=thrusters)
        bending = {
            sample("operation", PRESETS["field"], random, robot).inspection.bending_joints
            for _ in range(100)
        }
        assert min(bending) >= 1
        assert max(bending) <= joints


def test_unknown_mode_is_named() -> None:
    with pytest.raises(ValueError, match="diving"):
        sample("diving", PRESETS["field"], np.random.default_rng(0))  # type: ignore[arg-type]


def test_noise_and_water_come_from_streams_of_their_own() -> None:
    # Another length or level of noise leaves the water alone.
    field = drawn("operation", "field", 1)[0]
    louder = dataclasses.replace(PRESETS["field"], position_noise=1e-3)
    assert field.under(louder).water == field.water
    keys = [(), (POSITION,), (WATER,)]
    sequences = [np.random.SeedSequence(field.noise_seed, spawn_key=key) for key in keys]
    plain, noise, water = (np.random.default_rng(each).standard_normal(2) for each in sequences)
    np.testing.assert_allclose(field.sensing().position[0], 5e-5 * noise)
    assert len({*plain, *noise, *water}) == 6


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("preset", PRESETS)
def test_under_its_own_conditions_a_drawn_scenario_is_the_same(mode: Mode, preset: str) -> None:
    for scenario in drawn(mode, preset, 20):
        assert scenario.under(scenario.conditions) == scenario


def test_under_other_conditions_path_and_motion_are_the_same() -> None:
    for scenario in drawn("operation", "field", 20):
        sea, basin = scenario.under(PRESETS["sea"]), scenario.under(PRESETS["basin"])
        assert sea.conditions == PRESETS["sea"]
        assert sea.water != scenario.water
        # The water is stretched, not replaced.
        np.testing.assert_allclose(sea.water.current, 3.0 * np.array(scenario.water.current))
        np.testing.assert_allclose(
            (np.array(sea.water.coefficients) - 0.5) / 1.5,
            (np.array(scenario.water.coefficients) - 0.8) / 0.4,
            atol=1e-12,
        )
        # So are gains, factors and waves.
        gains = (np.array(each.thruster_gains) - 1.0 for each in (sea, basin))
        np.testing.assert_allclose(next(gains), 0.2 / 0.15 * next(gains), atol=1e-12)
        factors = (np.array(each.water.link_factors) - 1.0 for each in (sea, basin))
        np.testing.assert_allclose(next(factors), 0.25 / 0.15 * next(factors), atol=1e-12)
        higher = scenario.under(dataclasses.replace(PRESETS["sea"], wave_limit=0.3))
        for low, high in zip(sea.water.waves, higher.water.waves, strict=True):
            assert (low.phase, low.period) == (high.phase, high.period)
            np.testing.assert_allclose(high.amplitude, 3.0 * np.array(low.amplitude))
        assert sea.under(PRESETS["field"]) == scenario
