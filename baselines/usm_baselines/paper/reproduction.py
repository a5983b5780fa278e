"""The paper's Table 1: its laws on the declared scenario, run as printed.

The scenario is `named("table1", mode)`; what the paper leaves open and is declared here besides is
the heading gain and the observer's start (docs/reproduction.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from multiprocessing.pool import ThreadPool
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from usm_baselines.laws.pd import FORCE, MASS, OBSERVER, PDGains
from usm_baselines.laws.super_twisting import SuperTwistingGains
from usm_baselines.paper.paper_rate import Law, Record, simulate
from usm_gym.robot import Robot
from usm_gym.support.results import Part, Provenance, Result
from usm_gym.support.validation import Number, require, validated
from usm_gym.task.metrics import max_error, settled_error
from usm_gym.task.sampling import named
from usm_gym.task.scenario import MODES, Mode, Scenario
from usm_gym.task.stored_scenario import StoredScenario
from usm_gym.world import world_of

A = TypeVar("A")
K = TypeVar("K")
R = TypeVar("R")

# The axes of the paper's robot.
AXES = world_of(Robot()).axes
STEP = 1e-5
IMPLICIT_STEP = 5e-4
# The largest thruster limit that conditions may have, N; no run of the table comes near it.
UNLIMITED = 1000.0
# Records are kept, and errors looked at, every so often, s.
SAMPLE_TIME = 1e-3
HEADING_GAIN = 125.0
# Sliding variable at the start that makes the printed settled errors of the STA, m/s.
SIGMA_START = (0.0070, 0.0057)

# The columns of Table 1 and the settled errors of section 5.3, with the modes that they belong to.
PARTS: dict[str, Mode] = {"torpedo": "torpedo", "operation": "operation", "settled": "operation"}
# Errors by row, part and axis, m.
Errors = Mapping[str, Mapping[str, Mapping[str, Number]]]
PAPER: Errors = {
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
# The paper's row that a row of ours is compared with.
PRINTED = {"sta": "sta", "sta-measured": "sta", "pd": "pd"}


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


@validated
class Declaration(Part):
    """What is declared beside the paper.

    Attributes:
        scenarios: Scenarios by mode; in JSON they stand beside the other fields.
        heading_gain: Gain of the heading, N m/rad.
        sigma_start: Sliding variable at the start, m/s.
        implicit_step: Step of the row "sta-implicit", s.
    """

    beside: ClassVar[str] = "scenarios"
    scenarios: Mapping[str, StoredScenario]
    heading_gain: Number
    sigma_start: tuple[Number, ...]
    implicit_step: Number


@validated
class ReproductionResult(Result):
    """Table 1 beside the paper's, as `usm reproduce` writes it.

    Attributes:
        step: Step of plant and laws, s.
        settle_time: From when on errors count, s.
        rows: Our errors by row, part and axis, m.
        thrust_effort: Mean thrust by row and mode, N.
        peak_joint_torque: Largest torque of a joint by row and mode, N m.
        paper: The paper's errors, m.
        scenario: What is declared.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "reproduction"
    step: Number
    settle_time: Number
    rows: Errors
    thrust_effort: Mapping[str, Mapping[str, Number]]
    peak_joint_torque: Mapping[str, Mapping[str, Number]]
    paper: Errors
    scenario: Declaration
    provenance: Provenance

    def __post_init__(self) -> None:
        """Refuse a table with gaps."""
        require(self.rows and self.paper, "rows", list(self.rows), "those of the paper")
        for name, row in (*self.paper.items(), *self.rows.items()):
            require(name in self.rows, "rows", list(self.rows), f"{name} among them")
            parts = {part: tuple(errors) for part, errors in row.items()}
            known = dict.fromkeys(PARTS, self.axes)
            require(parts == known and self.axes, f"parts of {name}", parts, f"{known}")
        parts_printed = [part for row in self.paper.values() for part in row.values()]
        printed = [error for part in parts_printed for error in part.values()]
        require(all(printed), "paper", printed, "errors other than 0")

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the table."""
        row = next(iter(self.rows.values()))
        return tuple(next(iter(row.values()), ()))

    def printed(self, row: str) -> Mapping[str, Mapping[str, Number]] | None:
        """The paper's errors, by part and axis, m, that a row of ours is compared with."""
        return self.paper.get(PRINTED.get(row, row))


def declaration() -> Declaration:
    """What is declared, as it stands in results."""
    return Declaration(
        scenarios={mode: named("table1", mode) for mode in MODES},
        heading_gain=HEADING_GAIN,
        sigma_start=SIGMA_START,
        implicit_step=IMPLICIT_STEP,
    )


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
    """The laws of Table 1, "sta" and "pd", as declared."""
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
    listed = []
    for mode in MODES:
        scenario = named("table1", mode)
        law = laws(scenario)
        fine, coarse = at_step(scenario, step), at_step(scenario, IMPLICIT_STEP)
        listed.append(Case("sta", mode, law["sta"], fine))
        listed.append(Case("sta-measured", mode, law["sta"]._replace(measured=True), fine))
        for name, reading in (("pd", FORCE), ("pd-mass", MASS), ("pd-observer", OBSERVER)):
            listed.append(Case(name, mode, law["pd"]._replace(reading=reading), fine))
        listed.append(Case("sta-implicit", mode, law["sta"]._replace(implicit=True), coarse))
    return listed


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


def reproduction(
    step: float, records: Mapping[tuple[str, Mode], Record], provenance: Provenance
) -> ReproductionResult:
    """Table 1 from the records of all cases at a step, s."""
    rows: dict[str, dict[str, dict[str, float]]] = {}
    effort: dict[str, dict[str, float]] = {}
    torque: dict[str, dict[str, float]] = {}
    for case in cases(step):
        record = records[case.row, case.mode]
        rows.setdefault(case.row, {}).update(errors_of(case, record))
        late = record.time >= case.scenario.settle_time
        effort.setdefault(case.row, {})[case.mode] = float(record.effort[late].mean())
        torque.setdefault(case.row, {})[case.mode] = float(record.joint_torque.max())
    return ReproductionResult(
        step=step,
        settle_time=named("table1", "operation").settle_time,
        rows=rows,
        thrust_effort=effort,
        peak_joint_torque=torque,
        paper=PAPER,
        scenario=declaration(),
        provenance=provenance,
    )


def errors_of(case: Case, record: Record) -> dict[str, dict[str, float]]:
    """The largest errors of a case, m, by axis: in its mode, and settled where joints move."""
    scenario, time, error = case.scenario, record.time, record.error
    errors: dict[str, dict[str, float]]
    errors = {case.mode: by_axis(max_error(time, error, scenario.settle_time))}
    if scenario.shifts:
        settled = settled_error(time, error, scenario.shifts, scenario.settle_time)
        errors["settled"] = by_axis(settled)
    return errors


def by_axis(values: NDArray[np.float64]) -> dict[str, float]:
    """Numbers by axis."""
    return dict(zip(AXES, values.tolist(), strict=True))
