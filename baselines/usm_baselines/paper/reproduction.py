"""The paper's Table 1: its laws on the declared scenario, run as printed.

The scenario is `named("table1", mode)`; what the paper leaves open and is declared here besides is
the heading gain and the observer's start (docs/reproduction.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from multiprocessing.pool import ThreadPool
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from usm_baselines.laws.pd import FORCE, MASS, OBSERVER, PDGains
from usm_baselines.laws.super_twisting import SuperTwistingGains
from usm_baselines.paper.paper_rate import Law, Record, simulate
from usm_gym.task.metrics import max_error, settled_error
from usm_gym.task.sampling import named
from usm_gym.task.scenario import MODES, Mode, Scenario

A = TypeVar("A")
K = TypeVar("K")
R = TypeVar("R")

STEP = 1e-5
IMPLICIT_STEP = 5e-4
# The largest thruster limit that conditions may have, N; no run of the table comes near it.
UNLIMITED = 1000.0
# Records are kept, and errors looked at, every so often, s.
SAMPLE_TIME = 1e-3
HEADING_GAIN = 125.0
# Sliding variable at the start that makes the printed settled errors of the STA, m/s.
SIGMA_START = (0.0070, 0.0057)

# Table 1, and the settled errors in operation mode of section 5.3, m.
PAPER = {
    "sta": {
        "torpedo": {"x": 3.6134e-4, "y": 2.8766e-4},
        "operation": {"x": 0.0126, "y": 0.0264},
        "settled": {"x": 3.6088e-4, "y": 2.8847e-4},
    },
    "pd": {
        "torpedo": {"x": 0.0018, "y": 0.0095},
        "operation": {"x": 0.0195, "y": 0.0227},
        "settled": {"x": 0.0032, "y": 0.0073},
    },
}


@dataclass(frozen=True)
class Case:
    """One row of the table in one mode.

    Attributes:
        row: Name of the row.
        mode: "operation" or "torpedo".
        law: The control law.
        scenario: The scenario, at the step of the case.
    """

    row: str
    mode: Mode
    law: Law
    scenario: Scenario


def at_step(scenario: Scenario, step: float) -> Scenario:
    """A scenario with one control action in every physics step of `step` s, thrusters unlimited."""
    conditions = replace(
        scenario.conditions, control_period=step, physics_step=step, thruster_limit=UNLIMITED
    )
    return replace(scenario, conditions=conditions)


def velocity_start(
    scenario: Scenario, sigma: tuple[float, float] = SIGMA_START
) -> tuple[float, float]:
    """p2(0) that gives sigma(0), m/s both; the error is 0 at the start."""
    path = scenario.path
    return path.speed + sigma[0], path.amplitude * path.frequency + sigma[1]


def laws(scenario: Scenario) -> dict[str, Law]:
    """The laws of Table 1, "sta" and "pd", with all that is declared."""
    law = Law(
        super_twisting=SuperTwistingGains(heading_gain=HEADING_GAIN),
        pd=PDGains(heading_gain=HEADING_GAIN),
        start=velocity_start(scenario),
    )
    return {"sta": law, "pd": law._replace(reading=FORCE)}


def cases(step: float = STEP) -> list[Case]:
    """All cases of the table.

    Args:
        step: Step of plant and laws, s, but for the row "sta-implicit".
    """
    found = []
    for mode in MODES:
        scenario = named("table1", mode)
        law = laws(scenario)
        fine, coarse = at_step(scenario, step), at_step(scenario, IMPLICIT_STEP)
        found.append(Case("sta", mode, law["sta"], fine))
        for name, reading in (("pd", FORCE), ("pd-mass", MASS), ("pd-observer", OBSERVER)):
            found.append(Case(name, mode, law["pd"]._replace(reading=reading), fine))
        found.append(Case("sta-implicit", mode, law["sta"]._replace(implicit=True), coarse))
    return found


def side_by_side(
    function: Callable[[A], R], arguments: Mapping[K, A], workers: int
) -> Iterator[tuple[K, R]]:
    """Results of a function by the name of its argument, as they come.

    Kernels leave the interpreter free, so threads are enough; an interruption does not wait for
    them.
    """
    with ThreadPool(workers) as pool:
        yield from pool.imap_unordered(lambda item: (item[0], function(item[1])), arguments.items())


def run_cases(
    chosen: list[Case], workers: int, progress: Callable[[], object]
) -> dict[tuple[str, Mode], Record]:
    """Run cases side by side."""
    records = {}
    by_name = {(case.row, case.mode): case for case in chosen}
    for name, record in side_by_side(run_case, by_name, workers):
        records[name] = record
        progress()
    return records


def run_case(case: Case) -> Record:
    """Run one case."""
    step = case.scenario.conditions.physics_step
    return simulate(case.scenario, case.law, every=max(1, round(SAMPLE_TIME / step)))


def table(chosen: list[Case], records: dict[tuple[str, Mode], Record]) -> dict[str, Any]:
    """Rows of Table 1 (m) and the thrust effort (N), by row and mode."""
    rows: dict[str, Any] = {}
    effort: dict[str, Any] = {}
    for case in chosen:
        record = records[case.row, case.mode]
        row = rows.setdefault(case.row, {})
        settle = case.scenario.settle_time
        row[case.mode] = axes(max_error(record.time, record.error, settle))
        if case.mode == "operation":
            shifts = case.scenario.shifts
            row["settled"] = axes(settled_error(record.time, record.error, shifts, settle))
        late = record.time >= settle
        effort.setdefault(case.row, {})[case.mode] = float(record.effort[late].mean())
    return {"rows": rows, "thrust_effort": effort}


def axes(values: NDArray[np.float64]) -> dict[str, float]:
    """A pair of numbers by axis."""
    x, y = values.tolist()
    return {"x": x, "y": y}
