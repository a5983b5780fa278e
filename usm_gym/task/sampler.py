"""Where the scenarios of an environment come from, of any mode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from usm_gym.manipulator import Manipulator
from usm_gym.robots import AnyRobot, name_of, robot_of, spatial_robot_of
from usm_gym.support.validation import require
from usm_gym.task.conditions import Conditions, conditions_of
from usm_gym.task.modes import (
    AnyMode,
    AnyScenario,
    in_space,
    kind_of,
    named_of,
    of_head,
    presets_of,
    sample_of,
)
from usm_gym.task.nominal import Nominal
from usm_gym.task.scenario import Scenario


@dataclass(frozen=True)
class ModeSampler:
    """Scenarios of a mode, under given conditions, for a given robot.

    Attributes:
        mode: The mode.
        conditions: Their conditions.
        robot: The robot.
    """

    mode: AnyMode
    conditions: Conditions
    robot: AnyRobot

    @property
    def body(self) -> AnyRobot | Manipulator:
        """The robot as a world takes it: steered, where the policy moves the joints."""
        return Manipulator(self.robot) if of_head(self.mode) else self.robot

    @property
    def nominal(self) -> Nominal:
        """What a controller may know before the first scenario."""
        return self.choose("nominal").nominal

    def draw(self, stream: np.random.Generator) -> AnyScenario:
        """Draw a scenario."""
        return sample_of(self.mode, self.conditions, stream, name_of(self.robot))

    def choose(self, wanted: Any) -> AnyScenario:
        """The scenario of a name, of a dict, or itself; a dict without robot has this one.

        Raises:
            ValueError: If there is none, or it is of another robot or mode.
        """
        robot = name_of(self.robot)
        if isinstance(wanted, str):
            return named_of(wanted, self.mode, self.conditions, robot)
        kind = kind_of(self.mode)
        if not isinstance(wanted, kind):
            known = {"robot": robot}
            if kind is not Scenario:  # there, a dict without mode is of operation mode
                known["mode"] = self.mode
            wanted = kind.from_dict(known | wanted if isinstance(wanted, dict) else wanted)
        scenario: AnyScenario = wanted
        require(scenario.mode == self.mode, "the scenario's mode", scenario.mode, repr(self.mode))
        allowed = f"the environment's, {robot}"
        require(scenario.body == self.body, "the scenario's robot", scenario.robot, allowed)
        return scenario


def sampler_of(
    mode: AnyMode,
    conditions: str | Mapping[str, Any] | Conditions,
    robot: Any,
) -> ModeSampler:
    """The sampler of a mode.

    Args:
        mode: The mode.
        conditions: A preset's name, the fields that differ from "field", or the conditions.
        robot: A robot's name, the fields that differ from those of the usual one, or the
            robot; None: the paper's, in space Eely.

    Raises:
        ValueError: If a condition or a field of the robot is not allowed.
    """
    body: Any = spatial_robot_of(robot) if in_space(mode) else robot_of(robot)
    return ModeSampler(mode, conditions_of(conditions, presets_of(mode)), body)
