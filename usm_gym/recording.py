"""What happened in episodes, taken down while a simulation runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usm_gym.simulation import Simulation
from usm_gym.support.validation import require
from usm_gym.world import world_of

# What side by side is kept of all episodes: some three gigabytes.
MOST_SAMPLES = 50_000_000


@dataclass(frozen=True)
class Trajectory:
    """What happened in an episode, at the control instants after each step, up to a loss.

    Attributes:
        scenario: The episode's scenario.
        time: Times, s, (samples,).
        error: True position errors, m, (samples, axes).
        attitude_error: Attitude errors, rad, (samples, angles).
        command: Thruster commands after saturation, N, (samples, thrusters).
        joint_rates: Commanded rates of the joints that a policy moves, rad/s, (samples, joints); no
            joints where it moves none.
        lost: Whether the robot was lost.
    """

    scenario: Any
    time: NDArray[np.float64]
    error: NDArray[np.float64]
    attitude_error: NDArray[np.float64]
    command: NDArray[np.float64]
    joint_rates: NDArray[np.float64]
    lost: bool


class Recording:
    """What happens in a simulation, robot by robot up to its end or loss."""

    def __init__(self, simulation: Simulation) -> None:
        """Make room for all control periods."""
        size, length = simulation.size, int(simulation.steps.max())
        require(
            size * length <= MOST_SAMPLES,
            "scenarios",
            f"{size} episodes of up to {length} control periods",
            f"{MOST_SAMPLES} control periods side by side",
        )
        self.length = length
        self.lost = np.zeros(size, bool)
        self._simulation = simulation
        self._ends = simulation.steps.copy()
        self._error = np.empty((length, *simulation.error.shape))
        self._attitude_error = np.empty((length, *simulation.attitude_error.shape))
        world = simulation.world
        self._command = np.empty((length, size, world.thrusters))
        self._joint_rates = np.empty((length, size, world.actions - world.thrusters))

    def alive(self, period: int) -> NDArray[np.bool_]:
        """Whose episodes are going on in a control period."""
        return (period < self._ends) & ~self.lost

    def note(self, period: int) -> None:
        """Take down a control period that has just passed."""
        simulation = self._simulation
        self._error[period] = simulation.error
        self._attitude_error[period] = simulation.attitude_error
        self._command[period] = simulation.read("command")
        if self._joint_rates.size > 0:
            self._joint_rates[period] = simulation.read("joint_commands")
        now = simulation.lost & self.alive(period)
        self._ends[now] = period + 1
        self.lost |= now

    def trajectories(self) -> list[Trajectory]:
        """The episodes."""
        scenarios = self._simulation.scenarios
        return [
            Trajectory(
                scenario=scenario,
                time=times_of(scenario, int(end)),
                error=self._error[:end, index],
                attitude_error=self._attitude_error[:end, index],
                command=self._command[:end, index],
                joint_rates=self._joint_rates[:end, index],
                lost=bool(self.lost[index]),
            )
            for index, (scenario, end) in enumerate(zip(scenarios, self._ends, strict=True))
        ]


def at_rest(scenario: Any) -> Trajectory:
    """An episode without errors and commands."""
    samples, world = scenario.steps, world_of(scenario.body)
    return Trajectory(
        scenario=scenario,
        time=times_of(scenario, samples),
        error=np.zeros((samples, len(world.axes))),
        attitude_error=np.zeros((samples, len(world.attitude) + len(world.watched))),
        command=np.zeros((samples, world.thrusters)),
        joint_rates=np.zeros((samples, world.actions - world.thrusters)),
        lost=False,
    )


def times_of(scenario: Any, samples: int) -> NDArray[np.float64]:
    """The ends of the first control periods of an episode, s."""
    period: float = scenario.conditions.control_period
    return np.arange(1, samples + 1, dtype=np.float64) * period
