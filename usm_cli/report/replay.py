"""Computes episodes for a page again, thins them out and packs them."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from usm_baselines.contender import Contender
from usm_baselines.paper.paper_rate import Record

from usm_cli.report.stage import stage_of
from usm_cli.take import instants, take
from usm_gym.evaluation import score
from usm_gym.support import parallel
from usm_gym.support.validation import UsageError
from usm_gym.task.metrics import MAX_ERROR
from usm_gym.task.modes import AnyScenario
from usm_gym.task.scenario import Scenario
from usm_gym.world import world_of

Array = NDArray[np.float64]

# Pictures of the robot per second; errors and thrust are kept at every control instant.
FPS = 10.0
# The time between two errors and efforts that are kept of a record at the paper's step, s.
RECORD_PERIOD = 0.01
INT16 = 32767
# Scores that differ by more than this share count as different from the result.
TOLERANCE = 1e-3


@dataclass(frozen=True)
class Acted:
    """A policy's episode.

    Attributes:
        data: The data that the page plays.
        reference: Reference postures, (pictures, numbers); None where no posture is asked for.
        current: Velocity of the water, m/s, (pictures, axes).
        max_error: Largest error after settling in each axis, m.
    """

    data: dict[str, Any]
    reference: Array | None
    current: Array
    max_error: tuple[float, ...]


@dataclass(frozen=True)
class Episodes:
    """Episodes of several policies in one scenario.

    Attributes:
        data: The data that the page plays.
        max_error: Largest errors after settling by policy, in each axis, m.
        missing: Why a policy is missing, by name.
    """

    data: dict[str, Any]
    max_error: dict[str, tuple[float, ...]]
    missing: dict[str, str]


def packed(values: Array) -> dict[str, Any]:
    """Pack an array as 16-bit integers in base64, with the scale that restores it."""
    scale = float(np.abs(values).max(initial=0.0)) / INT16 or 1.0
    whole = np.rint(values / scale).astype("<i2")
    data = base64.b64encode(whole.tobytes()).decode()
    return {"shape": list(values.shape), "scale": scale, "data": data}


def replayed(
    contenders: Sequence[Contender],
    scenario: AnyScenario,
    workers: int,
    progress: Callable[[], object],
) -> Episodes:
    """Let policies act in a scenario.

    Args:
        contenders: The policies.
        scenario: The scenario.
        workers: Number of processes.
        progress: Called after every policy.

    Returns:
        Their episodes; none if no policy acts.
    """
    done: dict[int, Acted | str] = {}
    tasks = [(contender, scenario) for contender in contenders]
    for index, outcome in parallel.results(act, tasks, workers):
        done[index] = outcome
        progress()
    acted: dict[str, Acted] = {}
    missing: dict[str, str] = {}
    for index, contender in enumerate(contenders):
        outcome = done[index]
        if isinstance(outcome, str):
            missing[contender.name] = outcome
        else:
            acted[contender.name] = outcome
    if not acted:
        return Episodes({"episodes": {}}, {}, missing)
    longest = max(acted.values(), key=lambda episode: len(episode.current))
    reference = longest.reference
    period = scenario.conditions.control_period
    shown = instants(scenario, FPS, 1.0)
    data = frame(scenario, scenario.reference_positions()[shown]) | {
        "start": period,
        "period": period,
        "current": packed(longest.current),
        "reference": None if reference is None else packed(reference),
        "episodes": {name: episode.data for name, episode in acted.items()},
    }
    errors = {name: episode.max_error for name, episode in acted.items()}
    return Episodes(data, errors, missing)


def act(contender: Contender, scenario: AnyScenario) -> Acted | str:
    """Let a policy act in a scenario, or say why it cannot."""
    try:
        acted = take(contender, scenario, instants(scenario, FPS, 1.0))
    except UsageError as error:
        return str(error)
    pictures, row = acted.pictures, score(acted.trajectory)
    stage, axes = stage_of(scenario.body), world_of(scenario.body).axes
    data = {
        "posture": packed(stage.postures(pictures)),
        "thrust": packed(np.array([picture.thrust for picture in pictures])),
        "error": packed(pictures[-1].errors[1:]),
        "effort": packed(np.abs(acted.trajectory.command).mean(axis=1)),
        "lost": acted.trajectory.lost,
    }
    return Acted(
        data,
        stage.references(pictures),
        np.array([picture.current for picture in pictures]),
        tuple(float(row[MAX_ERROR + axis]) for axis in axes),
    )


def recorded(scenario: Scenario, records: Mapping[str, Record]) -> dict[str, Any]:
    """The data that the page plays of records at the paper's step, by law."""
    first = next(iter(records.values()))
    spacing = float(first.time[1] - first.time[0])
    every, sparse = round(RECORD_PERIOD / spacing), round(1.0 / (FPS * spacing))
    return frame(scenario, first.reference[::sparse]) | {
        "start": 0.0,
        "period": every * spacing,
        "current": None,
        "reference": None,
        "episodes": {
            name: {
                "posture": packed(record.theta[::sparse]),
                "thrust": None,
                "error": packed(record.error[::every]),
                "effort": packed(record.effort[::every]),
                "lost": False,
            }
            for name, record in records.items()
        },
    }


def frame(scenario: AnyScenario, path: Array) -> dict[str, Any]:
    """The data that all policies of a scenario share; path: at every picture, m, (k, axes)."""
    stage = stage_of(scenario.body)
    return {
        "view": stage.view,
        "follower": stage.follower,
        "axes": list(world_of(scenario.body).axes),
        "duration": scenario.duration,
        "settle": scenario.settle_time,
        "shifts": list(scenario.shifts),
        "limit": scenario.conditions.thruster_limit,
        "frame": 1.0 / FPS,
        "robot": stage.robot(),
        "path": packed(path),
    }


def differing(
    errors: Mapping[str, tuple[float, ...]], expected: Mapping[str, tuple[float, ...]]
) -> list[str]:
    """The policies whose largest errors, m, differ from the expected ones."""
    return [
        name
        for name, wanted in expected.items()
        if not np.allclose(errors[name], wanted, rtol=TOLERANCE, atol=0.0)
    ]
