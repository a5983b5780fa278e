"""Fills in the residual task's observation: one kernel for one robot, for many, for the policy."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from usm_baselines.estimation.estimator import LEADS, Estimate
from usm_baselines.estimation.foresight import NAMES
from usm_baselines.head import HeadLaw
from usm_baselines.policy import ScriptedPolicy

from usm_agents.residual.observation import ResidualLayout, base_entries, measured_by
from usm_agents.residual.posture import posture_of
from usm_gym.kernels.compile import compiled, piece
from usm_gym.manipulator import bare
from usm_gym.policy import Policy
from usm_gym.sensors import Layout
from usm_gym.world import world_of

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

# The entries that do not depend on base and robot, by name: their numbers in the table.
_NAMES = [entry.name for entry in ResidualLayout((), 0, 0, 0, (), ()).complete]
ENTRY: Any = namedtuple("ENTRY", _NAMES)(*range(len(_NAMES)))
# What is not shown to an agent after which the base acts. Where it corrects estimates, what it has
# corrected before is in the command.
NOT_YET = ("base_force", "base_moment")
HIDDEN = {"estimates": (*NOT_YET, "last_action"), "head": NOT_YET, "joints": NOT_YET}
FORESEEN = _NAMES.index(f"foreseen_error_{LEADS[0]}")  # the others follow


class Plain(NamedTuple):
    """How the plain observation is read.

    Attributes:
        scale: Physical value over observed value, by number.
        position_error: Index of the first number of an entry.
        position_age: The same.
        velocity_age: The same.
        thruster_command: The same.
        thruster_limit: The same.
    """

    scale: Array
    position_error: int
    position_age: int
    velocity_age: int
    thruster_command: int
    thruster_limit: int


def plain_of(layout: Layout) -> Plain:
    """How observations of a layout are read."""
    return Plain(layout.scale, *(layout.slices[name].start for name in Plain._fields[1:]))


class FrameTable(NamedTuple):
    """The layout of the agent's observation, for the kernel.

    Attributes:
        starts: Where the entries of `ENTRY` begin in a complete frame.
        base: Places in it of the base's shown state numbers, and columns there, (numbers, 2).
        shown: Which numbers of a complete frame are shown, in order.
        scale: Physical value over observed value, by number of the observation.
        bound: Bounds of the observed numbers, float32.
        complete: How many numbers a complete frame has.
    """

    starts: NDArray[np.int64]
    base: NDArray[np.int64]
    shown: NDArray[np.int64]
    scale: Array
    bound: NDArray[np.float32]
    complete: int


@piece
def physical(seen, plain, index):
    """One number of a plain observation in its physical unit."""
    return seen[index] * plain.scale[index]


@piece
def fill_axes(frame, starts, seen, plain, signals, ahead, b):
    """Fill in what is measured, estimated and foreseen, axis by axis."""
    frame[starts[ENTRY.position_age]] = physical(seen, plain, plain.position_age)
    frame[starts[ENTRY.velocity_age]] = physical(seen, plain, plain.velocity_age)
    for axis in range(signals.y.shape[1]):
        error = physical(seen, plain, plain.position_error + axis)
        frame[starts[ENTRY.position_error] + axis] = error
        frame[starts[ENTRY.reference_velocity] + axis] = signals.velocity[b, axis]
        frame[starts[ENTRY.reference_acceleration] + axis] = signals.acceleration[b, axis]
        frame[starts[ENTRY.estimated_error] + axis] = signals.y[b, axis]
        frame[starts[ENTRY.estimated_rate] + axis] = signals.rate[b, axis]
        frame[starts[ENTRY.estimated_disturbance] + axis] = signals.disturbance[b, axis]
        frame[starts[ENTRY.estimated_thrust] + axis] = signals.thrust[b, axis]
        for lead in range(ahead.shape[0]):
            frame[starts[FORESEEN + lead] + axis] = ahead[lead, b, axis, 0]
        frame[starts[ENTRY.foreseen_rate] + axis] = ahead[-1, b, axis, 1]


@piece
def fill_wrench(frame, starts, seen, plain, T, action):
    """Fill in the wrench that the base asks for."""
    limit = physical(seen, plain, plain.thruster_limit)
    for row in range(T.shape[0]):
        total = 0.0
        for j in range(min(action.size, T.shape[1])):
            total += T[row, j] * (action[j] * limit)
        frame[starts[ENTRY.base_force] + row] = total  # the moments follow the forces


@compiled
def show(table, plain, signals, ahead, posture, action, state, last, start, past, seen, kept):
    """Fill in the observations `seen` and the frames `kept` of a batch; see `ResidualObserver`."""
    frame = np.empty(table.complete)
    starts, width = table.starts, table.shown.size
    for b in range(seen.shape[0]):
        measured = signals.observation[b]
        fill_axes(frame, starts, measured, plain, signals, ahead, b)
        for k in range(table.base.shape[0]):
            frame[table.base[k, 0]] = state[b, table.base[k, 1]]
        fill_wrench(frame, starts, measured, plain, signals.allocation[b], action[b])
        for j in range(signals.allocation.shape[2]):
            command = physical(measured, plain, plain.thruster_command + j)
            frame[starts[ENTRY.thruster_command] + j] = command
        for i in range(last.shape[1]):
            frame[starts[ENTRY.last_action] + i] = 0.0 if start[b] else last[b, i]
        for i in range(posture.shape[1]):
            frame[table.complete - posture.shape[1] + i] = posture[b, i]
        for k in range(seen.shape[1]):
            earlier = k < past.shape[1] and not start[b]
            number = past[b, k] if earlier else frame[table.shown[k % width]]
            bound = table.bound[k]
            seen[b, k] = min(max(number / table.scale[k], -bound), bound)
            if k >= width:
                kept[b, k - width] = number


class ResidualObserver:
    """Makes the agent's observation from what is measured and estimated, for a batch.

    Attributes:
        layout: The table.
        earlier: How many numbers are kept of earlier frames.
    """

    def __init__(
        self,
        base: Policy,
        robot: Any,
        actions: int,
        length: float,
        omit: tuple[str, ...],
        frames: int,
        action: str,
    ) -> None:
        """Take the base, whose state or estimates are shown, and what a `ResidualLayout` needs."""
        world, self._posture = world_of(bare(robot)), posture_of(robot)
        axes = len(world.axes)
        body = base.body if isinstance(base, HeadLaw) else base
        law = body if isinstance(body, ScriptedPolicy) else None
        columns: dict[str, Any] = {}
        if law is not None and action == "estimates":
            first = law.predictor_columns.start + len(NAMES) * np.arange(axes)
            columns = {name: first + k for k, name in enumerate(NAMES)}
        elif law is not None:
            columns = {name: law.columns[name] for name in law.shown}
        entries = measured_by(length, base_entries(columns, axes))
        posture = measured_by(length, self._posture.entries)
        omit = (*omit, *(name for name in HIDDEN.get(action, ()) if name not in omit))
        moments = len(world.attitude) + len(world.watched)
        whole = ResidualLayout(
            world.axes, moments, world.thrusters, actions, entries, posture, length
        )
        self.layout = replace(whole, omit=omit, frames=frames)
        numbers, slices = np.arange(whole.size), whole.slices
        places = [numbers[slices[entry.name]] for entry in entries]
        self._table = FrameTable(
            starts=np.array([slices[name].start for name in ENTRY._fields]),
            base=np.array([places, list(columns.values())], np.int64).reshape(2, -1).T.copy(),
            shown=np.concatenate([numbers[slices[entry.name]] for entry in self.layout.frame]),
            scale=self.layout.scale,
            bound=self.layout.bound,
            complete=whole.size,
        )
        self._plain = plain_of(world.layout)
        self._numbers = sum(entry.size for entry in self._posture.entries)
        self.earlier = self.layout.size - len(self._table.shown)

    def update(
        self,
        observation: NDArray[np.float32],
        known: Estimate,
        base_action: NDArray[np.float32],
        base_state: Any,
        last_action: NDArray[np.float32],
        past: Array,
        start: Flags,
    ) -> tuple[NDArray[np.float32], Array]:
        """Make the observations of a batch.

        Args:
            observation: Plain observations, (batch, numbers).
            known: What was measured, estimated and foreseen.
            base_action: The base's commands over the limits, not clipped, (batch, commands).
            base_state: The base's state after that.
            last_action: The agent's last action, (batch, actions).
            past: The earlier frames, which the last call returned, (batch, earlier).
            start: Where an episode starts, so that there is nothing earlier, (batch,).

        Returns:
            The agent's observations, (batch, layout.size), and the frames for the next call.
        """
        size = base_action.shape[0]
        seen = np.empty((size, self._table.scale.size), np.float32)
        kept, posture = np.empty((size, self.earlier)), np.empty((size, self._numbers))
        self._posture.fill(observation, known.signals, posture)
        show(
            self._table,
            self._plain,
            known.signals,
            known.ahead,
            posture,
            base_action,
            base_state if self._table.base.size else _NOTHING,
            last_action,
            start,
            past,
            seen,
            kept,
        )
        return seen, kept


_NOTHING = np.empty((0, 0))
