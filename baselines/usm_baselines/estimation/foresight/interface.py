"""Copies of the nominal robot, run ahead: what predictors ask of a world.

Link angles and rates, joint references and thruster commands are known on board; position and
velocity of the centre of mass and what the nominal model leaves out, an acceleration d, are
estimated. The future of the joint references is that of a critically damped filter of an assumed
frequency, from their present value, rate and acceleration; where a policy steers the joints, they
go on as they were last commanded. All water is at rest or has the current
that is believed in, and is accelerated by d.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import singledispatch
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from usm_baselines.signals import Array
from usm_gym.kernels.compile import piece, shared
from usm_gym.kernels.lanes import WIDTH, padded
from usm_gym.plant.steering import ANGLE, QUANTITIES, steering_of, steering_row
from usm_gym.plant.thrusters import delivered
from usm_gym.sensors import value
from usm_gym.support.validation import require
from usm_gym.task.nominal import Nominal
from usm_gym.world import world_of

# Numbers at the start of a predictor's state in each axis; the forces of the thrusters follow.
NAMES = ("error", "rate", "unmodelled")
# A belief about a robot: true over nominal coefficients, the current in m/s by axis, then the force
# of each thruster over its command, then the coefficients of each link over those common to all.
COEFFICIENTS, CURRENT = 0, 6
# Physics steps of a prediction in a control period.
SUBSTEPS = 5


@shared
def estimates_of(axes: int) -> int:
    """How many numbers are estimated of a robot: (e, v, d) of each axis."""
    return 3 * axes


@shared
def gains_from(axes: int) -> int:
    """Where in a belief the gains of the thrusters begin."""
    return CURRENT + axes


class NominalPlant(NamedTuple):
    """The nominal robot in the form that kernels take, and how its observations are read.

    Attributes:
        plant: What the plant's kernels take.
        row: The numbers of a robot that do not change, (rows,).
        frequency: Assumed frequency of the joint references' filter, rad/s.
        starts: First indices of the observation's entries.
        scale: Physical value over observed value, by number.
        h: Control period, s.
    """

    plant: Any
    row: Array
    frequency: float
    starts: NDArray[np.int64]
    scale: Array
    h: float


@piece
def place_thrusters(applied, nominal, entries, rows, thrusters, gains, forces, block, lane):
    """Set the thrusters of a robot: their forces, and those that the commands lead to.

    Args:
        applied: The observation that tells the commands over the coming period.
        nominal: The nominal robot.
        entries: Numbers of the observation's entries of command and limit.
        rows: `plant.thrusters.ThrusterRows`.
        thrusters: Number of thrusters.
        gains: Force of each over its command.
        forces: Their forces, N.
        block: Block of the robot, (rows * WIDTH,).
        lane: Its place in the block.
    """
    limit = value(applied, nominal, entries[1], 0)
    for j in range(thrusters):
        command = value(applied, nominal, entries[0], j) * limit
        target = delivered(command, gains[j], nominal.row[rows.dead_band])
        block[(rows.target + j) * WIDTH + lane] = target
        block[(rows.force + j) * WIDTH + lane] = forces[j]


def steering_rows(plant: Any, row: Array, nominal: Nominal) -> tuple[Any, Array]:
    """Plant and rows of a robot, to which those of its steering are added if it is steered."""
    if nominal.joint_time_constant == 0.0:
        return plant, row
    steering = steering_of(row.size, plant.h, nominal.joint_time_constant)
    more = np.zeros(QUANTITIES * padded(plant.links))
    return plant._replace(**steering._asdict()), np.concatenate([row, more])


@piece
def place_steering(seen, nominal, entry, block, lane):
    """Set references and commanded rates of the joints of a robot that is steered.

    `entry` is the number of the entry of the references, which those of their rates and of their
    accelerations follow.
    """
    plant, links = nominal.plant, nominal.plant.links
    for j in range(links - 1):
        rate = value(seen, nominal, entry + 1, j)
        away = plant.joint_time_constant * value(seen, nominal, entry + 2, j)
        first = steering_row(plant.steering, ANGLE, links) + j
        block[first * WIDTH + lane] = value(seen, nominal, entry, j)
        block[(first + padded(links)) * WIDTH + lane] = rate
        block[(first + 2 * padded(links)) * WIDTH + lane] = rate + away


class Foresight(ABC):
    """Places copies of robots where they are believed to be, and runs them ahead.

    Copies are lanes of blocks, (blocks, rows * WIDTH), those of a robot one after the other.

    Attributes:
        nominal: The nominal robot.
        axes: Axes of the position.
        thrusters: Number of thrusters.
        links: Number of links.
        forces: First row of the forces of the thrusters, N.
    """

    def __init__(self, nominal: NominalPlant, robot: Any, forces: int) -> None:
        """Keep the nominal robot; `forces` as above."""
        world = world_of(robot)
        self.nominal, self.forces = nominal, forces
        self.axes, self.thrusters, self.links = len(world.axes), world.thrusters, world.links

    def placed(
        self, seen: NDArray[np.float32], state: Array, applied: NDArray[np.float32], beliefs: Array
    ) -> Array:
        """Blocks with copies of all robots, where an observation and the estimates say they are.

        Args:
            seen: Observations, (robots, numbers).
            state: State of the predictor, of the time of the observations, (robots, size).
            applied: Observations that tell the commands over the coming period.
            beliefs: What the copies are believed to be, (robots, copies, numbers).
        """
        copies = beliefs.shape[0] * beliefs.shape[1]
        blocks = np.zeros((-(-copies // WIDTH), self.nominal.row.size * WIDTH))
        self.place(seen, state, applied, beliefs, blocks)
        return blocks

    @abstractmethod
    def place(
        self,
        seen: NDArray[np.float32],
        state: Array,
        applied: NDArray[np.float32],
        beliefs: Array,
        blocks: Array,
    ) -> None:
        """Write the copies into blocks of zeros; arguments as of `placed`."""

    @abstractmethod
    def run(self, seen: NDArray[np.float32], blocks: Array, ahead: Array) -> None:
        """Hold the commands, and fill in error, m, and rate, m/s, after each control period.

        Args:
            seen: Observations at which the robots were placed, (robots, numbers). The jerk of the
                reference is left out.
            blocks: What `placed` has returned, advanced in place.
            ahead: Where to write, (periods, robots, copies, axes, 2).
        """


@singledispatch
def foresight_of(robot: Any, nominal: Nominal) -> Foresight:
    """What foresees the nominal robots of a world.

    Args:
        robot: The robot of the nominal knowledge.
        nominal: Nominal knowledge.

    Raises:
        ValueError: If nothing does.
    """
    require(False, "robot", robot, "one whose motion can be foreseen")
    raise AssertionError
