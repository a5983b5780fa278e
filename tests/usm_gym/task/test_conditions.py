"""Conditions: the presets, and fields on top of one."""

import dataclasses
from typing import Any

import pytest

from usm_gym import Conditions
from usm_gym.task.conditions import PRESETS, SPATIAL_PRESETS, conditions_of, preset_of


def test_presets_are_those_of_the_documentation() -> None:
    shared = {
        "control_period": 0.02,
        "physics_step": 1e-3,
        "integrator": "midpoint",
        "hydrodynamics": "consistent",
        "drag": "linear and quadratic",
        "action_delay": 0,
        "deflection_range": (0.7, 1.75),
        "motion": True,
    }
    table: dict[str, tuple[Any, Any, Any, Any]] = {  # ideal, field, basin, sea
        "thruster_time_constant": (0.0, 0.05, 0.15, 0.2),
        "thruster_limit": (100.0, 20.0, 8.0, 20.0),
        "thruster_dead_band": (0.0, 0.0, 0.3, 0.3),
        "thruster_gain_range": ((1.0, 1.0), (1.0, 1.0), (0.85, 1.15), (0.8, 1.2)),
        "position_noise": (0.0, 5e-5, 1e-3, 0.03),
        "position_period": (1, 1, 5, 50),
        "position_delay": (0, 0, 3, 15),
        "position_missing": (0.0, 0.0, 0.02, 0.05),
        "velocity_period": (None, None, None, 10),
        "velocity_delay": (0, 0, 0, 5),
        "velocity_noise": (0.0, 0.0, 0.0, 5e-3),
        "tail_angle_noise": (0.0, 0.0, 2e-3, 2e-3),
        "joint_angle_noise": (0.0, 0.0, 1e-3, 1e-3),
        "rate_noise": (0.0, 0.0, 2e-3, 2e-3),
        "current_limit": (0.0, 0.05, 0.03, 0.15),
        "current_variation": (0.0, 0.0, 0.02, 0.05),
        "wave_limit": (0.0, 0.0, 0.0, 0.1),
        "coefficient_range": ((1.0, 1.0), (0.8, 1.2), (0.7, 1.4), (0.5, 2.0)),
        "coefficient_spread": (0.0, 0.0, 0.15, 0.25),
        "filter_range": ((6.0, 12.0), (6.0, 12.0), (4.0, 8.0), (4.0, 8.0)),
        "shift_gap_range": (None, None, (4.0, 6.0), (4.0, 6.0)),
    }
    assert list(PRESETS) == ["ideal", "field", "basin", "sea"]
    for k, (name, preset) in enumerate(PRESETS.items()):
        expected = shared | {field: values[k] for field, values in table.items()}
        assert dataclasses.asdict(preset) == expected
        assert conditions_of(name) == preset
    assert Conditions() == PRESETS["field"]


def test_presets_in_space_are_those_of_the_plane_but_for_the_robot() -> None:
    other: dict[str, dict[str, Any]] = {
        "ideal": {"thruster_limit": 200.0, "filter_range": (3.0, 5.0)},
        "field": {
            "thruster_time_constant": 0.1,
            "thruster_limit": 40.0,
            "tail_angle_noise": 2e-4,
            "rate_noise": 2e-4,
            "filter_range": (3.0, 5.0),
        },
        "basin": {"thruster_time_constant": 0.2, "thruster_limit": 30.0},
        "sea": {"thruster_time_constant": 0.25, "thruster_limit": 40.0},
    }
    scans = {"thruster_dead_band": 0.5, "filter_range": (2.5, 4.0), "shift_gap_range": (5.0, 8.0)}
    assert list(SPATIAL_PRESETS) == list(PRESETS)
    for name, preset in SPATIAL_PRESETS.items():
        changed = {"deflection_range": (0.4, 1.0)} | other[name]
        changed |= scans if name in ("basin", "sea") else {}
        assert preset == dataclasses.replace(PRESETS[name], **changed)
        assert conditions_of(name, SPATIAL_PRESETS) == preset
        assert (preset_of(PRESETS[name]), preset_of(preset)) == (name, f"{name}3d")
    assert preset_of(dataclasses.replace(preset, wave_limit=0.3)) == ""
    faster = conditions_of({"action_delay": 2}, SPATIAL_PRESETS)
    assert faster == dataclasses.replace(SPATIAL_PRESETS["field"], action_delay=2)


def test_conditions_may_be_fields_on_top_of_field() -> None:
    expected = dataclasses.replace(PRESETS["field"], thruster_time_constant=0.2)
    assert conditions_of({"thruster_time_constant": 0.2}) == expected
    assert conditions_of(expected) is expected
    for wrong, named_ in (("mild", "ideal, field, basin, sea"), ({"lag": 0.1}, "lag"), (3, "3")):
        with pytest.raises(ValueError, match=named_):
            conditions_of(wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"thruster_dead_band": -0.1}, "thruster_dead_band.*greater than or equal to 0"),
        ({"thruster_dead_band": 1001.0}, "thruster_dead_band.*less than or equal to 1000"),
        ({"thruster_dead_band": 20.1}, "thruster_dead_band is 20.1; allowed: up to .* = 20.0"),
        ({"thruster_gain_range": [0.0, 1.0]}, "thruster_gain_range.*greater than or equal to 0.01"),
        ({"thruster_gain_range": [1.0, 101.0]}, "thruster_gain_range.*less than or equal to 100"),
        ({"thruster_gain_range": [1.2, 0.8]}, r"thruster_gain_range.*\(1.2, 0.8\).*low <= high"),
        ({"thruster_gain_range": 1.0}, "thruster_gain_range"),
        ({"position_period": 0}, "position_period.*greater than or equal to 1"),
        ({"position_period": 0.5}, "position_period.*integer"),
        ({"position_period": 1001}, "position_period.*less than or equal to 1000"),
        ({"position_period": None}, "position_period.*integer"),
        ({"position_delay": 1.5}, "position_delay.*integer"),
        ({"position_delay": 101}, "position_delay.*less than or equal to 100"),
        ({"position_missing": 1.0}, "position_missing.*less than or equal to 0.99"),
        ({"position_missing": -0.1}, "position_missing.*greater than or equal to 0"),
        ({"velocity_period": 0}, "velocity_period.*greater than or equal to 1"),
        ({"velocity_period": 2.5}, "velocity_period.*integer"),
        ({"velocity_delay": 0.1}, "velocity_delay.*integer"),
        ({"velocity_noise": 1.1}, "velocity_noise.*less than or equal to 1"),
        ({"tail_angle_noise": -1e-3}, "tail_angle_noise.*greater than or equal to 0"),
        ({"joint_angle_noise": 2.0}, "joint_angle_noise.*less than or equal to 1"),
        ({"rate_noise": float("nan")}, "rate_noise.*finite"),
        ({"wave_limit": 5.1}, "wave_limit.*less than or equal to 5"),
        ({"coefficient_spread": 1.0}, "coefficient_spread.*less than or equal to 0.99"),
        ({"shift_gap_range": [6.0, 4.0]}, r"shift_gap_range.*\(6.0, 4.0\).*low <= high"),
        ({"shift_gap_range": [3.9, 6.0]}, "shift_gap_range.*greater than or equal to 4"),
        ({"shift_gap_range": [4.0, 31.0]}, "shift_gap_range.*less than or equal to 30"),
    ],
)
def test_what_is_not_allowed_is_said_on_one_line(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as error:
        conditions_of(fields)
    assert "\n" not in str(error.value)
