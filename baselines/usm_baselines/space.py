"""Gains as a law declares them, and the space in which they are tuned."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from usm_gym.support.validation import require
from usm_gym.task.modes import in_space


@dataclass(frozen=True)
class Range:
    """Where a gain is looked for.

    Attributes:
        low: Smallest value.
        high: Largest value.
        unit: Unit of the gain.
        log: Whether the scale is logarithmic.
    """

    low: float
    high: float
    unit: str
    log: bool = True

    def __post_init__(self) -> None:
        """Refuse an empty range, and a logarithmic one that does not stay above 0."""
        require(self.low < self.high, "high", self.high, f"a number > low = {self.low}")
        require(self.low > 0 or not self.log, "low", self.low, "a number > 0 on a log scale")

    def at(self, place: float) -> float:
        """The value that lies at a place."""
        if not self.log:
            return self.low + place * (self.high - self.low)
        value: float = self.low * (self.high / self.low) ** place
        return min(max(value, self.low), self.high)

    def place(self, value: float) -> float:
        """Where a value lies, on the scale of the range: 0 at its low end, 1 at its high end."""
        low, high = self.low, self.high
        if self.log:
            low, high, value = math.log(low), math.log(high), math.log(value)
        return (value - low) / (high - low)


Space = Mapping[str, Range]
# Where gains are looked for in space, if elsewhere than in the plane: what noise an observer makes
# has to move 86 kg there, which takes longer, too. Over a horizon as short as the thrusters' lag,
# `mpc` loses the robot.
SPATIAL_RANGES = {
    "observer_gain": Range(1e-4, 100.0, "m/s^3"),
    "horizon": Range(0.1, 1.5, "s"),
}
# Gains that have no effect in space, where attitude controllers look ahead anyway.
PLANAR = ("heading_lead",)
# What stands before the names of the gains of the law that holds the body, under a law for the
# head.
OF_BODY = "body_"


class Gain(float):
    """The default of a gain, and what else there is to say of it.

    A law's gains are a `NamedTuple` with one of these per gain:

        k_p: float = Gain(1300.0, "N/m", "proportional gain", tuned=(30.0, 30000.0))

    In computations it is the number, and its copies and pickles are plain numbers.

    Attributes:
        unit: Unit of the gain.
        meaning: What it is.
        tuned: Where it is tuned, on a logarithmic scale; None if it is not.
        positive: Whether it has to be larger than 0.
    """

    unit: str
    meaning: str
    tuned: Range | None
    positive: bool

    def __new__(
        cls,
        default: float,
        unit: str,
        meaning: str,
        *,
        tuned: tuple[float, float] | None = None,
        positive: bool = False,
    ) -> Self:
        """Declare a gain; `tuned` has its smallest and its largest value."""
        gain = super().__new__(cls, default)
        gain.unit, gain.meaning, gain.positive = unit, meaning, positive
        gain.tuned = None if tuned is None else Range(*tuned, unit)
        return gain

    def __reduce__(self) -> tuple[type[float], tuple[float]]:
        return float, (float(self),)


def declared(gains: type[Any]) -> dict[str, Gain]:
    """The declarations in a `NamedTuple` of gains, by name."""
    return {name: gains._field_defaults[name] for name in gains._fields}


def chosen_gains(kind: type[Any], given: Mapping[str, float]) -> Any:
    """The gains of a law, a `NamedTuple`, some of which are given by name.

    Raises:
        ValueError: If one is not finite, is negative, or is 0 and has to be positive.
    """
    chosen = kind(**given)
    for name, gain in declared(kind).items():
        value = getattr(chosen, name)
        number = isinstance(value, (int, float)) and math.isfinite(value) and value >= 0
        require(number, name, value, "a finite number >= 0")
        require(value > 0 or not gain.positive, name, value, "a number > 0")
    return kind(*map(float, chosen))


def in_mode(space: Space, mode: str) -> Space:
    """The space in which the gains of a law are tuned in a mode, in the plane or in space."""
    if not in_space(mode):
        return space
    spans = {
        name: SPATIAL_RANGES.get(name.removeprefix(OF_BODY), span) for name, span in space.items()
    }
    return {name: span for name, span in spans.items() if name.removeprefix(OF_BODY) not in PLANAR}


def space_of(gains: type[Any], **others: Range) -> Space:
    """Where the gains of a `NamedTuple` are tuned, in its order.

    Args:
        gains: The `NamedTuple`.
        others: Ranges in the place of those declared, by name.
    """
    ranges = {name: others.get(name, gain.tuned) for name, gain in declared(gains).items()}
    return {name: span for name, span in ranges.items() if span is not None}
