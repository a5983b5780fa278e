"""Families of policies, as a list of policies is ordered."""

from __future__ import annotations

from enum import Enum


class Family(Enum):
    """A family of policies: its name, and what its members have in common."""

    PD = (
        "PD and PID",
        "Push back against the error, its rate and in PID its sum: the first choice.",
    )
    SLIDING_MODE = (
        "Sliding mode",
        "Push with full gain towards the path, made smooth; super-twisting is the paper's own.",
    )
    OBSERVER = (
        "Disturbance observers",
        "Estimate the force that drives the robot off its path, and cancel it.",
    )
    OPTIMAL = (
        "Optimal and predictive",
        "Weigh error against thrust on a model of the robot, with or without its joint motion.",
    )
    ADAPTIVE = "Adaptive", "Identify the robot and the current while it swims."
    HEAD = (
        "For the head",
        "Move the joints so that the head follows its path, over a law that holds the body.",
    )
    LEARNED = (
        "Learned",
        "Networks trained in simulation: alone, beside a law, or telling a law what to believe.",
    )
    REFERENCE = "References", "Not to be chosen: they show the best and the worst that is possible."

    @property
    def title(self) -> str:
        """The name."""
        return self.value[0]

    @property
    def idea(self) -> str:
        """What its members do, in a line."""
        return self.value[1]
