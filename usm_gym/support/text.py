"""Numbers in words, tables and pages."""

from __future__ import annotations

import math


def figures(value: float) -> str:
    """A number to three figures, without an exponent."""
    decimals = 2 - math.floor(math.log10(abs(value))) if value else 2
    return f"{value:.{min(max(decimals, 0), 6)}f}"


def mm(metres: float) -> str:
    """A length in mm to three figures."""
    return figures(1e3 * metres)
