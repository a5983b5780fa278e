"""Results as files: every kind is a frozen dataclass that is checked when it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar, Self

from pydantic import (
    SerializerFunctionWrapHandler,
    TypeAdapter,
    model_serializer,
    model_validator,
)

from usm_gym.support.files import read_json, write_json
from usm_gym.support.provenance import provenance
from usm_gym.support.validation import Number, explaining, require, validated

Interval = tuple[Number, Number]


@validated
class Part:
    """A part of a result.

    In JSON, the entries of the field named by `beside` are beside the other fields. A field whose
    default is None is left out while it is None. `order` names the fields in the order of the JSON,
    if that differs from their own.
    """

    beside: ClassVar[str] = ""
    order: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def _gather(cls, data: Any) -> Any:
        if not cls.beside or not isinstance(data, Mapping):
            return data
        others = {field.name for field in fields(cls)} - {cls.beside}
        known = {name: value for name, value in data.items() if name in others}
        return known | {cls.beside: {k: value for k, value in data.items() if k not in others}}

    @model_serializer(mode="wrap")
    def _spread(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        defaults = {field.name: field.default for field in fields(self)}
        values = handler(self)
        data: dict[str, Any] = {}
        for name in self.order or defaults:
            value = values[name]
            if name == self.beside:
                data |= value
            elif value is not None or defaults[name] is not None:
                data[name] = value
        return data


@validated
class Provenance:
    """The origin of a result.

    Attributes:
        version: Version of usm-gym.
        commit: Commit of its checkout; None without a checkout.
        packages: Versions of Python and of the packages on which numbers may depend.
        seeds: The seeds on which it depends, or their origin.
        command: The command that made it.
    """

    version: str | None
    commit: str | None
    packages: dict[str, str]
    seeds: dict[str, Any]
    command: str

    @classmethod
    def here(cls, seeds: Mapping[str, Any]) -> Self:
        """Describe what this process makes from some seeds."""
        return cls(**provenance(seeds))


class Result:
    """A result in a JSON file; every kind of result is a validated dataclass.

    Attributes:
        kind: Name of the kind.
        form: Version of its fields; a file states it under "form" unless it is 1.
        marked: Whether its files state their kind.
    """

    kind: ClassVar[str]
    form: ClassVar[int] = 1
    marked: ClassVar[bool] = True

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read a result.

        Raises:
            UsageError: If the file holds no result of this kind.
            OSError: If it cannot be read.
        """
        return cls.parsed(read_json(path), path)

    @classmethod
    def parsed(cls, document: Any, path: str | Path) -> Self:
        """Check the content of a file.

        Args:
            document: The content.
            path: The file.

        Raises:
            UsageError: If it is not a result of this kind.
        """
        with explaining(f"{path} is no complete {cls.kind}"):
            require(isinstance(document, Mapping), "content", document, "an object")
            content = dict(document)
            if cls.marked:
                kind = content.pop("kind", None)
                require(kind == cls.kind, "kind", kind, cls.kind)
            form = content.pop("form", 1)
            require(form == cls.form, "form", form, str(cls.form))
            return TypeAdapter(cls).validate_python(content)

    def document(self) -> dict[str, Any]:
        """Write the result in JSON's types."""
        head: dict[str, Any] = {"kind": self.kind} if self.marked else {}
        if self.form != 1:
            head["form"] = self.form
        body: dict[str, Any] = TypeAdapter(type(self)).dump_python(self, mode="json")
        return head | body

    def write(self, path: str | Path) -> None:
        """Write the result in one move."""
        write_json(path, self.document())
