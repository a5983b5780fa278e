"""What `Vehicle` and `SpatialVehicle` share: named signals, rates and forces, allocation."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.support.validation import real_array, require
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

Array = NDArray[np.float64]

# Time constant of the filter behind a rate that is taken from positions, s.
RATE_FILTER = 0.02


class BaseVehicle(ABC):
    """The nominal robot as a controller deals with it, whatever world it is of.

    Attributes:
        nominal: The nominal knowledge.
        period: Control period, s.
        mass: Mass, without that of the water which moves along, kg.
    """

    def __init__(self, nominal: Nominal, kind: type, allowed: str) -> None:
        """Take what is known of the robot.

        Args:
            nominal: `env.unwrapped.nominal`.
            kind: The robot's class.
            allowed: What robots of this class are called.

        Raises:
            ValueError: If it is none, or that of a robot of another class.
        """
        require(isinstance(nominal, Nominal), "nominal", nominal, "a Nominal, as environments have")
        require(isinstance(nominal.robot, kind), "robot", nominal.robot, allowed)
        self.nominal = nominal
        self.period = nominal.control_period
        self.mass = float(nominal.robot.total_mass)
        self._world = world_of(nominal.robot)
        self._axes = len(self._world.axes)
        # A wrench is the forces along the axes and the moments about the controlled angles.
        self._wrench = self._axes + len(self._world.attitude)

    def allocate(self, force: ArrayLike, moment: ArrayLike, seen: SimpleNamespace) -> Array:
        """Share a force and moments out among the thrusters, with as little force as possible.

        The body's shape at the moment counts. What is beyond the limit of a thruster saturates when
        it is applied.

        Args:
            force: Force on the centre of mass, global frame, N, (..., axes).
            moment: Moments about it, N m, (..., controlled angles): in the plane one,
                anticlockwise; in space those about y and z of the middle link.
            seen: What `read` has returned.

        Returns:
            The action: commands over the thruster limit, (..., thrusters).

        Raises:
            ValueError: If a shape is wrong.
        """
        batch = seen.allocation.shape[:-2]
        sizes = {"force": self._axes, "moment": self._wrench - self._axes}
        wanted = []
        for (name, size), value in zip(sizes.items(), (force, moment), strict=True):
            array = real_array(name, value)
            allowed = f"shape {(*batch, size)}"
            require(array.shape == (*batch, size), f"shape of the {name}", array.shape, allowed)
            wanted.append(array)
        wrench = np.concatenate(wanted, axis=-1)[..., np.newaxis]
        T = seen.allocation
        transposed = np.swapaxes(T, -1, -2)
        forces = transposed @ np.linalg.solve(T @ transposed, wrench)
        return np.asarray(forces[..., 0] / seen.thruster_limit)

    def read(
        self, observation: ArrayLike, memory: ArrayLike | None = None, episode_start: Any = None
    ) -> tuple[SimpleNamespace, Array]:
        """Read an observation, or a batch of them, in SI units.

        Every entry of the observation is an attribute of what is seen, (..., size of the entry), an
        entry of one number included; the class has a table of the others.

        Args:
            observation: (..., numbers), as environments give it.
            memory: What the last call returned; None at the start.
            episode_start: Where an episode has just begun, so that the memory is dropped: a bool or
                an array of them, (...).

        Returns:
            What is seen, and the memory for the next call.

        Raises:
            ValueError: If a shape is wrong.
        """
        given, layout = real_array("observation", observation), self._world.layout
        shape, allowed = given.shape, f"({layout.size},) or (batch, {layout.size})"
        require(shape[-1:] == (layout.size,), "the observation's shape", shape, allowed)
        values = given * layout.scale
        seen = SimpleNamespace(**{name: values[..., part] for name, part in layout.slices.items()})
        thrusters, rows = self._world.thrusters, self._wrench + len(self._world.watched)
        allocation = np.empty((math.prod(shape[:-1]), rows, thrusters))
        self._world.allocate(given.reshape(-1, layout.size).astype(np.float32), allocation)
        seen.allocation = allocation[:, : self._wrench].reshape(
            *shape[:-1], self._wrench, thrusters
        )
        kept = self._remember(seen, self._memory(shape[:-1], memory, episode_start))
        self._complete(seen)
        return seen, kept

    @abstractmethod
    def _complete(self, seen: SimpleNamespace) -> None:
        """Add what follows from it for a robot of this world."""

    def _memory(self, batch: tuple[int, ...], memory: ArrayLike | None, start: Any) -> Array:
        """Whether the episode has begun, age and value of the position, rate, thruster forces."""
        shape = (*batch, 2 + 2 * self._axes + self._world.thrusters)
        if memory is None:
            return np.zeros(shape)
        kept = np.array(real_array("memory", memory), np.float64)
        require(kept.shape == shape, "shape of the memory", kept.shape, f"{shape}")
        kept[np.broadcast_to(np.asarray(start, bool), batch)] = 0.0
        return kept

    def _remember(self, seen: SimpleNamespace, memory: Array) -> Array:
        """Move the memory on by an observation, and fill in what follows from it."""
        ends = np.cumsum([1, 1, self._axes, self._axes])
        began, age, error, slow, forces = np.split(memory, ends, axis=-1)
        begun = began > 0.0
        # Between two measured positions; no new one, no time.
        passed = age + self.period - seen.position_age
        fresh = passed > 0.5 * self.period
        slope = (seen.position_error - error) / np.where(fresh, passed, 1.0)
        share = np.where(fresh, -np.expm1(-np.maximum(passed, 0.0) / RATE_FILTER), 0.0)
        rate = slow + share * (slope - slow)
        rate = np.where(begun, rate, -seen.reference_velocity)
        measured = seen.velocity_age >= 0.0
        seen.velocity_error = np.where(measured, seen.velocity - seen.reference_velocity, rate)
        command = seen.thruster_command * seen.thruster_limit
        target = np.where(np.abs(command) >= self.nominal.thruster_dead_band, command, 0.0)
        lag = self.nominal.thruster_time_constant
        way = 1.0 if lag == 0.0 else -math.expm1(-self.period / lag)
        seen.thruster_forces = forces + way * (target - forces)
        seen.wrench = (seen.allocation @ seen.thruster_forces[..., np.newaxis])[..., 0]
        kept = (np.ones_like(begun, float), seen.position_age, seen.position_error, rate)
        return np.concatenate([*kept, seen.thruster_forces], axis=-1)
