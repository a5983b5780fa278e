"""Scenarios in space say everything about an episode, and are drawn from the ranges they have."""

import dataclasses
import json
import re
from typing import Any

import numpy as np
import pytest
from support.episodes import assert_fills
from support.spatial_swimming import ROBOTS

from usm_gym import Conditions, Scan, SpatialScenario
from usm_gym.robots import spatial_robot_of
from usm_gym.spatial_posture import link_poses
from usm_gym.spatial_robot import EELY, EELY_NEUTRAL
from usm_gym.support.seeding import EVALUATION, stream
from usm_gym.task.conditions import SPATIAL_PRESETS
from usm_gym.task.modes import read_scenario, sample_of
from usm_gym.task.spatial_sampling import nominal_in_space, sample_in_space
from usm_gym.task.spatial_scenario import NO_SCAN, SPATIAL_MODES, SpatialMode

DRAWS = 1000


def drawn(mode: SpatialMode, preset: str, count: int = DRAWS) -> list[SpatialScenario]:
    random = np.random.default_rng(0)
    return [sample_in_space(mode, SPATIAL_PRESETS[preset], random) for _ in range(count)]


def everything() -> list[SpatialScenario]:
    """Return scenarios in which every field differs from its default at least once."""
    conditions = Conditions(
        control_period=0.01,
        physics_step=5e-4,
        integrator="explicit",
        hydrodynamics="kelasidi2014",
        drag="quadratic",
        motion=False,
    )
    return [
        *(
            sample_in_space(mode, preset, stream(1, EVALUATION, 0), robot)
            for mode in SPATIAL_MODES
            for preset in SPATIAL_PRESETS.values()
            for robot in ("eely", "eely-neutral", ROBOTS["3 links"], ROBOTS["eely-uneven"])
        ),
        dataclasses.replace(
            SpatialScenario(),
            conditions=conditions,
            duration=3.0,
            settle_time=0.5,
            look_ahead=1.0,
            cross_track=True,
            scan=Scan(filter_frequency=None),
        ),
    ]


def test_json_gives_back_the_same_scenario() -> None:
    for scenario in everything():
        text = json.dumps(scenario.to_dict(), allow_nan=False)
        again = read_scenario(json.loads(text))
        assert again == scenario
        assert json.dumps(again.to_dict()) == text
        assert hash(again) == hash(scenario)


def test_a_robot_is_kept_as_data_and_eely_as_nothing() -> None:
    for robot in ("eely", EELY, dataclasses.replace(EELY)):
        assert "robot" not in SpatialScenario(robot=robot).to_dict()
        assert SpatialScenario(robot=robot) == SpatialScenario()
    neutral = SpatialScenario(robot="eely-neutral")
    assert neutral.robot == neutral.body == EELY_NEUTRAL
    assert spatial_robot_of(neutral.to_dict()["robot"]) == EELY_NEUTRAL
    assert neutral.nominal.robot == EELY_NEUTRAL


def test_fields_left_out_have_their_defaults() -> None:
    assert SpatialScenario.from_dict({}) == SpatialScenario()
    partial = SpatialScenario.from_dict({"path": {"heave": 0.01}, "conditions": {"motion": False}})
    assert partial.path == dataclasses.replace(SpatialScenario().path, heave=0.01)
    assert partial.conditions == dataclasses.replace(SPATIAL_PRESETS["field"], motion=False)


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"pace": 1.0}, ["pace"]),
        ({"mode": "operation"}, ["mode", "operation3d", "torpedo3d"]),
        ({"inspection": {}}, ["inspection"]),
        ({"heading": "mean"}, ["heading"]),
        ({"duration": 40.01}, ["duration", "40.01", "control_period"]),
        ({"noise_seed": -1}, ["noise_seed", "-1"]),
        ({"cross_track": 1}, ["cross_track"]),
        ({"look_ahead": 0.0}, ["look_ahead"]),
        ({"robot": "paper"}, ["robot is 'paper'", "eely, eely-neutral"]),
        ({"robot": {"links": 16}}, ["robot", "links"]),
        ({"path": {"amplitude": 0.1}}, ["path", "amplitude"]),
        ({"path": {"heave": "up"}}, ["path", "heave"]),
        ({"path": {"speed": True}}, ["path", "speed"]),
        ({"path": {"ramp": -2.0}}, ["path", "ramp"]),
        ({"scan": {"times": [1.0, 2.0]}}, ["pans", "as many as times"]),
        ({"scan": {"times": [20.0, 10.0, 30.0]}}, ["times", "20.0", "rising"]),
        ({"scan": {"tilts": [0.1]}}, ["tilts", "as many as times"]),
        ({"scan": {"bending_joints": 0}}, ["scan", "bending_joints"]),
        ({"scan": {"bending_joints": 64}}, ["scan", "bending_joints"]),
        ({"scan": {"filter_frequency": 0.0}}, ["filter_frequency"]),
        ({"scan": {"pans": [101.0, 0.0, 0.0]}}, ["pans", "100"]),
        (
            {"scan": {n: [float(k) for k in range(17)] for n in ("times", "pans", "tilts")}},
            ["times", "16"],
        ),
        ({"conditions": {"thruster_limit": 0.0}}, ["thruster_limit"]),
        ({"conditions": {"control_period": 0.0015}}, ["control_period", "0.0015", "physics_step"]),
        ({"water": {"current": [0.0, 0.0]}}, ["water", "current"]),
        ({"water": {"coefficients": [1.0] * 5}}, ["water", "coefficients"]),
        ({"water": {"waves": [{"amplitude": [0.1, 0.0, 0.0], "period": 5.0}]}}, ["waves", "phase"]),
        (
            {"water": {"waves": [{"amplitude": [0, 0, 9], "phase": [0, 0, 0], "period": 5}]}},
            ["waves", "amplitude", "less than or equal to 5"],
        ),
        ({"thruster_gains": [101.0] * 7}, ["thruster_gains", "100"]),
    ],
)
def test_what_is_wrong_is_named(fields: dict[str, Any], names: list[str]) -> None:
    with pytest.raises(ValueError, match=re.escape(names[0])) as error:
        SpatialScenario.from_dict(fields)
    for name in names:
        assert name in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("mode", SPATIAL_MODES)
@pytest.mark.parametrize("preset", SPATIAL_PRESETS)
def test_nominal_scenarios(mode: SpatialMode, preset: str) -> None:
    scenario = nominal_in_space(mode, SPATIAL_PRESETS[preset])
    scanning = preset in ("basin", "sea")
    times = (60.0, 20.0, 3000) if scanning else (40.0, 5.0, 2000)
    assert (scenario.duration, scenario.settle_time, scenario.steps) == times
    assert scenario.conditions == SPATIAL_PRESETS[preset]
    assert (scenario.mode, scenario.body) == (mode, EELY)
    if mode == "torpedo3d":
        assert scenario.scan == NO_SCAN
        assert scenario.look_ahead == pytest.approx(3.37)
    else:
        assert scenario.look_ahead is None
        assert scenario.scan.bending_joints == 4
        assert len(scenario.shifts) == (8 if scanning else 3)
    with pytest.raises(ValueError, match="mode is 'operation'; allowed: operation3d or torpedo3d"):
        nominal_in_space("operation")  # type: ignore[arg-type]


def test_paths_are_drawn_from_their_ranges() -> None:
    for mode, speed, sway, heave, most in (
        ("operation3d", (0.0, 0.1), 0.25, 0.15, 0.15),
        ("torpedo3d", (0.05, 0.3), 0.5, 0.3, 0.12),
    ):
        paths = [s.path for s in drawn(mode, "field")]
        assert_fills([path.speed for path in paths], *speed)
        assert_fills([path.sway for path in paths], 0.0, sway)
        assert_fills([path.heave for path in paths], 0.0, heave)
        for name in ("sway_frequency", "heave_frequency"):
            assert_fills([getattr(path, name) for path in paths], 0.03, most)
        values = [dataclasses.astuple(path)[:5] for path in paths]
        np.testing.assert_allclose(np.corrcoef(np.transpose(values)), np.eye(5), atol=0.12)


def test_in_operation_the_head_looks_elsewhere_three_times_and_at_last_back() -> None:
    scenarios = drawn("operation3d", "field")
    times = np.array([s.shifts for s in scenarios])
    for shift, middle in zip(times.T, (10.0, 20.0, 30.0), strict=True):
        assert_fills(shift, middle - 2.0, middle + 2.0)
    pans = np.array([s.scan.pans for s in scenarios])
    tilts = np.array([s.scan.tilts for s in scenarios])
    assert not pans[:, 2].any()
    assert not tilts[:, 2].any()
    sizes, directions = np.hypot(pans, tilts)[:, :2], np.arctan2(tilts, pans)
    for size in sizes.T:
        assert_fills(size, 0.4, 1.0)
    # From one side to the other: by 120 to 240 degrees.
    turns = (directions[:, 1] - directions[:, 0]) % (2 * np.pi)
    assert_fills(turns, 2 * np.pi / 3, 4 * np.pi / 3)
    assert_fills([s.scan.filter_frequency for s in scenarios], 3.0, 5.0)


@pytest.mark.parametrize("preset", ["basin", "sea"])
def test_scans_go_on_to_the_end(preset: str) -> None:
    scenarios = drawn("operation3d", preset, 300)
    gaps = np.concatenate([np.diff(s.shifts, prepend=0.0) for s in scenarios])
    assert 5.0 <= gaps.min() < gaps.max() <= 8.0
    last = np.array([s.shifts[-1] for s in scenarios])
    assert 47.0 - 1e-9 <= last.min() <= last.max() <= 55.0
    sizes = np.concatenate([np.hypot(s.scan.pans, s.scan.tilts) for s in scenarios])
    assert_fills(sizes, 0.4, 1.0)
    for scenario in scenarios:
        directions = np.arctan2(scenario.scan.tilts, scenario.scan.pans)
        apart = np.abs((np.diff(directions) + np.pi) % (2 * np.pi) - np.pi)
        assert apart.min() >= 2 * np.pi / 3 - 1e-9


@pytest.mark.parametrize("preset", ["field", "sea"])
def test_water_is_drawn_from_its_ranges(preset: str) -> None:
    scenarios, conditions = drawn("torpedo3d", preset), SPATIAL_PRESETS[preset]
    waters = [s.water for s in scenarios]
    currents = np.array([water.current for water in waters])
    ratios = np.array([water.coefficients for water in waters])
    assert (currents.shape, ratios.shape) == ((DRAWS, 3), (DRAWS, 6))
    for component in currents.T:
        assert_fills(component, -conditions.current_limit, conditions.current_limit)
    for ratio in ratios.T:
        assert_fills(ratio, *conditions.coefficient_range)
    parts = [currents, ratios]
    if preset == "field":
        assert not any(water.sinusoids or water.link_factors for water in waters)
        assert not any(s.thruster_gains for s in scenarios)
    else:
        gains = np.array([s.thruster_gains for s in scenarios])
        factors = np.array([water.link_factors for water in waters])
        assert (gains.shape, factors.shape) == ((DRAWS, 7), (DRAWS, 9))
        assert_fills(gains, *conditions.thruster_gain_range)
        spread = conditions.coefficient_spread
        assert_fills(factors, 1.0 - spread, 1.0 + spread)
        parts += [gains, factors]
    values = np.hstack(parts)
    np.testing.assert_allclose(np.corrcoef(values.T), np.eye(values.shape[1]), atol=0.13)


def test_waves_go_round_in_the_vertical_plane_of_their_course() -> None:
    limit = SPATIAL_PRESETS["sea"].wave_limit
    waves = [wave for s in drawn("torpedo3d", "sea", 300) for wave in s.water.waves]
    assert len(waves) == 4 * 300
    time = np.linspace(0.0, 10.0, 50)
    heights = []
    for wave in waves:
        along, phase = np.array(wave.amplitude), np.array(wave.phase)
        angles = 2.0 * np.pi * time[:, np.newaxis] / wave.period + phase
        speeds = np.linalg.norm(along * np.sin(angles), axis=1)
        np.testing.assert_allclose(speeds, along[2], rtol=1e-9)  # round at one speed
        heights.append(along[2])
    assert_fills(heights, 0.0, limit / 4)
    courses = [np.arctan2(wave.amplitude[1], wave.amplitude[0]) for wave in waves]
    assert_fills(courses, -np.pi, np.pi)
    assert_fills([wave.period for wave in waves], 4.0, 10.0)


@pytest.mark.parametrize("mode", SPATIAL_MODES)
@pytest.mark.parametrize("preset", SPATIAL_PRESETS)
def test_under_its_own_conditions_a_drawn_scenario_is_the_same(
    mode: SpatialMode, preset: str
) -> None:
    for scenario in drawn(mode, preset, 5):
        assert scenario.under(scenario.conditions) == scenario


def test_under_other_conditions_path_and_scan_are_the_same() -> None:
    for scenario in drawn("operation3d", "field", 10):
        sea = scenario.under(SPATIAL_PRESETS["sea"])
        kept = ("mode", "path", "scan", "duration", "noise_seed", "robot", "look_ahead")
        assert all(getattr(sea, name) == getattr(scenario, name) for name in kept)
        # The water is stretched, not replaced.
        np.testing.assert_allclose(sea.water.current, 3.0 * np.array(scenario.water.current))
        np.testing.assert_allclose(
            (np.array(sea.water.coefficients) - 0.5) / 1.5,
            (np.array(scenario.water.coefficients) - 0.8) / 0.4,
            atol=1e-12,
        )
        assert sea.under(SPATIAL_PRESETS["field"]) == scenario


def test_bending_changes_how_far_and_how_fast_and_nothing_else() -> None:
    scenario = drawn("operation3d", "field", 1)[0]
    changed = scenario.bending(further=1.5, faster=2.0)
    np.testing.assert_allclose(changed.scan.pans, 1.5 * np.array(scenario.scan.pans))
    np.testing.assert_allclose(changed.scan.tilts, 1.5 * np.array(scenario.scan.tilts))
    assert changed.scan.filter_frequency == 2.0 * (scenario.scan.filter_frequency or 0.0)
    assert dataclasses.replace(changed, scan=scenario.scan) == scenario
    unfiltered = dataclasses.replace(
        scenario, scan=dataclasses.replace(scenario.scan, filter_frequency=None)
    )
    assert unfiltered.bending(further=2.0).scan.filter_frequency is None
    with pytest.raises(ValueError, match="filter_frequency"):
        unfiltered.bending(faster=2.0)


@pytest.mark.parametrize("name", ["3 links", "eely", "eely-uneven"])
def test_shares_turn_the_head_by_pan_and_tilt(name: str) -> None:
    robot, small = ROBOTS[name], 1e-4
    pan, tilt = Scan(bending_joints=len(robot.joint_axes)).shares(robot)
    straight = np.zeros(3), (1.0, 0.0, 0.0, 0.0)
    for angles, side in ((pan, 1), (tilt, 2)):
        tail, *_, head = link_poses(robot, *straight, small * angles)[0]
        ahead = tail.T @ head[:, 0]  # the head as the tail sees it
        assert ahead[side] == pytest.approx(small, rel=1e-3)
    assert not Scan(bending_joints=1).shares(EELY)[:, :-1].any()


def test_other_robots_bend_the_joints_of_their_front_half() -> None:
    for name, bending in (("2 links", 1), ("3 links", 1), ("8 links", 3), ("16 links", 7)):
        scenario = sample_in_space(
            "operation3d", SPATIAL_PRESETS["field"], np.random.default_rng(0), ROBOTS[name]
        )
        assert scenario.scan.bending_joints == bending


def test_a_mode_that_is_none_is_named() -> None:
    for mode in ("diving", "operation3D", ""):
        with pytest.raises(ValueError, match=f"mode is '{mode}'; allowed: operation or torpedo or"):
            sample_of(mode, SPATIAL_PRESETS["field"], np.random.default_rng(0))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="mode"):
        read_scenario({"mode": "diving"})
    with pytest.raises(ValueError, match="robot is 'eely'; allowed: paper"):
        sample_of("operation", SPATIAL_PRESETS["field"], np.random.default_rng(0), "eely")
