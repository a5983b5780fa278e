"""The open items of the paper one at a time, and their effect on the numbers of Table 1."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from usm_baselines.laws.pd import FORCE, MASS, OBSERVER
from usm_baselines.paper.paper_rate import Law, LostRobotError, simulate
from usm_baselines.paper.reproduction import (
    SAMPLE_TIME,
    STEP,
    Case,
    at_step,
    by_axis,
    errors_of,
    laws,
    side_by_side,
    velocity_start,
)
from usm_baselines.paper.sensitivity_result import (
    LawRecord,
    Outcome,
    SensitivityResult,
    TrialResult,
)
from usm_gym.robot import Robot
from usm_gym.support.results import Provenance
from usm_gym.support.validation import UsageError, in_one_line
from usm_gym.task.sampling import named
from usm_gym.task.scenario import MODES, Mode

ROWS = ("sta", "pd")
# Starts of the sliding variable in both axes, m/s, for the study of the oscillation that remains.
STARTS = (0.001, 0.002, 0.004, 0.007, 0.01, 0.02, 0.04, 0.049)
PERIODS = (1e-4, 1e-3, 5e-3, 2e-2)
# Physics step where the control period is longer, s.
LONGEST_STEP = 5e-4
SENSORS_AND_THRUSTERS: dict[str, dict[str, Any]] = {
    "ideal": {},
    "noise": {"position_noise": 5e-5},
    "lag": {"thruster_time_constant": 0.05},
    "noise, lag, 20 N": {
        "position_noise": 5e-5,
        "thruster_time_constant": 0.05,
        "thruster_limit": 20.0,
    },
}


@dataclass(frozen=True)
class Variation:
    """What is changed in the declared scenario and laws, field by field.

    Attributes:
        conditions: Fields of the conditions.
        scenario: Fields of the scenario.
        inspection: Fields of the joint motion, where joints move.
        joints: Fields of the scenario, where joints move.
        law: Fields of both laws.
        super_twisting: Gains of the STA.
        pd_reading: Reading of the PD controller.
        heading_gain_factor: Factor on the heading gain of both.
        sigma_start: Sliding variable at the start, m/s.
    """

    conditions: dict[str, Any] = field(default_factory=dict)
    scenario: dict[str, Any] = field(default_factory=dict)
    inspection: dict[str, Any] = field(default_factory=dict)
    joints: dict[str, Any] = field(default_factory=dict)
    law: dict[str, Any] = field(default_factory=dict)
    super_twisting: dict[str, Any] = field(default_factory=dict)
    pd_reading: int = FORCE
    heading_gain_factor: float = 1.0
    sigma_start: tuple[float, float] | None = None


@dataclass(frozen=True)
class Trial:
    """One run of the study.

    Attributes:
        item: The open item.
        value: What is put in its place.
        case: What is run.
    """

    item: str
    value: str
    case: Case


# Joint gains and filter of the scenario "nominal".
OF_THE_BENCHMARK = Variation(
    joints={"joint_stiffness": None, "joint_damping": None}, inspection={"filter_frequency": 8.0}
)


def variations() -> dict[str, dict[str, Variation]]:
    """The open items, and what takes their place; the first is the declaration itself."""
    water = named("table1", "operation").water
    normal_drag = replace(water, coefficients=(1.0, 0.5, 1.0, 1.0, 1.0, 1.0))
    return {
        "as declared": {"": Variation()},
        "alpha(0)": {
            f"{alpha:g}": Variation(super_twisting={"alpha_start": alpha})
            for alpha in (0.05, 0.5, 5.0)
        },
        "sigma(0)": {
            "0": Variation(sigma_start=(0.0, 0.0)),
            "20 mm/s": Variation(sigma_start=(0.02, 0.02)),
            "p2(0) = 0": Variation(law={"start": (0.0, 0.0)}),
        },
        "step, explicit": {f"{step:g} s": stepped(step, False) for step in (1e-6, 1e-4, 1e-3)},
        "step, implicit": {f"{step:g} s": stepped(step, True) for step in (1e-5, 1e-4, 1e-3)},
        "exponent of k2": {"2/3": Variation(super_twisting={"k2_exponent": 2 / 3})},
        "velocity": {
            "measured, (9)": Variation(law={"measured": True}),
            "measured; filter, 30 rad/s": Variation(
                law={"measured": True}, inspection={"filter_frequency": 30.0}
            ),
        },
        "PD": {
            "in 1/s^2": Variation(pd_reading=MASS),
            "in (19)": Variation(pd_reading=OBSERVER),
        },
        "water": {
            "kelasidi2014": Variation(conditions={"hydrodynamics": "kelasidi2014"}),
            "half the normal drag": Variation(scenario={"water": normal_drag}),
            "quadratic drag": Variation(conditions={"drag": "quadratic"}),
        },
        # With the row of (4) as printed a moment M makes the forces of the moment M l.
        "moment row": {"as printed": Variation(heading_gain_factor=Robot().half_length)},
        "heading": {"of the head": Variation(scenario={"heading": "head"})},
        "joint references": {
            f"filter, {frequency:g} rad/s": Variation(inspection={"filter_frequency": frequency})
            for frequency in (500.0, 100.0, 30.0, 8.0)
        },
        "joint gains": {
            f"{k_p:g}, {k_d:g}": Variation(joints={"joint_stiffness": k_p, "joint_damping": k_d})
            for k_p, k_d in (
                (90000.0, 1500.0),
                (30000.0, 150.0),
                (900.0, 15.0),
                (280.0, 4.7),
                (20.0, 5.0),
            )
        },
        "joints": {"of the benchmark": OF_THE_BENCHMARK},
        "noise": {
            f"{1e3 * noise:g} mm": Variation(conditions={"position_noise": noise})
            for noise in (1e-5, 5e-5)
        },
        "thruster lag": {
            f"{lag:g} s": Variation(conditions={"thruster_time_constant": lag})
            for lag in (0.01, 0.05)
        },
        "thruster limit": {
            f"{limit:g} N": Variation(conditions={"thruster_limit": limit})
            for limit in (100.0, 20.0)
        },
    }


def stepped(step: float, implicit: bool) -> Variation:
    """Another step of plant and laws."""
    conditions = {"control_period": step, "physics_step": step}
    return Variation(conditions=conditions, law={"implicit": implicit})


def case_of(variation: Variation, row: str, mode: Mode) -> Case:
    """A run of "sta" or "pd" under a variation."""
    scenario = at_step(named("table1", mode), STEP)
    conditions = replace(scenario.conditions, **variation.conditions)
    scenario = replace(scenario, conditions=conditions, **variation.scenario)
    if scenario.shifts:
        inspection = replace(scenario.inspection, **variation.inspection)
        scenario = replace(scenario, inspection=inspection, **variation.joints)
    law: Law = laws(scenario)[row]
    if variation.sigma_start is not None:
        law = law._replace(start=velocity_start(scenario, variation.sigma_start))
    factor = variation.heading_gain_factor
    sta = law.super_twisting._replace(**variation.super_twisting)
    law = law._replace(
        super_twisting=sta._replace(heading_gain=factor * sta.heading_gain),
        pd=law.pd._replace(heading_gain=factor * law.pd.heading_gain),
        **variation.law,
    )
    return Case(
        row, mode, law._replace(reading=variation.pd_reading) if row == "pd" else law, scenario
    )


def trials() -> list[Trial]:
    """All runs of the study."""
    listed = [
        Trial(item, value, case_of(variation, row, mode))
        for item, values in variations().items()
        for value, variation in values.items()
        for row in ROWS
        for mode in MODES
    ]
    for sigma in STARTS:
        variation = Variation(sigma_start=(sigma, sigma))
        listed.append(Trial("oscillation", f"{sigma:g}", case_of(variation, "sta", "torpedo")))
    for period in PERIODS:
        for name, conditions in SENSORS_AND_THRUSTERS.items():
            for implicit in (False, True):
                timing = {"control_period": period, "physics_step": min(period, LONGEST_STEP)}
                variation = Variation(conditions=timing | conditions, law={"implicit": implicit})
                value = f"{'implicit' if implicit else 'explicit'}, {name}, {period:g}"
                listed += [
                    Trial("rate", value, case_of(variation, row, "operation")) for row in ROWS
                ]
    return listed


def study(
    path: Path, workers: int, progress: Callable[[int, int], object], chosen: Sequence[Trial]
) -> SensitivityResult:
    """Run what a file does not hold yet, keeping the file up to date after every run.

    Args:
        path: The file; results of another commit in it are dropped.
        workers: Threads.
        progress: Called with the physics steps done and those there are.
        chosen: The runs.

    Returns:
        What the file then holds.
    """
    origin = Provenance.here({})
    planned = [planned_result(trial) for trial in chosen]
    known = stored(path, origin)
    todo = {
        run.key: trial.case
        for trial, run in zip(chosen, planned, strict=True)
        if run.key not in known
    }
    total, done = sum(map(cost, todo.values())), 0

    def finished() -> SensitivityResult:
        runs = (replace(run, result=known[run.key]) for run in planned if run.key in known)
        return SensitivityResult(runs=tuple(runs), provenance=origin)

    # The longest first, so that no thread is left with one at the end.
    ordered = sorted(todo, key=lambda key: -cost(todo[key]))
    for key, result in side_by_side(outcome, {key: todo[key] for key in ordered}, workers):
        known[key] = result
        finished().write(path)
        done += cost(todo[key])
        progress(done, total)
    whole = finished()
    whole.write(path)
    return whole


def outcome(case: Case) -> Outcome | None:
    """What a run of the study leaves; None where the robot is lost."""
    scenario = case.scenario
    every = max(1, round(SAMPLE_TIME / scenario.conditions.physics_step))
    try:
        record = simulate(scenario, case.law, every)
    except LostRobotError:
        return None
    late = record.time >= scenario.settle_time
    size = np.abs(record.sigma)
    first, last = record.time < 1.0, record.time >= record.time[-1] - 1.0
    return Outcome(
        errors=errors_of(case, record),
        thrust_effort=float(record.effort[late].mean()),
        peak_force=float(np.abs(record.force[late]).max()),
        peak_joint_torque=float(record.joint_torque.max()),
        sigma={
            "first": by_axis(size[first].max(axis=0)),
            "last": by_axis(size[last].max(axis=0)),
        },
    )


def planned_result(trial: Trial) -> TrialResult:
    """A run as files hold it, without its outcome."""
    law = trial.case.law
    gains = law.pd if trial.case.row == "pd" else law.super_twisting
    return TrialResult(
        item=trial.item,
        value=trial.value,
        row=trial.case.row,
        mode=trial.case.mode,
        scenario=trial.case.scenario,
        law=LawRecord(
            reading=law.reading,
            measured=law.measured,
            implicit=law.implicit,
            start=law.start,
            gains=gains._asdict(),
        ),
        result=None,
    )


def cost(case: Case) -> int:
    """Physics steps of a run."""
    return case.scenario.steps * case.scenario.conditions.substeps


def stored(path: Path, origin: Provenance) -> dict[str, Outcome | None]:
    """Outcomes of this commit in the file, by key."""
    if not path.exists():
        return {}
    try:
        kept = SensitivityResult.read(path)
    except UsageError as error:
        raise UsageError(f"{in_one_line(error)}; remove it to start anew") from error
    return (
        {}
        if kept.provenance.commit != origin.commit
        else {run.key: run.result for run in kept.runs}
    )
