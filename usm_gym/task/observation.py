"""The observation: the one table of what is in it, where, in which unit, scale and bounds."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from usm_gym.plant.measure import ENTRIES


@dataclass(frozen=True)
class Entry:
    """One quantity of the observation.

    Attributes:
        name: Its name.
        size: How many numbers it has.
        unit: Unit of the physical value.
        scale: What the physical value is divided by.
        bound: Largest physical value, either sign; live values stay inside.
        meaning: What it is and where a real robot has it from.
    """

    name: str
    size: int
    unit: str
    scale: float
    bound: float
    meaning: str


class Layout(ABC):
    """A table of entries, and what follows from it."""

    @property
    @abstractmethod
    def entries(self) -> tuple[Entry, ...]:
        """All entries in order."""

    @cached_property
    def starts(self) -> NDArray[np.int64]:
        """Index of the first number of each entry, and the size of the whole, int64."""
        sizes = [entry.size for entry in self.entries]
        return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    @property
    def size(self) -> int:
        """How many numbers an observation has."""
        return int(self.starts[-1])

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where each entry stands, by name."""
        return {
            entry.name: slice(int(start), int(start) + entry.size)
            for entry, start in zip(self.entries, self.starts, strict=False)
        }

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        """Physical value = observation * scale, shape (size,)."""
        return np.concatenate([np.full(entry.size, entry.scale) for entry in self.entries])

    @cached_property
    def bound(self) -> NDArray[np.float32]:
        """Bound of each number of the observation, as it is returned, shape (size,), float32."""
        bounds = [np.full(entry.size, entry.bound / entry.scale) for entry in self.entries]
        return np.concatenate(bounds).astype(np.float32)

    @property
    def space(self) -> gym.Space[NDArray[np.float32]]:
        """The observation space."""
        return gym.spaces.Box(-self.bound, self.bound, dtype=np.float32)

    @property
    def fingerprint(self) -> str:
        """A hash of the whole table, by which agents know the layout they were trained on."""
        return hashlib.sha256(self.table().encode()).hexdigest()[:16]

    def table(self) -> str:
        """The table in Markdown, as the environments' documentation shows it."""
        lines = ["| index | entry | unit | scale | bound | meaning |", "|---|---|---|---|---|---|"]
        for entry in self.entries:
            part = self.slices[entry.name]
            index = str(part.start) if entry.size == 1 else f"{part.start}-{part.stop - 1}"
            lines.append(
                f"| {index} | `{entry.name}` | {entry.unit} | {entry.scale:g} | "
                f"{entry.bound:g} | {entry.meaning} |"
            )
        return "\n".join(lines)


@dataclass(frozen=True)
class ObservationLayout(Layout):
    """The layout of the observation of a robot, the same in both modes.

    Attributes:
        links: Number of links.
        thrusters: Number of thrusters.
    """

    links: int
    thrusters: int

    @cached_property
    def entries(self) -> tuple[Entry, ...]:
        """All entries in order."""
        joints, thrusters = self.links - 1, self.thrusters
        table = (
            Entry(
                "position_error",
                2,
                "m",
                0.01,
                0.5,
                "measured position minus its reference (x, y), global frame",
            ),
            Entry("reference_velocity", 2, "m/s", 0.1, 5.0, "velocity of the reference (x, y)"),
            Entry(
                "reference_acceleration",
                2,
                "m/s^2",
                0.1,
                5.0,
                "acceleration of the reference (x, y)",
            ),
            Entry("tail_angle", 1, "rad", 1.0, 100.0, "angle of link 1, never wrapped (compass)"),
            Entry("tail_rate", 1, "rad/s", 1.0, 100.0, "its rate (gyro)"),
            Entry(
                "joint_angles",
                joints,
                "rad",
                0.1,
                10.0,
                "theta_i - theta_(i+1), from the tail (encoders)",
            ),
            Entry("joint_rates", joints, "rad/s", 0.5, 100.0, "their rates (encoders)"),
            Entry("joint_references", joints, "rad", 0.1, 10.0, "joint references, from the tail"),
            Entry("joint_reference_rates", joints, "rad/s", 0.5, 100.0, "their rates"),
            Entry(
                "joint_reference_accelerations",
                joints,
                "rad/s^2",
                5.0,
                1000.0,
                "their accelerations",
            ),
            Entry("heading_error", 1, "rad", 0.1, 100.0, "heading minus its reference"),
            Entry(
                "thruster_command",
                thrusters,
                "1",
                1.0,
                1.1,
                "last command over the thruster limit, after saturation",
            ),
            Entry("thruster_limit", 1, "N", 20.0, 1000.0, "largest force of a thruster"),
        )
        assert tuple(entry.name for entry in table) == ENTRIES
        return table
