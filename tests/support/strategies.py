"""Hostile input for hypothesis: odd values, almost valid fields, and valid extremes."""

from __future__ import annotations

import dataclasses
import math
import typing
from typing import Any

import numpy as np
from hypothesis import strategies as st
from pydantic import TypeAdapter


class Odd:
    """An object that does nothing that is expected of one."""

    def __repr__(self) -> str:
        raise RuntimeError("no text")

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("no array")

    def __bool__(self) -> bool:
        raise RuntimeError("neither true nor false")


NUMBERS = st.one_of(
    st.integers(),
    st.floats(),
    st.sampled_from([0, -0.0, 1e-320, 1e308, -1e308, math.inf, math.nan, 2**63, -(10**400)]),
)
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    NUMBERS,
    st.text(max_size=20),
    st.binary(max_size=8),
    st.complex_numbers(),
    st.sampled_from(["x" * 10**5, "\ud800", "../../etc/passwd", "os:system", "sta@/dev/zero"]),
)
# What JSON may hold.
JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=20)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=8,
)
# What a Python caller may hand over.
ANYTHING = st.one_of(
    SCALARS,
    JSON,
    st.builds(Odd),
    st.just(object()),
    st.sampled_from(
        [np.float64(1.0), np.int64(3), np.zeros(3), np.array("a"), np.nan, int, {1: 2}]
    ),
    st.sets(st.integers(), max_size=3),
)


def numbers_of(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Numbers of a schema's range, its ends among them."""
    low = schema.get("minimum", schema.get("exclusiveMinimum"))
    high = schema.get("maximum", schema.get("exclusiveMaximum"))
    if schema["type"] == "integer":
        high -= "exclusiveMaximum" in schema
        return st.one_of(st.sampled_from([low, high]), st.integers(low, high))
    ends = st.sampled_from([float(low), float(high)])
    return st.one_of(ends, st.floats(low, high, allow_subnormal=False))


def valid(schema: dict[str, Any], defs: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Values that a JSON schema of pydantic allows, extremes among them."""
    if "$ref" in schema:
        return valid(defs[schema["$ref"].rpartition("/")[2]], defs)
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    if "const" in schema:
        return st.just(schema["const"])
    if "anyOf" in schema:
        return st.one_of([valid(each, defs) for each in schema["anyOf"]])
    kind = schema.get("type")
    if kind == "object" and "properties" in schema:
        optional = {name: valid(each, defs) for name, each in schema["properties"].items()}
        needed = {name: optional.pop(name) for name in schema.get("required", ())}
        return st.fixed_dictionaries(needed, optional=optional)
    if kind == "object":
        values = schema.get("additionalProperties")
        inner = valid(values, defs) if isinstance(values, dict) else JSON
        return st.dictionaries(st.text(max_size=8), inner, max_size=3)
    if kind == "array" and "prefixItems" in schema:
        return st.tuples(*(valid(each, defs) for each in schema["prefixItems"])).map(list)
    if kind == "array":
        most = min(schema.get("maxItems", 8), 8)
        return st.lists(
            valid(schema["items"], defs), min_size=schema.get("minItems", 0), max_size=most
        )
    if kind in ("number", "integer"):
        return numbers_of(schema)
    return {"boolean": st.booleans(), "null": st.none(), "string": st.text(max_size=20)}[kind]


def fields_in_range(cls: type) -> st.SearchStrategy[dict[str, Any]]:
    """Fields of a validated dataclass, each within its range."""
    schema = TypeAdapter(cls).json_schema()
    return typing.cast(Any, valid(schema, schema.get("$defs", {})))


def almost_fields(cls: type, odd: st.SearchStrategy[Any] = ANYTHING) -> st.SearchStrategy[Any]:
    """Fields of a validated dataclass, of which one or more are replaced by something odd."""
    names = [field.name for field in dataclasses.fields(cls)]
    return st.builds(
        lambda good, bad: {**good, **bad},
        fields_in_range(cls),
        st.dictionaries(
            st.one_of(st.sampled_from(names), st.text(max_size=8)), odd, min_size=1, max_size=3
        ),
    )
