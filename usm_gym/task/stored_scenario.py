"""Scenarios as files of results hold them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Annotated, Any, ClassVar

from pydantic import Field, PlainSerializer, PlainValidator, TypeAdapter

from usm_gym.support.results import Part
from usm_gym.support.validation import require, validated
from usm_gym.task.modes import AnyScenario, read_scenario


@validated
class OtherScenario(Part):
    """A scenario of another world than those of this package, which a file can only describe.

    Attributes:
        world: Name of its type.
        fields: What it says, in JSON's types; in JSON these stand beside the name.
    """

    beside: ClassVar[str] = "fields"
    world: str
    fields: Mapping[str, Any]


def stored(value: Any) -> AnyScenario | OtherScenario:
    """A scenario of any world, or one in JSON's types, as results hold it.

    Raises:
        UsageError: If it is not a scenario.
    """
    if isinstance(value, AnyScenario | OtherScenario):
        return value
    if isinstance(value, Mapping):
        other = "world" in value
        return _OTHER.validate_python(value) if other else read_scenario(value)
    require(is_dataclass(value), "scenario", value, "a frozen dataclass, or a dict of fields")
    fields = TypeAdapter(type(value)).dump_python(value, mode="json")
    return OtherScenario(world=type(value).__name__, fields=fields)


def as_json(value: AnyScenario | OtherScenario) -> dict[str, Any]:
    """A scenario in JSON's types."""
    if not isinstance(value, OtherScenario):
        return value.to_dict()
    fields: dict[str, Any] = _OTHER.dump_python(value, mode="json")
    return fields


_OTHER = TypeAdapter(OtherScenario)
StoredScenario = Annotated[
    AnyScenario | OtherScenario, PlainValidator(stored), PlainSerializer(as_json, when_used="json")
]
StoredScenarios = Annotated[tuple[StoredScenario, ...], Field(min_length=1)]
