"""Conditions: the presets, and fields on top of one."""

import dataclasses

import pytest

from usm_gym import Conditions
from usm_gym.task.conditions import PRESETS, conditions_of


def test_presets_are_those_of_the_documentation() -> None:
    shared = {
        "control_period": 0.02,
        "physics_step": 1e-3,
        "integrator": "midpoint",
        "hydrodynamics": "consistent",
        "drag": "linear and quadratic",
        "position_delay": 0,
        "action_delay": 0,
        "motion": True,
    }
    table = {  # ideal, field, rough
        "thruster_time_constant": (0.0, 0.05, 0.1),
        "thruster_limit": (100.0, 20.0, 15.0),
        "position_noise": (0.0, 5e-5, 2e-4),
        "current_limit": (0.0, 0.05, 0.1),
        "coefficient_range": ((1.0, 1.0), (0.8, 1.2), (0.6, 1.5)),
        "deflection_range": ((0.7, 1.75), (0.7, 1.75), (0.9, 2.1)),
        "filter_range": ((6.0, 12.0), (6.0, 12.0), (8.0, 14.0)),
    }
    for k, name in enumerate(("ideal", "field", "rough")):
        preset = dataclasses.asdict(PRESETS[name])
        variation = preset.pop("current_variation")
        assert (variation > 0.0) == (name == "rough")
        assert preset == shared | {field: values[k] for field, values in table.items()}
    assert conditions_of("rough") == PRESETS["rough"]
    assert Conditions() == PRESETS["field"]


def test_conditions_may_be_fields_on_top_of_field() -> None:
    expected = dataclasses.replace(PRESETS["field"], thruster_time_constant=0.2)
    assert conditions_of({"thruster_time_constant": 0.2}) == expected
    assert conditions_of(expected) is expected
    for wrong, named_ in (("mild", "ideal, field, rough"), ({"lag": 0.1}, "lag"), (3, "3")):
        with pytest.raises(ValueError, match=named_):
            conditions_of(wrong)  # type: ignore[arg-type]
