"""Types of validated fields, and the one sentence that refuses bad input."""

from __future__ import annotations

import functools
import reprlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Annotated, Any, TypeVar, dataclass_transform

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, Strict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

T = TypeVar("T")

CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)

Number = Annotated[float, Strict()]
Count = Annotated[int, Strict(), Field(ge=1)]
Switch = Annotated[bool, Strict()]

# The most characters that an error quotes of an input, the most that it has itself, and the most
# faults of one input that it names.
QUOTED, SAID, FAULTS = 80, 1000, 3

_repr = reprlib.Repr()
_repr.maxlevel = 3
_repr.maxstring = _repr.maxother = _repr.maxlong = QUOTED


class UsageError(ValueError):
    """A mistake that the user can correct, in an argument, an option or a file.

    The `usm` command answers with one line. All other exceptions except `OSError` are our own bugs.
    """


@contextmanager
def explaining(what: str) -> Iterator[None]:
    """Put an explanation before the reason for which an input is refused.

    Args:
        what: The explanation, for instance "mine.json is no file of gains".

    Raises:
        UsageError: If the block refuses the input.
    """
    try:
        yield
    except (UsageError, ValidationError) as error:
        raise UsageError(f"{what}: {in_one_line(error)}") from error


def require(condition: object, name: str, value: object, allowed: str) -> None:
    """Raise a `UsageError` that names the argument, its value and what is allowed.

    Args:
        condition: Whether the value is acceptable.
        name: Name of the argument or field.
        value: The value; `brief` shortens it.
        allowed: The values that are allowed, in words.

    Raises:
        UsageError: If the condition does not hold.
    """
    if not condition:
        raise UsageError(f"{clipped(name)} is {brief(value)}; allowed: {clipped(allowed, SAID)}")


def is_whole(value: object, low: int, high: int | None = None) -> bool:
    """Whether a value is an integer from `low` to `high`, and not a bool."""
    if not isinstance(value, (int, np.integer)) or isinstance(value, bool):
        return False
    return bool(low <= value and (high is None or value <= high))


def real_array(name: str, value: object, allowed: str = "real numbers") -> NDArray[Any]:
    """Convert a value to an array and keep its type of number.

    Raises:
        ValueError: If it holds anything but real numbers.
    """
    try:
        array = np.asarray(value)
    except Exception as error:  # a foreign object may raise anything
        raise UsageError(f"{name} is {brief(value)}; allowed: {allowed}") from error
    require(array.dtype.kind in "biuf", name, value, allowed)
    return array


@dataclass_transform(frozen_default=True)
def validated(cls: type[T]) -> type[T]:
    """Make a frozen dataclass whose fields are validated.

    A wrong field raises a `UsageError` of one line, where pydantic's own error has many.
    """
    made: Any = dataclass(frozen=True, config=CONFIG)(cls)
    init = made.__init__

    @functools.wraps(init)
    def checked(self: Any, *arguments: Any, **fields: Any) -> None:
        try:
            init(self, *arguments, **fields)
        except ValidationError as error:
            raise UsageError(in_one_line(error)) from error

    made.__init__ = checked
    known: type[T] = made
    return known


def build(adapter: TypeAdapter[T], name: str, fields: Any, allowed: str = "a dict of fields") -> T:
    """Make an object of a validated type from a dict of its fields.

    Args:
        adapter: The type.
        name: Name of the argument that the dict was given for.
        fields: Values by name; missing ones have their defaults.
        allowed: The values that are allowed, in words.

    Raises:
        ValueError: If it is not a dict, a field is unknown, or a value is not allowed.
    """
    require(isinstance(fields, Mapping), name, fields, allowed)
    try:
        known = dict(fields)
    except Exception as error:  # a foreign mapping may raise anything
        raise UsageError(f"{name} is {brief(fields)}; allowed: {allowed}") from error
    require(all(isinstance(field, str) for field in known), name, fields, allowed)
    try:
        return adapter.validate_python(known)
    except ValidationError as error:
        raise UsageError(in_one_line(error)) from error


def brief(value: object) -> str:
    """Quote any value in one line of at most `QUOTED` characters."""
    try:
        return clipped(_repr.repr(value))
    except ValueError:  # Python refuses to print an integer of very many digits
        return f"<{type(value).__name__}>"


def clipped(text: str, most: int = QUOTED) -> str:
    """Put a text on one line of at most `most` characters; a longer one loses its middle."""
    line = " ".join(text[: 10 * most].split())
    if len(line) <= most and len(text) <= 10 * most:
        return line
    tail = " ".join(text[-most:].split())
    return f"{line[: most // 2]}...{tail[-(most // 2 - 3) :]}"


def in_one_line(error: BaseException) -> str:
    """Write an exception in one line, with the value of every wrong field."""
    if isinstance(error, ValidationError):
        return _faults(error)
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        said = "No such file" if isinstance(error, FileNotFoundError) else error.strerror
        # Paths are long, and useless without their middle.
        return f"{said}: {clipped(str(error.filename), 3 * QUOTED)}"
    if isinstance(error, KeyError) and error.args:
        return f"{brief(error.args[0])} is missing"
    return clipped(str(error), SAID)


def _faults(error: ValidationError) -> str:
    faults = [_fault(fault) for fault in error.errors(include_url=False)[:FAULTS]]
    more = error.error_count() - len(faults)
    return "; ".join(faults) + (f"; and {more} more" if more else "")


def _fault(fault: Any) -> str:
    if fault["type"] == "value_error":  # one of ours, complete in itself
        return clipped(fault["msg"].removeprefix("Value error, "), SAID)
    field = clipped(".".join(str(part) for part in fault["loc"]))
    if fault["type"] == "missing":
        return f"{field} is missing"
    return f"{field} is {brief(fault['input'])}: {fault['msg']}"
