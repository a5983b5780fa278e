"""The study of the open items of the paper as files hold it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import ClassVar

from pydantic import TypeAdapter

from usm_gym.support.results import Provenance, Result
from usm_gym.support.validation import Number, Switch, validated
from usm_gym.task.stored_scenario import StoredScenario, as_json


@validated
class LawRecord:
    """A control law as files hold it.

    Attributes:
        reading: Reading of the PD controller; -1 for the STA.
        measured: Whether the velocity is measured.
        implicit: Whether the law is discretised implicitly.
        start: Estimate of the velocity at the start, m/s.
        gains: Gains by name.
    """

    reading: int
    measured: Switch
    implicit: Switch
    start: tuple[Number, ...]
    gains: Mapping[str, Number]


@validated
class Outcome:
    """What is kept of a run in which the robot was not lost.

    Attributes:
        errors: Largest errors by part of the table and axis, m.
        thrust_effort: Mean thrust after settling, N.
        peak_force: Largest force on the centre of mass after settling, N.
        peak_joint_torque: Largest torque of a joint, N m.
        sigma: Largest |sigma| in the "first" and in the "last" second, by axis, m/s.
    """

    errors: Mapping[str, Mapping[str, Number]]
    thrust_effort: Number
    peak_force: Number
    peak_joint_torque: Number
    sigma: Mapping[str, Mapping[str, Number]]


@validated
class TrialResult:
    """A run with its outcome.

    Attributes:
        item: The open item.
        value: What is put in its place.
        row: The law, "sta" or "pd".
        mode: "operation" or "torpedo".
        scenario: The scenario.
        law: The law with the changes made.
        result: The outcome; None where the robot was lost.
    """

    item: str
    value: str
    row: str
    mode: str
    scenario: StoredScenario
    law: LawRecord
    result: Outcome | None

    @property
    def key(self) -> str:
        """What the outcome depends on: equal keys, equal outcomes."""
        law = TypeAdapter(LawRecord).dump_python(self.law, mode="json")
        return json.dumps([as_json(self.scenario), law], sort_keys=True)


@validated
class SensitivityResult(Result):
    """The study of the open items, as `usm reproduce --study` writes it.

    Attributes:
        runs: The runs that are done.
        provenance: Where all this comes from.
    """

    kind: ClassVar[str] = "study of the open items"
    marked: ClassVar[bool] = False
    runs: tuple[TrialResult, ...]
    provenance: Provenance

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes of the errors; none if every robot was lost."""
        outcomes = [run.result for run in self.runs if run.result is not None]
        return tuple(next(iter(outcomes[0].errors.values()))) if outcomes else ()
