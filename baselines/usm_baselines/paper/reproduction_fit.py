"""A refit of what the paper leaves open to what it prints.

Differential evolution over the freedoms of `FREEDOM`, on the eight numbers of `seen`: the six of
the PD controller, and the STA's peaks in operation mode. All other numbers are predictions.
Candidates are scored with the implicit laws at a coarser step; the best is checked at the paper's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from usm_baselines.paper.paper_rate import Law, simulate
from usm_baselines.paper.reproduction import (
    HEADING_GAIN,
    IMPLICIT_STEP,
    PAPER,
    SAMPLE_TIME,
    STEP,
    at_step,
    laws,
    velocity_start,
)
from usm_gym.support.files import read_json, write_json
from usm_gym.support.provenance import provenance
from usm_gym.support.validation import in_one_line
from usm_gym.task.loss import LOST_ERROR
from usm_gym.task.metrics import max_error, settled_error
from usm_gym.task.sampling import named
from usm_gym.task.scenario import Mode, Scenario

Array = NDArray[np.float64]

# What is free, and between what, spread evenly in the logarithm.
FREEDOM = {
    "speed": (0.02, 0.12),  # of the path, m/s
    "amplitude": (0.05, 0.5),  # of the path, m
    "frequency": (0.03, 0.2),  # of the path, rad/s
    "deflection": (0.2, 2.0),  # of the head, rad
    "joint_stiffness": (1e3, 1e6),  # N m/rad
    "joint_corner": (20.0, 1000.0),  # joint stiffness over damping, 1/s
    "heading_gain": (5.0, 500.0),  # N m/rad
    "look_ahead": (0.5, 8.0),  # m
}
SEED = 0
POPULATION = 24
# A factor of so much off the paper's number counts one.
AIM = {"pd": 1.3, "sta": 2.0}
Freedoms = dict[str, float]


def declared() -> Freedoms:
    """The freedoms as the scenario "table1" declares them."""
    operation, torpedo = named("table1", "operation"), named("table1", "torpedo")
    stiffness, damping = operation.joint_stiffness or 0.0, operation.joint_damping or 0.0
    return {
        "speed": operation.path.speed,
        "amplitude": operation.path.amplitude,
        "frequency": operation.path.frequency,
        "deflection": operation.inspection.deflections[0],
        "joint_stiffness": stiffness,
        "joint_corner": stiffness / damping,
        "heading_gain": HEADING_GAIN,
        "look_ahead": torpedo.look_ahead or 0.0,
    }


def scenario_of(freedoms: Freedoms, mode: Mode, step: float) -> Scenario:
    """The scenario "table1" with other freedoms, at a step (s)."""
    scenario = at_step(named("table1", mode), step)
    path = replace(
        scenario.path,
        speed=freedoms["speed"],
        amplitude=freedoms["amplitude"],
        frequency=freedoms["frequency"],
    )
    scenario = replace(
        scenario,
        path=path,
        joint_stiffness=freedoms["joint_stiffness"],
        joint_damping=freedoms["joint_stiffness"] / freedoms["joint_corner"],
    )
    if mode == "torpedo":
        return replace(scenario, look_ahead=freedoms["look_ahead"])
    size = freedoms["deflection"]
    return replace(
        scenario, inspection=replace(scenario.inspection, deflections=(size, -size, 0.0))
    )


def numbers(freedoms: Freedoms, step: float, implicit: bool) -> dict[str, list[float]]:
    """The numbers that the fit sees, (x, y) in m; `LOST_ERROR` where the robot is lost."""
    found: dict[str, list[float]] = {}
    chosen: tuple[tuple[str, Mode], ...] = (
        ("pd", "torpedo"),
        ("pd", "operation"),
        ("sta", "operation"),
    )
    for row, mode in chosen:
        scenario = scenario_of(freedoms, mode, step)
        law: Law = laws(scenario)[row]._replace(implicit=implicit, start=velocity_start(scenario))
        gain = freedoms["heading_gain"]
        law = law._replace(
            super_twisting=law.super_twisting._replace(heading_gain=gain),
            pd=law.pd._replace(heading_gain=gain),
        )
        parts = [mode, "settled"] if (row, mode) == ("pd", "operation") else [mode]
        try:
            record = simulate(scenario, law, max(1, round(SAMPLE_TIME / step)))
        except ValueError:
            found |= {f"{row} {part}": [LOST_ERROR] * 2 for part in parts}
            continue
        time, error, settle = record.time, record.error, scenario.settle_time
        found[f"{row} {mode}"] = max_error(time, error, settle).tolist()
        if "settled" in parts:
            shifts = scenario.shifts
            found[f"{row} settled"] = settled_error(time, error, shifts, settle).tolist()
    return found


def seen() -> dict[str, list[float]]:
    """What the paper prints for the same numbers, m."""
    names = ("pd torpedo", "pd operation", "pd settled", "sta operation")
    return {name: list(PAPER[name.split()[0]][name.split()[1]].values()) for name in names}


def residual(found: dict[str, list[float]]) -> float:
    """Sum of squares of log(ours / the paper's) over log(aim)."""
    total = 0.0
    for name, printed in seen().items():
        unit = math.log(AIM[name.split()[0]])
        ratio = np.log(np.divide(found[name], printed)) / unit
        total += float(ratio @ ratio)
    return total


def fit(
    path: Path, generations: int, workers: int, progress: Callable[[int, int], object]
) -> dict[str, Any]:
    """Fit, keeping every evaluation in a file after every generation.

    The search is a function of its seed and of the scores alone, so that an interrupted fit that is
    started again retraces its way from the file and goes on.

    Args:
        path: The file.
        generations: How many generations.
        workers: Threads.
        progress: Called with the evaluations done and those there will be.

    Returns:
        What the file then holds: freedom, what was seen, and declaration, numbers and residual of
        the declaration and of the best candidate, at the coarse step and at the paper's.
    """
    low, high = np.log(list(FREEDOM.values())).T
    origin = provenance({"fit": SEED})
    scores = stored(path, origin)
    start = np.random.default_rng(SEED).random((POPULATION, len(FREEDOM)))
    start[0] = (np.log(list(declared().values())) - low) / (high - low)
    planned = POPULATION * (generations + 1)
    done = 0

    def freedoms_of(x: Array) -> Freedoms:
        values = np.exp(low + x * (high - low)).tolist()
        return dict(zip(FREEDOM, values, strict=True))

    def score(x: Array) -> float:
        return residual(numbers(freedoms_of(x), IMPLICIT_STEP, implicit=True))

    def generation(_: object, candidates: Iterable[Array]) -> list[float]:
        nonlocal done
        chosen = [np.asarray(x) for x in candidates]
        fresh = [x for x in chosen if tuple(x) not in scores]
        for x, each in zip(fresh, pool.map(score, fresh), strict=True):
            scores[tuple(x)] = each
        if fresh:
            write_json(path, {"evaluations": listed(scores), "provenance": origin})
        done += len(chosen)
        progress(done, planned)
        return [scores[tuple(x)] for x in chosen]

    with ThreadPoolExecutor(workers) as pool:
        best = differential_evolution(
            score,
            Bounds(np.zeros(len(FREEDOM)), np.ones(len(FREEDOM))),
            init=start,
            maxiter=generations,
            tol=0.0,
            rng=SEED,
            updating="deferred",
            polish=False,
            workers=generation,
        )
    document = {
        "freedom": {name: list(bounds) for name, bounds in FREEDOM.items()},
        "seen": seen(),
        "aim": AIM,
        "declared": assessed(declared()),
        "fitted": assessed(freedoms_of(best.x)),
        "evaluations": listed(scores),
        "provenance": origin,
    }
    write_json(path, document)
    return document


def assessed(freedoms: Freedoms) -> dict[str, Any]:
    """Freedoms with their numbers and residual at both steps."""
    result: dict[str, Any] = {"freedoms": freedoms}
    for name, step, implicit in (("coarse", IMPLICIT_STEP, True), ("paper", STEP, False)):
        found = numbers(freedoms, step, implicit)
        result[name] = {"step": step, "numbers": found, "residual": residual(found)}
    return result


def stored(path: Path, origin: dict[str, Any]) -> dict[tuple[float, ...], float]:
    """Scores of this commit in the file, by candidate."""
    try:
        document = read_json(path)
        if document["provenance"]["commit"] != origin["commit"]:
            return {}
        return {tuple(x): score for x, score in document["evaluations"]}
    except FileNotFoundError:
        return {}
    except (ValueError, KeyError, TypeError) as error:
        reason = in_one_line(error)
        raise ValueError(f"{path} is no fit: {reason}; remove it to start anew") from error


def listed(scores: dict[tuple[float, ...], float]) -> list[Any]:
    """Scores in JSON's types."""
    return [[list(map(float, x)), score] for x, score in scores.items()]
