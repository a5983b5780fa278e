"""Numbers in words, tables and pages."""

from __future__ import annotations

import math
from collections.abc import Sequence


def figures(value: float) -> str:
    """A number to three figures, without an exponent."""
    decimals = 2 - math.floor(math.log10(abs(value))) if value else 2
    return f"{value:.{min(max(decimals, 0), 6)}f}"


def mm(metres: float) -> str:
    """A length in mm to three figures."""
    return figures(1e3 * metres)


def listed(words: Sequence[str]) -> str:
    """Words as a sentence lists them: "x", "x and y", "x, y and z"."""
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last
