"""What the scenarios of plane and space have in common: their length, their robot, their JSON."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cache
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, Strict, TypeAdapter

from usm_gym.manipulator import bare
from usm_gym.robots import name_of
from usm_gym.support.validation import Number, build, require
from usm_gym.task.conditions import Conditions, require_whole_steps

Time = Annotated[Number, Field(ge=0, le=3600)]
Duration = Annotated[Number, Field(ge=1e-6, le=3600)]
Seed = Annotated[int, Strict(), Field(ge=0, lt=2**64)]
LookAhead = Annotated[Number, Field(ge=0.01, le=1000)]


class BaseScenario(ABC):
    """What a validated dataclass of scenarios inherits.

    Attributes:
        usual: Name of the robot that goes without saying.
    """

    usual: ClassVar[str]
    conditions: Conditions
    duration: float
    robot: Any

    def __post_init__(self) -> None:
        """Refuse a duration of no whole number of control periods or too many steps, and names."""
        if self.robot != self.usual:
            # Another process need not know a name that was given here.
            body = bare(self.body)
            robot = self.usual if name_of(body) == self.usual else body
            object.__setattr__(self, "robot", robot)
        require_whole_steps(self.duration, self.conditions)

    @property
    @abstractmethod
    def body(self) -> Any:
        """The robot."""

    @property
    def steps(self) -> int:
        """Control periods in the episode."""
        return round(self.duration / self.conditions.control_period)

    def to_dict(self) -> dict[str, Any]:
        """The scenario in JSON's types; the usual robot goes without saying."""
        data: dict[str, Any] = _adapter(type(self)).dump_python(self, mode="json")
        if data["robot"] == self.usual:
            del data["robot"]
        return data

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read what `to_dict` wrote; fields left out have their defaults.

        Raises:
            ValueError: If a key is unknown, or a value of the wrong type or out of range.
        """
        scenario: Self = build(_adapter(cls), "scenario", data)
        return scenario


def require_rising(times: tuple[float, ...]) -> None:
    """Raise a `ValueError` unless each time is later than the one before."""
    rising = all(a < b for a, b in pairwise(times))
    require(rising, "times", times, "rising times")


@cache
def _adapter(kind: type[Any]) -> TypeAdapter[Any]:
    return TypeAdapter(kind)
