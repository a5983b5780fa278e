"""The heading controller that all laws share, with no force beside it."""

from __future__ import annotations

from typing import NamedTuple

from usm_baselines.policy import HEADING_GAIN, ScriptedPolicy
from usm_baselines.signals import Array, Signals


class HeadingGains(NamedTuple):
    """The gain of the heading controller."""

    heading_gain: float = HEADING_GAIN


class Heading(ScriptedPolicy):
    """Holds the heading and lets the position go; a base for agents that learn all the rest."""

    Gains = HeadingGains

    def control(self, signals: Signals, state: Array, force: Array) -> None:
        """Ask for no force; see `ScriptedPolicy.control`."""
        force[:] = 0.0
