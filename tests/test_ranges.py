"""Every number that a user gives has a range, and its documentation says which."""

import dataclasses
import re
import typing

import pytest
from pydantic import TypeAdapter
from usm_agents.artifact.folder import Agent
from usm_agents.learning.plan import Plan
from usm_baselines.gains import Budget, GainsFile

from usm_gym import (
    Conditions,
    Inspection,
    Link,
    Path,
    Robot,
    Scan,
    Scenario,
    SpatialPath,
    SpatialRobot,
    SpatialScenario,
    SpatialThruster,
    SpatialWater,
    SpatialWave,
    Thruster,
    Water,
    Wave,
)

CLASSES = [
    *(Robot, Thruster, Conditions, Path, Inspection, Water, Wave, Scenario),
    *(SpatialRobot, Link, SpatialThruster, SpatialPath, Scan, SpatialWater, SpatialWave),
    SpatialScenario,
    *(Plan, Agent, GainsFile, Budget),
]
NUMBER = r"(?<![\w.^])-?\d+(?:\.\d+)?(?:e-?\d+)?"
LIMITS = {"minimum", "exclusiveMinimum"}, {"maximum", "exclusiveMaximum"}


def numbers(schema: dict[str, typing.Any]) -> list[dict[str, typing.Any]]:
    """All schemas of numbers inside the schema of a field, objects of their own left out."""
    if not isinstance(schema, dict):
        return []
    if schema.get("type") in ("number", "integer"):
        return [schema]
    inner = [*schema.get("anyOf", []), *schema.get("prefixItems", [])]
    inner += [schema[key] for key in ("items", "additionalProperties") if schema.get(key)]
    return [each for part in inner for each in numbers(part)]


def fields(cls: type) -> list[tuple[str, dict[str, typing.Any]]]:
    properties = TypeAdapter(cls).json_schema()["properties"]
    return [(name, each) for name, schema in properties.items() for each in numbers(schema)]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_every_number_has_a_range(cls):
    for name, schema in fields(cls):
        for limits in LIMITS:
            assert limits & set(schema), f"{cls.__name__}.{name}"


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_the_documentation_states_the_range(cls):
    text = " ".join(cls.__doc__.split())
    names = [field.name for field in dataclasses.fields(cls)]
    for name, schema in fields(cls):
        following = names[names.index(name) + 1 :]
        end = rf"(?= {following[0]}:|$)" if following else "$"
        (line,) = re.findall(rf"\b{name}: (.*?){end}", text)
        stated = {float(each) for each in re.findall(NUMBER, line)}
        for limits in LIMITS:
            (limit,) = limits & set(schema)
            assert schema[limit] in stated or "2^" in line, f"{cls.__name__}.{name}: {line}"
