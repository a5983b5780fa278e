"""Types of validated fields, and the one sentence in which the packages refuse bad input."""

from __future__ import annotations

from typing import Annotated

from pydantic import ConfigDict, Field, Strict, ValidationError

CONFIG = ConfigDict(extra="forbid", allow_inf_nan=False)

Number = Annotated[float, Strict()]
Positive = Annotated[float, Strict(), Field(gt=0)]
NonNegative = Annotated[float, Strict(), Field(ge=0)]
Count = Annotated[int, Strict(), Field(ge=1)]
Switch = Annotated[bool, Strict()]


def require(condition: object, name: str, value: object, allowed: str) -> None:
    """Raise a `ValueError` that names the argument, its value and what is allowed.

    Args:
        condition: Whether the value is acceptable.
        name: Name of the argument or field.
        value: What was given.
        allowed: What would have been accepted, in words.

    Raises:
        ValueError: If the condition does not hold.
    """
    if not condition:
        raise ValueError(f"{name} is {value!r}; allowed: {allowed}")


def in_one_line(error: BaseException) -> str:
    """Say on one line what an exception says, each wrong field with its value."""
    if not isinstance(error, ValidationError):
        return " ".join(str(error).split())
    faults = []
    for fault in error.errors():
        if fault["type"] == "value_error":  # one of ours, complete in itself
            faults.append(fault["msg"].removeprefix("Value error, "))
        else:
            field = ".".join(str(part) for part in fault["loc"])
            faults.append(f"{field} is {fault['input']!r}: {fault['msg']}")
    return "; ".join(faults)
