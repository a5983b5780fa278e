"""What a robot senses: the table of an observation, and how its numbers are read.

A table gives the name, size, unit, scale and bound of every entry. Where an entry stands follows
from the order.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from usm_gym.kernels.compile import piece


class Table(NamedTuple):
    """The layout of the observation, for kernels.

    Attributes:
        starts: First indices of the entries, and the size of the whole, int64.
        gain: Observed value over physical value, by number.
        bound: Bounds of the observed numbers, float32.
    """

    starts: NDArray[np.int64]
    gain: NDArray[np.float64]
    bound: NDArray[np.float32]


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
        """Indices of the first numbers of the entries, and the size of the whole, int64."""
        sizes = [entry.size for entry in self.entries]
        return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)

    @property
    def size(self) -> int:
        """How many numbers an observation has."""
        return int(self.starts[-1])

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Where the entries stand, by name."""
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
        """Bounds of the numbers of the observation, as it is returned, shape (size,), float32."""
        bounds = [np.full(entry.size, entry.bound / entry.scale) for entry in self.entries]
        return np.concatenate(bounds).astype(np.float32)

    @property
    def space(self) -> gym.Space[NDArray[np.float32]]:
        """The observation space."""
        return gym.spaces.Box(-self.bound, self.bound, dtype=np.float32)

    @cached_property
    def kernel_table(self) -> Table:
        """The table in the form that kernels take which fill in an observation."""
        return Table(self.starts, 1.0 / self.scale, self.bound)

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


@piece
def value(observation, table, entry, index):
    """One number of an observation in its physical unit.

    `table` has the fields `starts`, as in `Table`, and `scale`, physical value over observed value.
    """
    k = table.starts[entry] + index
    return observation[k] * table.scale[k]


@piece
def known(observation, table, entry, index):
    """The same, `table` being a `Table`, while an observation is filled in."""
    k = table.starts[entry] + index
    return observation[k] / table.gain[k]


@piece
def put(observation, table, entry, index, value):
    """Fill in one number of an observation from its physical value."""
    k = table.starts[entry] + index
    observation[k] = value * table.gain[k]
