"""Writes numbers in sentences, tables and pages."""

from __future__ import annotations

import math
from collections.abc import Sequence


def figures(value: float) -> str:
    """Write a number with three significant figures and no exponent."""
    return f"{value:.{_decimals(value)}f}"


def give_or_take(value: float, margin: float) -> str:
    """Write a number with three significant figures and its margin to the same decimal."""
    return f"{figures(value)} ± {margin:.{_decimals(value)}f}"


def mm(metres: float) -> str:
    """Write a length in mm with three significant figures."""
    return figures(1e3 * metres)


def degrees(radians: float) -> str:
    """Write an angle in degrees with three significant figures."""
    return figures(math.degrees(radians))


def counted(number: int, thing: str) -> str:
    """Count things as in a sentence: "1 episode", "2 episodes"."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def listed(words: Sequence[str]) -> str:
    """List words as in a sentence: "x", "x and y", "x, y and z"."""
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last


def _decimals(value: float) -> int:
    decimals = 2 - math.floor(math.log10(abs(value))) if value else 2
    return min(max(decimals, 0), 6)
