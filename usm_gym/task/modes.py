"""All modes, in the plane and in space: their conditions, scenarios and samplers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from usm_gym.robots import EELY, PAPER
from usm_gym.support.validation import require
from usm_gym.task.conditions import PRESETS, SPATIAL_PRESETS, Conditions
from usm_gym.task.sampling import sample
from usm_gym.task.scenario import MODES, Mode, Scenario
from usm_gym.task.spatial_sampling import sample_in_space
from usm_gym.task.spatial_scenario import SPATIAL_MODES, SpatialMode, SpatialScenario

AnyMode = Mode | SpatialMode
AnyScenario = Scenario | SpatialScenario
ALL_MODES: tuple[AnyMode, ...] = (*MODES, *SPATIAL_MODES)


def in_space(mode: str) -> bool:
    """Whether a mode is one of the spatial robot."""
    return mode in SPATIAL_MODES


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
    require(mode in ALL_MODES, "mode", mode, " or ".join(ALL_MODES))
    if in_space(mode):
        return sample_in_space(mode, conditions, stream, robot or EELY)  # type: ignore[arg-type]
    return sample(mode, conditions, stream, robot or PAPER)  # type: ignore[arg-type]


def read_scenario(data: Mapping[str, Any]) -> AnyScenario:
    """Read a scenario of any mode, as its `to_dict` wrote it.

    Raises:
        ValueError: If a key is unknown, or a value of the wrong type or out of range.
    """
    spatial = isinstance(data, Mapping) and in_space(data.get("mode", ""))
    return SpatialScenario.from_dict(data) if spatial else Scenario.from_dict(data)
