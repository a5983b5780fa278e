"""Scenarios in space by name, and drawn at random (docs/model_spatial.md)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from usm_gym.plant.references import MAX_SHIFTS
from usm_gym.robots import EELY, spatial_robot_of
from usm_gym.spatial_robot import SpatialRobot
from usm_gym.task.conditions import SPATIAL_PRESETS, Conditions
from usm_gym.task.sampling import SCAN_DURATION, SCAN_SETTLE_TIME, even_times
from usm_gym.task.scenario import require_mode
from usm_gym.task.spatial_scenario import (
    NO_SCAN,
    SPATIAL_MODES,
    Scan,
    SpatialMode,
    SpatialPath,
    SpatialScenario,
)

Range = tuple[float, float]


@dataclass(frozen=True)
class SpatialRecipe:
    """What is asked of the spatial robot in a mode.

    Attributes:
        path: The nominal path.
        speeds: From where to where the speed of a path is drawn, m/s.
        sways: The same of its amplitude to the side, m.
        heaves: The same of its amplitude upwards, m.
        frequencies: The same of both angular frequencies, rad/s.
        look_ahead: Whether the body aims along the path, one body length ahead.
        scanning: Whether the head scans.
    """

    path: SpatialPath
    speeds: Range
    sways: Range
    heaves: Range
    frequencies: Range
    look_ahead: bool
    scanning: bool

    def draw_path(self, stream: np.random.Generator) -> SpatialPath:
        """Draw a path."""
        return SpatialPath(
            speed=stream.uniform(*self.speeds),
            sway=stream.uniform(*self.sways),
            sway_frequency=stream.uniform(*self.frequencies),
            heave=stream.uniform(*self.heaves),
            heave_frequency=stream.uniform(*self.frequencies),
        )

    def draw_scan(
        self, conditions: Conditions, bending_joints: int, stream: np.random.Generator
    ) -> Scan:
        """Draw a scan: every shift turns the head to another side.

        A head deflection has a size from the conditions and a direction about the body's axis.
        """
        if not self.scanning:
            return NO_SCAN
        sizes, sides, moments = stream.random((3, MAX_SHIFTS))
        filter_frequency = stream.uniform(*conditions.filter_range)
        times = _shift_times(conditions, moments)
        shifts = len(times)
        smallest, largest = conditions.deflection_range
        sizes = (smallest + (largest - smallest) * sizes)[:shifts]
        # One side after the other: by a third of a turn or more, either way.
        turns = np.cumsum(np.where(sides < 0.5, -1.0, 1.0) * (1.0 + (2.0 * sides) % 1.0))[:shifts]
        directions = 2.0 * np.pi / 3.0 * turns
        if conditions.shift_gap_range is None:
            sizes[-1] = 0.0
        return Scan(
            bending_joints=bending_joints,
            times=tuple(times.tolist()),
            pans=tuple((sizes * np.cos(directions) + 0.0).tolist()),
            tilts=tuple((sizes * np.sin(directions) + 0.0).tolist()),
            filter_frequency=filter_frequency,
        )


def _shift_times(conditions: Conditions, moments: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """When the head moves: three times in 40 s, or one shift after the other to the end."""
    if conditions.shift_gap_range is None:
        return np.array([10.0, 20.0, 30.0]) + 4.0 * (moments[:3] - 0.5)
    low, high = conditions.shift_gap_range
    times = np.cumsum(low + (high - low) * moments)
    return times[times <= SCAN_DURATION - low]


SPATIAL_RECIPES: dict[SpatialMode, SpatialRecipe] = {
    "operation3d": SpatialRecipe(
        path=SpatialPath(),
        speeds=(0.0, 0.1),
        sways=(0.0, 0.25),
        heaves=(0.0, 0.15),
        frequencies=(0.03, 0.15),
        look_ahead=False,
        scanning=True,
    ),
    "torpedo3d": SpatialRecipe(
        path=SpatialPath(speed=0.15),
        speeds=(0.05, 0.3),
        sways=(0.0, 0.5),
        heaves=(0.0, 0.3),
        frequencies=(0.03, 0.12),
        look_ahead=True,
        scanning=False,
    ),
}


def sample_in_space(
    mode: SpatialMode,
    conditions: Conditions,
    stream: np.random.Generator,
    robot: str | SpatialRobot = EELY,
) -> SpatialScenario:
    """Draw a scenario of a mode in space.

    Args:
        mode: "operation3d" or "torpedo3d".
        conditions: Conditions, whose ranges are used.
        stream: Where all randomness comes from.
        robot: The robot, or its name; half of its joints bend.
    """
    nominal = nominal_in_space(mode, conditions, robot)
    recipe = SPATIAL_RECIPES[mode]
    path = recipe.draw_path(stream)
    scan = recipe.draw_scan(conditions, _bending(nominal.body), stream)
    noise_seed = int(stream.integers(2**63))
    asked = dataclasses.replace(nominal, path=path, scan=scan, noise_seed=noise_seed)
    return asked.under(conditions)


def nominal_in_space(
    mode: SpatialMode,
    conditions: Conditions = SPATIAL_PRESETS["field"],
    robot: str | SpatialRobot = EELY,
) -> SpatialScenario:
    """The nominal scenario of a mode in space.

    Raises:
        ValueError: If there is no such mode.
    """
    require_mode(mode, SPATIAL_MODES)
    recipe = SPATIAL_RECIPES[mode]
    body = spatial_robot_of(robot)
    scan, bending = NO_SCAN, _bending(body)
    scanning = conditions.shift_gap_range is not None
    if recipe.scanning:
        scan = dataclasses.replace(Scan(), bending_joints=bending)
    if recipe.scanning and conditions.shift_gap_range is not None:
        times = even_times(conditions.shift_gap_range)
        sides = (-1.0) ** np.arange(len(times))
        scan = Scan(
            bending_joints=bending,
            times=times,
            pans=tuple((0.8 * sides).tolist()),
            tilts=tuple((0.4 * sides).tolist()),
        )
    return SpatialScenario(
        mode=mode,
        path=recipe.path,
        scan=scan,
        conditions=conditions,
        duration=SCAN_DURATION if scanning else 40.0,
        settle_time=SCAN_SETTLE_TIME if scanning else 5.0,
        look_ahead=float(body.lengths.sum()) if recipe.look_ahead else None,
        robot=robot,
    )


def _bending(robot: SpatialRobot) -> int:
    """How many joints of a robot bend in a scan: those of its front half."""
    return max(1, (len(robot.links) - 1) // 2)
