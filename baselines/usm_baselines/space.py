"""Ranges of gains, declared beside each law and read by the tuner."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from usm_gym.support.validation import require


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


Space = Mapping[str, Range]
