"""The linear model of the nominal robot about rest, by differences of the simulated plant."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from usm_gym.plant import layout as rows
from usm_gym.robot import Robot
from usm_gym.simulation import Simulation
from usm_gym.support.validation import real_array, require
from usm_gym.task.conditions import FIELD, Conditions
from usm_gym.task.nominal import Nominal
from usm_gym.task.scenario import STILL, Scenario

Array = NDArray[np.float64]

# Differences are taken over this to either side, in the units of the states and inputs. The drag
# v + v|v| bends at rest, which makes their error one of first order; rounding forbids much less.
STEP = 2.0**-23


class Variable(NamedTuple):
    """A state or an input of a linear model.

    Attributes:
        name: Its name.
        size: How many numbers it has.
        unit: Their unit.
    """

    name: str
    size: int
    unit: str


@dataclass(frozen=True, eq=False)
class LinearModel:
    """A linear model: x(k + 1) = A x(k) + B u(k), or x' = A x + B u where the period is 0.

    States and inputs are deviations from the operating point, in the order of `states` and
    `inputs`; in discrete time the inputs are held for a period.

    Attributes:
        A: From states to states, (x, x).
        B: From inputs to states, (x, u).
        states: Names, sizes and units of the states, in order.
        inputs: The same of the inputs.
        period: Time between two instants k, the control period, s; 0 in continuous time.
    """

    A: Array
    B: Array
    states: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    period: float

    @property
    def slices(self) -> dict[str, slice]:
        """Where the states stand, by name."""
        ends = np.cumsum([state.size for state in self.states]).tolist()
        return {
            state.name: slice(end - state.size, end)
            for state, end in zip(self.states, ends, strict=True)
        }


def linearise(
    nominal: Nominal, *, heading: float = 0.0, joint_angles: ArrayLike | None = None
) -> LinearModel:
    """Linearise the nominal robot about rest in still water, for the design of controllers.

    The model is of one control period: thruster commands held, drag linear, the joints held at
    the operating point by their own controllers. No thruster saturates.

    | state | size | unit | meaning |
    |---|---|---|---|
    | `position` | 2 | m | centre of mass, global frame (x, y) |
    | `heading` | 1 | rad | mean link angle |
    | `joint_angles` | n - 1 | rad | theta_i - theta_(i+1), from the tail |
    | `velocity` | 2 | m/s | of the centre of mass, global frame |
    | `heading_rate` | 1 | rad/s | |
    | `joint_rates` | n - 1 | rad/s | |
    | `thruster_forces` | thrusters | N | only if the thrusters have a lag |

    The one input is `thruster_commands`, N.

    A and B are central differences of one period of the compiled plant, in physics steps of 1 ms or
    a little less. Compared with the true derivatives their entries are right to about 1e-7 of the
    largest in the same row.

    Args:
        nominal: What is known of the robot: `env.unwrapped.nominal`.
        heading: Heading of the operating point, rad.
        joint_angles: Its joint angles, rad, (n - 1,), which the joint references equal; without
            them the body is straight.

    Returns:
        The model.

    Raises:
        ValueError: If an argument is of the wrong kind or shape, or not finite.
    """
    require(isinstance(nominal, Nominal), "nominal", nominal, "a Nominal, as environments have it")
    planar = isinstance(nominal.robot, Robot)
    require(planar, "the nominal robot", nominal.robot, "a planar one")
    links, thrusters = nominal.robot.links, len(nominal.robot.thrusters)
    straight = np.zeros(links - 1)
    angles = straight if joint_angles is None else _finite("joint_angles", joint_angles)
    require(angles.shape == (links - 1,), "joint_angles", joint_angles, f"shape ({links - 1},)")
    turned = _finite("heading", heading)
    require(turned.shape == (), "heading", heading, "a number")
    # Heading and joint angles from link angles.
    posture = np.vstack([np.full(links, 1 / links), -np.diff(np.eye(links), axis=0)])
    theta = np.linalg.solve(posture, np.append(turned, angles))
    A, B = _differences(_at_rest(nominal, theta, angles))
    # The same of their rates; all other states are the plant's own.
    ours = np.eye(len(A))
    for first in (2, links + 4):
        ours[first : first + links, first : first + links] = posture
    states = _states(links - 1, thrusters if nominal.thruster_time_constant > 0.0 else 0)
    size = sum(state.size for state in states)
    return LinearModel(
        A=(ours @ A @ np.linalg.inv(ours))[:size, :size],
        B=(ours @ B)[:size],
        states=states,
        inputs=(Variable("thruster_commands", thrusters, "N"),),
        period=nominal.control_period,
    )


def _states(joints: int, lagging: int) -> tuple[Variable, ...]:
    forces = (Variable("thruster_forces", lagging, "N"),) if lagging else ()
    return (
        Variable("position", 2, "m"),
        Variable("heading", 1, "rad"),
        Variable("joint_angles", joints, "rad"),
        Variable("velocity", 2, "m/s"),
        Variable("heading_rate", 1, "rad/s"),
        Variable("joint_rates", joints, "rad/s"),
        *forces,
    )


def _at_rest(nominal: Nominal, theta: Array, joint_angles: Array) -> Simulation:
    """A simulation of the nominal robot at rest in still water, the joints asked to stay."""
    period, links = nominal.control_period, nominal.robot.links
    substeps = math.ceil(period / FIELD.physics_step * (1 - 1e-9))
    conditions = Conditions(
        control_period=period,
        physics_step=period / substeps,
        thruster_time_constant=nominal.thruster_time_constant,
        thruster_limit=1.0,
        position_noise=0.0,
    )
    unfiltered = replace(STILL, filter_frequency=None)
    scenario = Scenario(
        inspection=unfiltered, conditions=conditions, duration=period, robot=nominal.robot
    )
    simulation = Simulation([scenario])
    row = simulation.fleet.blocks[0]
    row[rows.row_of(rows.THETA, links) :][:links] = theta
    # Each joint's reference is its share of a deflection of 1, which a filter of gain 1 holds.
    row[rows.row_of(rows.SHARE, links) :][: links - 1] = joint_angles
    row[[rows.DEFLECTION, rows.FILTER_DD]] = 1.0
    return simulation


def _differences(simulation: Simulation) -> tuple[Array, Array]:
    """Derivatives of what a period makes of the state, by the state and by the commands.

    The state is the plant's: position and link angles, their rates, the thrusters' forces.
    """
    thrusters, quantities = simulation.world.thrusters, simulation.world.quantities
    row, start = simulation.fleet.blocks[0], simulation.snapshot()
    names = ("position", "theta", "velocity", "theta_dot", "force")
    place = np.r_[tuple(quantities[name] for name in names)]

    def after(deviation: Array) -> Array:
        simulation.restore(start)
        row[place] += deviation[: place.size]
        simulation.step(deviation[np.newaxis, place.size :].astype(np.float32))
        return np.asarray(row[place])

    deviations = STEP * np.eye(place.size + thrusters)
    columns = [(after(step) - after(-step)) / (2 * STEP) for step in deviations]
    derivatives = np.stack(columns, axis=1)
    return derivatives[:, : place.size], derivatives[:, place.size :]


def _finite(name: str, value: Any) -> Array:
    array = real_array(name, value)
    require(np.isfinite(array).all(), name, value, "finite numbers")
    return array.astype(np.float64)
