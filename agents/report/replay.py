"""Episodes for a page: computed anew, thinned out and packed."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.take import Take, instants, take
from baselines.contender import Contender
from baselines.paper_rate import Record
from usm_gym.evaluation import score
from usm_gym.robot import Robot
from usm_gym.scenario import Scenario

Array = NDArray[np.float64]

# Pictures of the robot per second; errors and thrust are kept as often as they are measured.
FPS = 12.5
# Of a record at the paper's step, one error and effort every so often, s.
RECORD_PERIOD = 0.01
INT16 = 32767
# Scores that differ by more than this share are not those of the result.
TOLERANCE = 1e-3


@dataclass(frozen=True)
class Episodes:
    """One scenario, as several policies met it.

    Attributes:
        data: What the page plays.
        max_error: Largest error after settling of each policy, m, x and y.
        missing: Why a policy is not there, by name.
    """

    data: dict[str, Any]
    max_error: dict[str, tuple[float, float]]
    missing: dict[str, str]


def packed(values: Array) -> dict[str, Any]:
    """An array as 16-bit integers, in base64, with the scale that gives it back."""
    scale = float(np.abs(values).max(initial=0.0)) / INT16 or 1.0
    whole = np.rint(values / scale).astype("<i2")
    data = base64.b64encode(whole.tobytes()).decode()
    return {"shape": list(values.shape), "scale": scale, "data": data}


def replayed(
    contenders: Sequence[Contender], scenario: Scenario, progress: Callable[[], object]
) -> Episodes:
    """Let policies act in a scenario.

    Args:
        contenders: The policies.
        scenario: The scenario.
        progress: Called after each of them.

    Returns:
        What they did; nobody's if none of them acts.
    """
    shown = instants(scenario, FPS, 1.0)
    takes: list[Take] = []
    missing: dict[str, str] = {}
    for contender in contenders:
        try:
            takes.append(take(contender, scenario, shown))
        except ValueError as error:
            missing[contender.name] = str(error)
        progress()
    if not takes:
        return Episodes({"episodes": {}}, {}, missing)
    longest = max(takes, key=lambda each: len(each.pictures)).pictures
    period = scenario.conditions.control_period
    data = frame(scenario, longest[0].robot, longest[0].path[shown]) | {
        "start": period,
        "period": period,
        "current": packed(np.array([each.current for each in longest])),
        "reference": packed(np.array([each.reference.angles for each in longest])),
        "episodes": {each.name: _episode(each) for each in takes},
    }
    return Episodes(data, {each.name: _max_error(each) for each in takes}, missing)


def recorded(scenario: Scenario, records: Mapping[str, Record]) -> dict[str, Any]:
    """What the page plays of records at the paper's step, by the name of their law."""
    first = next(iter(records.values()))
    spacing = float(first.time[1] - first.time[0])
    every, sparse = round(RECORD_PERIOD / spacing), round(1.0 / (FPS * spacing))
    return frame(scenario, Robot(), first.reference[::sparse]) | {
        "start": 0.0,
        "period": every * spacing,
        "current": None,
        "reference": None,
        "episodes": {
            name: {
                "theta": packed(record.theta[::sparse]),
                "thrust": None,
                "error": packed(record.error[::every]),
                "effort": packed(record.effort[::every]),
                "lost": False,
            }
            for name, record in records.items()
        },
    }


def frame(scenario: Scenario, robot: Robot, path: Array) -> dict[str, Any]:
    """What all policies of a scenario have in common; path: at every picture, m, (k, 2)."""
    return {
        "duration": scenario.duration,
        "settle": scenario.settle_time,
        "shifts": list(scenario.shifts),
        "limit": scenario.conditions.thruster_limit,
        "frame": 1.0 / FPS,
        "robot": {
            "length": robot.link_length,
            "halfWidth": robot.half_width,
            "thrusters": [
                {"link": each.link - 1, "normal": each.direction == "normal"}
                for each in robot.thrusters
            ],
        },
        "path": packed(path),
    }


def differing(
    found: Mapping[str, tuple[float, float]], expected: Mapping[str, tuple[float, float]]
) -> list[str]:
    """Policies whose largest errors, m, in x and y, are not as expected."""
    return [
        name
        for name, errors in expected.items()
        if not np.allclose(found[name], errors, rtol=TOLERANCE, atol=0.0)
    ]


def _episode(each: Take) -> dict[str, Any]:
    return {
        "theta": packed(np.array([picture.body.angles for picture in each.pictures])),
        "thrust": packed(np.array([picture.thrust for picture in each.pictures])),
        "error": packed(each.pictures[-1].errors[1:]),
        "effort": packed(np.abs(each.trajectory.command).mean(axis=1)),
        "lost": each.trajectory.lost,
    }


def _max_error(each: Take) -> tuple[float, float]:
    found = score(each.trajectory)
    return float(found["max_error_x"]), float(found["max_error_y"])
