"""A toy world: a neutrally buoyant ball in three axes, which three thrusters keep on a path."""

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import gymnasium as gym
import numba
import numpy as np

from usm_gym.envs.env import TrackingEnv
from usm_gym.envs.vector_env import TrackingVectorEnv
from usm_gym.kernels.compile import compiled, parallel, piece
from usm_gym.plant.thrusters import saturated
from usm_gym.sensors import Entry, Layout
from usm_gym.task.conditions import FIELD, Conditions
from usm_gym.task.nominal import Nominal
from usm_gym.task.sensing import sensing
from usm_gym.world import Kernels, World, world_of

# Rows: position and velocity, last commands, thruster limit, the path's speed, physics steps.
P, V, COMMAND, LIMIT, SPEED, CLOCK, ROWS = 0, 3, 6, 9, 10, 11, 12


class Shared(NamedTuple):
    mass: float
    drag: float
    h: float
    substeps: int


@compiled
def observe(fleet, shared, table, k, lanes):
    row, lane, seen = fleet.blocks[k // lanes], k % lanes, fleet.observation[k]
    t, speed = row[CLOCK * lanes + lane] * shared.h, row[SPEED * lanes + lane]
    noise = fleet.noise[k, min(fleet.instant[k], fleet.steps[k])]
    for axis in range(3):
        share = speed / (1.0 + axis)
        fleet.error[k, axis] = row[(P + axis) * lanes + lane] - share * t
        values = (fleet.error[k, axis] + noise[axis], share, 0.0)
        for entry in range(3):
            i = table.starts[entry] + axis
            seen[i] = values[entry] * table.gain[i]
        i, limit = table.starts[3] + axis, row[LIMIT * lanes + lane]
        seen[i] = row[(COMMAND + axis) * lanes + lane] / limit * table.gain[i]
    seen[table.starts[4]] = row[LIMIT * lanes + lane] * table.gain[table.starts[4]]
    seen[:] = np.minimum(np.maximum(seen, -table.bound), table.bound)


@piece
def advance(fleet, shared, table, actions, k, lanes):
    row, lane = fleet.blocks[k // lanes], k % lanes
    fleet.effort[k] = 0.0
    for axis in range(3):
        command = saturated(float(actions[k, axis]), 1.0) * row[LIMIT * lanes + lane]
        row[(COMMAND + axis) * lanes + lane] = command
        fleet.effort[k] += abs(command) / 3.0
        v = row[(V + axis) * lanes + lane]
        for _ in range(shared.substeps):
            v += shared.h * (command - shared.drag * v * (1.0 + abs(v))) / shared.mass
            row[(P + axis) * lanes + lane] += shared.h * v
        row[(V + axis) * lanes + lane] = v
    row[CLOCK * lanes + lane] += shared.substeps
    fleet.instant[k] += 1
    observe(fleet, shared, table, k, lanes)
    if fleet.instant[k] >= fleet.settled[k]:
        for axis in range(3):
            fleet.max_error[k, axis] = max(fleet.max_error[k, axis], abs(fleet.error[k, axis]))


@compiled
def run(fleet, shared, table, actions, first, last):
    lanes = fleet.blocks.shape[1] // ROWS
    for k in range(first * lanes, min(last * lanes, actions.shape[0])):
        advance(fleet, shared, table, actions, k, lanes)


@parallel
def run_threads(fleet, shared, table, actions):
    for block in numba.prange(fleet.blocks.shape[0]):
        run(fleet, shared, table, actions, block, block + 1)


class BallLayout(Layout):
    entries = (
        Entry("position_error", 3, "m", 0.01, 0.5, "measured"),
        Entry("reference_velocity", 3, "m/s", 0.1, 5.0, "of the path"),
        Entry("reference_acceleration", 3, "m/s^2", 0.1, 5.0, "of the path"),
        Entry("thruster_command", 3, "1", 1.0, 1.1, "last, over the limit"),
        Entry("thruster_limit", 1, "N", 20.0, 1000.0, "largest force"),
    )


@dataclass(frozen=True)
class Ball:
    mass: float = 10.0
    drag: float = 20.0


@dataclass(frozen=True)
class BallScenario:
    conditions: Conditions = FIELD
    robot: Ball = Ball()
    speed: float = 0.1
    duration: float = 6.0
    settle_time: float = 2.0
    noise_seed: int = 0
    shifts = ()
    body = property(lambda self: self.robot)
    steps = property(lambda self: round(self.duration / self.conditions.control_period))
    nominal = property(lambda self: Nominal(self.robot, self.conditions.control_period, 0.0, 5e-5))

    def sensing(self):
        return sensing(self.conditions, self.steps, 3, [], self.noise_seed)


@dataclass(frozen=True)
class BallWorld(World):
    robot: Ball
    axes = ("x", "y", "z")
    kernels = Kernels(observe, run, run, run_threads)
    links, thrusters, rows, layout = 1, 3, ROWS, BallLayout()
    mass = property(lambda self: self.robot.mass)
    straight_body = property(lambda self: (np.full(3, self.mass), np.full(3, self.robot.drag)))
    quantities = {"command": slice(COMMAND, LIMIT)}  # noqa: RUF012

    def write(self, scenario, row):
        row[:] = 0.0
        row[LIMIT], row[SPEED] = scenario.conditions.thruster_limit, scenario.speed

    def shared(self, scenario, previous):
        timing = scenario.conditions
        return Shared(self.mass, self.robot.drag, timing.physics_step, timing.substeps)

    def allocate(self, observation, matrices):
        matrices[:] = np.eye(3)


world_of.register(Ball)(lru_cache(BallWorld))


class BallSampler:
    body, nominal, conditions = Ball(), BallScenario().nominal, FIELD

    def draw(self, stream):
        return BallScenario(speed=stream.uniform(0.05, 0.15), noise_seed=int(stream.integers(99)))

    choose = staticmethod(lambda wanted: wanted)


MANY = partial(TrackingVectorEnv, sampler=BallSampler())
gym.register("Ball-v0", partial(TrackingEnv, BallSampler()), vector_entry_point=MANY)
