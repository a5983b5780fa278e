"""Scenarios by name, and drawn at random: what is asked for in either mode (docs/model.md 9)."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from usm_gym.plant.references import MAX_SHIFTS
from usm_gym.robot import Robot
from usm_gym.robots import PAPER, robot_of
from usm_gym.support.validation import require
from usm_gym.task.conditions import FIELD, PRESETS, Conditions
from usm_gym.task.scenario import MODES, STILL, Inspection, Mode, Path, Scenario, require_mode

# Length of a scan, s, and from when on its errors count: an adaptive law has seen some shifts.
SCAN_DURATION, SCAN_SETTLE_TIME = 60.0, 20.0


@dataclass(frozen=True)
class Recipe:
    """What is asked of the robot in a mode.

    Attributes:
        path: The nominal path.
        speeds: From where to where the speed of a path is drawn, m/s.
        amplitudes: The same of its amplitude, m.
        frequencies: The same of its angular frequency, rad/s.
        look_ahead: As in `Scenario`.
        bending: Whether the joints bend.
    """

    path: Path
    speeds: tuple[float, float]
    amplitudes: tuple[float, float]
    frequencies: tuple[float, float]
    look_ahead: float | None
    bending: bool

    def draw_path(self, stream: np.random.Generator) -> Path:
        """Draw a path."""
        return Path(
            speed=stream.uniform(*self.speeds),
            amplitude=stream.uniform(*self.amplitudes),
            frequency=stream.uniform(*self.frequencies),
        )

    def draw_motion(
        self, conditions: Conditions, joints: int, stream: np.random.Generator
    ) -> Inspection:
        """Draw the motion of the joints; a third to eleven fifteenths of them bend."""
        if not self.bending:
            return STILL
        bending_joints = int(stream.integers(max(1, joints // 3), most_bending(joints) + 1))
        if conditions.shift_gap_range is not None:
            return _draw_scan(conditions, conditions.shift_gap_range, bending_joints, stream)
        side = 1.0 if stream.random() < 0.5 else -1.0
        first, second = stream.uniform(*conditions.deflection_range, 2)
        third = stream.uniform(-0.35, 0.35)
        times = np.array([10.0, 20.0, 30.0]) + stream.uniform(-2.0, 2.0, 3)
        return Inspection(
            bending_joints=bending_joints,
            times=tuple(times.tolist()),
            deflections=(side * first, -side * second, third),
            filter_frequency=stream.uniform(*conditions.filter_range),
        )


def _draw_scan(
    conditions: Conditions,
    gap_range: tuple[float, float],
    bending_joints: int,
    stream: np.random.Generator,
) -> Inspection:
    """Draw shifts that follow each other to the end; all are drawn that could fit in."""
    low, high = gap_range
    smallest, largest = conditions.deflection_range
    gaps, sizes, sides = stream.random((3, MAX_SHIFTS))
    filter_frequency = stream.uniform(*conditions.filter_range)
    times = np.cumsum(low + (high - low) * gaps)
    sizes = (smallest + (largest - smallest) * sizes) * np.where(sides < 0.5, 1.0, -1.0)
    shifts = int(np.sum(times <= SCAN_DURATION - low))
    return Inspection(
        bending_joints=bending_joints,
        times=tuple(times[:shifts].tolist()),
        deflections=tuple(sizes[:shifts].tolist()),
        filter_frequency=filter_frequency,
    )


RECIPES: dict[Mode, Recipe] = {
    "operation": Recipe(Path(), (0.0, 0.1), (0.0, 0.25), (0.03, 0.15), None, bending=True),
    "torpedo": Recipe(Path(speed=0.1), (0.05, 0.3), (0.0, 0.5), (0.03, 0.12), 2.24, bending=False),
}


def sample(
    mode: Mode,
    conditions: Conditions,
    stream: np.random.Generator,
    robot: str | Robot = PAPER,
) -> Scenario:
    """Draw a scenario of a mode.

    Args:
        mode: "operation" or "torpedo".
        conditions: Conditions, whose ranges are used.
        stream: Where all randomness comes from.
        robot: The robot, or its name.
    """
    require_mode(mode, MODES)
    recipe, joints = RECIPES[mode], robot_of(robot).links - 1
    path = recipe.draw_path(stream)
    inspection = recipe.draw_motion(conditions, joints, stream)
    noise_seed = int(stream.integers(2**63))
    asked = dataclasses.replace(
        named("nominal", mode, conditions, robot),
        path=path,
        inspection=inspection,
        noise_seed=noise_seed,
    )
    return asked.under(conditions)


def named(
    name: str, mode: Mode, conditions: Conditions | None = None, robot: str | Robot = PAPER
) -> Scenario:
    """The scenario "nominal" or "table1" of a mode.

    Args:
        name: "nominal", or "table1", the scenario of the paper's Table 1.
        mode: "operation" or "torpedo".
        conditions: Its conditions; without them "field" for nominal and "ideal" for table1.
        robot: The robot, or its name; eleven fifteenths of its joints bend.
    """
    require(name in ("nominal", "table1"), "scenario", name, "nominal, table1")
    require_mode(mode, MODES)
    recipe = RECIPES[mode]
    bending_joints = most_bending(robot_of(robot).links - 1)
    nominal = Scenario(
        mode=mode,
        path=recipe.path,
        inspection=Inspection(bending_joints=bending_joints) if recipe.bending else STILL,
        conditions=conditions or FIELD,
        look_ahead=recipe.look_ahead,
        robot=robot,
    )
    gap_range = nominal.conditions.shift_gap_range
    if name == "nominal" and gap_range is not None:
        times = even_times(gap_range)
        sides = tuple(0.98 * (-1.0) ** k for k in range(len(times)))
        scan = Inspection(bending_joints=bending_joints, times=times, deflections=sides)
        return dataclasses.replace(
            nominal,
            inspection=scan if recipe.bending else STILL,
            duration=SCAN_DURATION,
            settle_time=SCAN_SETTLE_TIME,
        )
    if name == "nominal":
        return nominal
    at_once = dataclasses.replace(nominal.inspection, filter_frequency=None)
    return dataclasses.replace(
        nominal,
        path=Path(ramp=0.0),
        inspection=at_once if recipe.bending else STILL,
        conditions=conditions or PRESETS["ideal"],
        joint_stiffness=9000.0,
        joint_damping=150.0,
    )


def even_times(gap_range: tuple[float, float]) -> tuple[float, ...]:
    """When the joints shift in a nominal scan, s: one mean gap after the other to the end."""
    gap = sum(gap_range) / 2
    return tuple(np.arange(gap, SCAN_DURATION - gap / 2, gap)[:MAX_SHIFTS].tolist())


def most_bending(joints: int) -> int:
    """How many of a robot's joints bend at most."""
    return max(1, 11 * joints // 15)
