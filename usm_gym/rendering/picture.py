"""The visible state of a robot as plain data, taken from a simulation and drawn by `rendering`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from usm_gym.manipulator import bare
from usm_gym.robot import Robot
from usm_gym.simulation import Simulation
from usm_gym.task.scenario import Scenario
from usm_gym.task.spatial_water import SpatialWater
from usm_gym.task.water import Water

Array = NDArray[np.float64]
# What has to follow the path.
Follower = Literal["centre of mass", "head"]
# A lost robot may be anywhere; it is shown at most this far from its reference, m.
FAR = 10.0


class AnyPicture(Protocol):
    """What films and charts ask of a picture of any world; `Picture` has the words."""

    @property
    def time(self) -> float:
        """Time since the start, s."""

    @property
    def times(self) -> Array:
        """The instants recorded so far, in ascending order, s, (n,); the last one is now."""

    @property
    def errors(self) -> Array:
        """True position errors at these instants, m, (n, axes)."""

    @property
    def settle_time(self) -> float:
        """When the scored part of the episode begins, s."""

    @property
    def lost(self) -> bool:
        """Whether the robot is lost."""

    @property
    def follower(self) -> Follower:
        """What has to follow the path."""


@dataclass(frozen=True)
class Posture:
    """The places and angles of the links.

    Attributes:
        centres: Centres of the links, tail first, m, (links, 2).
        angles: Their angles, rad, (links,).
    """

    centres: Array
    angles: Array


@dataclass(frozen=True)
class Picture:
    """One robot at one control instant, in the global frame; all numbers are finite.

    Attributes:
        robot: The robot.
        scenario: Its scenario.
        time: Time since the start, s.
        body: The robot's true posture.
        reference: The posture with the reference joint angles at the reference of the heading, its
            centre of mass at the reference of the position; None where no posture is asked for.
        thrust: Forces of the thrusters over their limit, (thrusters,).
        current: Velocity of the water, m/s, (2,).
        path: Reference of what follows it at every control instant of the episode, m, (k, 2).
        middle: The point around which the robot is shown: the reference now, or the station, where
            the centre of mass starts, of a robot that stays there, m, (2,).
        mass: The true centre of mass, m, (2,).
        instants: The instants recorded so far, in ascending order; the last one is now.
        errors: True position errors at these instants, m, (len(instants), 2).
        max_error: Largest absolute error after settling, m, (2,).
        lost: Whether the robot is lost.
        follower: What has to follow the path.
    """

    robot: Robot
    scenario: Scenario
    time: float
    body: Posture
    reference: Posture | None
    thrust: Array
    current: Array
    path: Array
    middle: Array
    mass: Array
    instants: NDArray[np.int64]
    errors: Array
    max_error: Array
    lost: bool
    follower: Follower = "centre of mass"

    @property
    def times(self) -> Array:
        """The instants recorded so far, s, (len(instants),)."""
        return self.instants * np.float64(self.scenario.conditions.control_period)

    @property
    def track(self) -> Array:
        """Where the follower was at these instants, m, (len(instants), 2)."""
        return self.path[self.instants] + self.errors

    @property
    def settle_time(self) -> float:
        """When the scored part of the episode begins, s."""
        return self.scenario.settle_time


class Trail:
    """Records the errors of one robot of a simulation along its path.

    Attributes:
        index: Which robot it is.
    """

    def __init__(self, index: int = 0) -> None:
        """Follow the robot `index`."""
        self.index = index
        self._scenario: Any = None

    def note(self, simulation: Simulation) -> None:
        """Record the present; call it at every control instant that a trail should show."""
        scenario, count = simulation.scenarios[self.index], simulation.count[self.index]
        if scenario is not self._scenario or count == 0:
            self._scenario = scenario
            self._path = scenario.reference_positions()
            self._errors = np.full_like(self._path, np.nan)
        self._errors[count] = simulation.error[self.index]

    def _recorded(self, count: int) -> NDArray[np.int64]:
        """The instants recorded up to one of them."""
        return np.flatnonzero(np.isfinite(self._errors[: count + 1, 0]))


class Recorder(Trail):
    """Records the past of one robot of a simulation, for pictures with a trail."""

    def picture(self, simulation: Simulation) -> Picture:
        """Describe the present."""
        self.note(simulation)
        index, scenario = self.index, simulation.scenarios[self.index]
        robot: Any = bare(scenario.body)
        count = int(simulation.count[index])
        here = self._path[count]
        theta = np.nan_to_num(simulation.read("theta")[index])
        position = np.nan_to_num(simulation.read("position")[index])
        position = np.clip(position, here - FAR, here + FAR)
        instants = self._recorded(count)
        errors = np.clip(self._errors[instants], -FAR, FAR)
        return Picture(
            robot=robot,
            scenario=scenario,
            time=count * scenario.conditions.control_period,
            body=Posture(robot.link_centres(theta, position), theta),
            reference=self._wanted(simulation),
            thrust=np.nan_to_num(simulation.read("force")[index]) / simulation.limit[index],
            current=velocity(scenario.water, count * scenario.conditions.control_period),
            path=self._path,
            middle=here,
            mass=here + errors[-1],
            instants=instants,
            errors=errors,
            max_error=simulation.max_error[index].copy(),
            lost=bool(simulation.lost[index]),
        )

    def _wanted(self, simulation: Simulation) -> Posture | None:
        """The posture that is asked for, if one is."""
        here = self._path[simulation.count[self.index]]
        robot = simulation.scenarios[self.index].body
        angles = reference_angles(simulation, self.index)
        return Posture(robot.link_centres(angles, here), angles)


class HeadRecorder(Recorder):
    """The same of a robot whose head follows the path, while its body stays at the station."""

    def picture(self, simulation: Simulation) -> Picture:
        """Describe the present."""
        shown = super().picture(simulation)
        mass = shown.body.centres.mean(axis=0)
        return replace(shown, middle=np.zeros(2), mass=mass, follower="head")

    def _wanted(self, simulation: Simulation) -> None:
        """None: a policy bends the robot as it likes."""


def reference_angles(simulation: Simulation, index: int) -> Array:
    """Link angles with the reference joint angles whose heading is the reference's, (links,)."""
    joints = simulation.read("joint_shares")[index] * simulation.read("deflection")[index]
    # phi_i = theta_i - theta_(i+1)
    shape = -np.concatenate([[0.0], np.cumsum(joints)])
    by_head = simulation.scenarios[index].heading == "head"
    theta = np.nan_to_num(simulation.read("theta")[index])
    heading, own = (theta[-1], shape[-1]) if by_head else (theta.mean(), shape.mean())
    return np.asarray(shape - own + heading - simulation.attitude_error[index])


def velocity(water: Water | SpatialWater, time: float) -> Array:
    """Velocity of the water, m/s, (axes,); a simulation has none before its first step."""
    moving = np.array(water.current)
    for amplitude, phase, frequency in _sinusoids(water):
        moving += amplitude * np.sin(phase + frequency * time)
    return moving


def drift(water: Water | SpatialWater, time: float) -> Array:
    """How far the water has moved since the start, m, (axes,)."""
    moved = np.array(water.current) * time
    for amplitude, phase, frequency in _sinusoids(water):
        moved += amplitude * (np.cos(phase) - np.cos(phase + frequency * time)) / frequency
    return moved


def _sinusoids(water: Water | SpatialWater) -> list[tuple[Array, Array, float]]:
    """Amplitudes, m/s, (axes,), phases at the start, (axes,) or the same, frequency, rad/s."""
    slow = (np.array(water.amplitude), np.array(water.phase), 2 * np.pi / water.period)
    waves = [
        (np.array(wave.amplitude), np.array(wave.phase), 2 * np.pi / wave.period)
        for wave in water.waves
    ]
    return [slow, *waves]
