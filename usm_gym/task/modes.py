"""All modes, of plane and space, of body and head: their conditions and scenarios."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from usm_gym.robots import EELY, PAPER
from usm_gym.support.validation import require
from usm_gym.task.conditions import PRESETS, SPATIAL_PRESETS, Conditions
from usm_gym.task.head_sampling import (
    AnyHeadMode,
    AnyHeadScenario,
    nominal_head,
    sample_head,
)
from usm_gym.task.head_scenario import (
    HEAD_MODES,
    SPATIAL_HEAD_MODES,
    HeadScenario,
    SpatialHeadScenario,
)
from usm_gym.task.sampling import named, sample
from usm_gym.task.scenario import MODES, Mode, Scenario, require_mode
from usm_gym.task.spatial_sampling import nominal_in_space, sample_in_space
from usm_gym.task.spatial_scenario import SPATIAL_MODES, SpatialMode, SpatialScenario

AnyMode = Mode | SpatialMode | AnyHeadMode
AnyScenario = Scenario | SpatialScenario | AnyHeadScenario
# In these the policy moves the joints, too, and the head follows a path.
ALL_HEAD_MODES: tuple[AnyHeadMode, ...] = (*HEAD_MODES, *SPATIAL_HEAD_MODES)
ALL_MODES: tuple[AnyMode, ...] = (*MODES, *SPATIAL_MODES, *ALL_HEAD_MODES)


def in_space(mode: str) -> bool:
    """Whether a mode is one of the spatial robot."""
    return mode in (*SPATIAL_MODES, *SPATIAL_HEAD_MODES)


def of_head(mode: str) -> bool:
    """Whether in a mode the policy moves the joints, too, and the head follows a path."""
    return mode in ALL_HEAD_MODES


def kind_of(mode: str) -> type[Any]:
    """The class of the scenarios of a mode."""
    if of_head(mode):
        return SpatialHeadScenario if in_space(mode) else HeadScenario
    return SpatialScenario if in_space(mode) else Scenario


def presets_of(mode: str) -> Mapping[str, Conditions]:
    """The presets of conditions that a mode has."""
    return SPATIAL_PRESETS if in_space(mode) else PRESETS


def sample_of(
    mode: AnyMode, conditions: Conditions, stream: np.random.Generator, robot: Any = None
) -> AnyScenario:
    """Draw a scenario of any mode.

    Args:
        mode: The mode.
        conditions: Conditions, whose ranges are used.
        stream: Where all randomness comes from.
        robot: The robot, or its name; None: the paper's, in space Eely.

    Raises:
        ValueError: If there is no such mode.
    """
    require_mode(mode, ALL_MODES)
    if of_head(mode):
        return sample_head(mode, conditions, stream, robot)  # type: ignore[arg-type]
    if in_space(mode):
        return sample_in_space(mode, conditions, stream, robot or EELY)  # type: ignore[arg-type]
    return sample(mode, conditions, stream, robot or PAPER)  # type: ignore[arg-type]


def named_of(name: str, mode: AnyMode, conditions: Conditions, robot: Any) -> AnyScenario:
    """The scenario of a name: "nominal", which all modes have, or "table1", which is of the plane.

    Raises:
        ValueError: If there is none of that name.
    """
    if of_head(mode) or in_space(mode):
        require(name == "nominal", "scenario", name, "nominal")
    if of_head(mode):
        return nominal_head(mode, conditions, robot)  # type: ignore[arg-type]
    if in_space(mode):
        return nominal_in_space(mode, conditions, robot)  # type: ignore[arg-type]
    return named(name, mode, conditions, robot)  # type: ignore[arg-type]


def read_scenario(data: Mapping[str, Any]) -> AnyScenario:
    """Read a scenario of any mode, as its `to_dict` wrote it.

    Raises:
        ValueError: If a key is unknown, or a value of the wrong type or out of range.
    """
    mode = data.get("mode", "") if isinstance(data, Mapping) else ""
    scenario: AnyScenario = kind_of(mode).from_dict(data)
    return scenario
