"""Every variation varies something, and an interrupted study goes on."""

import dataclasses
import json

import numba
import numpy as np
import pytest
from usm_baselines.paper import sensitivity
from usm_baselines.paper.sensitivity import case_of, planned_result, study, trials, variations
from usm_baselines.paper.sensitivity_result import SensitivityResult

from usm_gym.plant import thrusters
from usm_gym.robot import Robot
from usm_gym.task.scenario import MODES


def keys_of(item, value):
    variation = variations()[item][value]
    return {
        (row, mode): planned_result(
            sensitivity.Trial(item, value, case_of(variation, row, mode))
        ).key
        for row in sensitivity.ROWS
        for mode in MODES
    }


def test_every_variation_differs_from_the_declaration_and_from_every_other():
    names = [(item, value) for item, values in variations().items() for value in values]
    seen = [tuple(keys_of(*name).values()) for name in names]
    assert len(set(seen)) == len(seen)
    declared, gains, reading = (
        keys_of(*name)
        for name in (("as declared", ""), ("joint gains", "20, 5"), ("PD", "in (19)"))
    )
    # Joints move in operation mode alone, and a reading of the PD is nothing to the STA.
    assert [run for run in declared if declared[run] != gains[run]] == [
        ("sta", "operation"),
        ("pd", "operation"),
    ]
    assert {row for row, mode in declared if declared[row, mode] != reading[row, mode]} == {"pd"}


def short_trials():
    chosen = [
        trial
        for trial in trials()
        if (trial.item, trial.value) in (("as declared", ""), ("PD", "in (19)"))
    ]
    return [
        dataclasses.replace(
            trial,
            case=dataclasses.replace(
                trial.case,
                scenario=dataclasses.replace(
                    trial.case.scenario, duration=0.05 * (i + 1), settle_time=0.01
                ),
            ),
        )
        for i, trial in enumerate(chosen)
    ]


def test_an_interrupted_study_goes_on_and_ends_as_one_that_was_not(tmp_path):
    calls = []

    def interrupt(done, total):
        calls.append((done, total))
        raise KeyboardInterrupt

    path = tmp_path / "study.json"
    with pytest.raises(KeyboardInterrupt):
        study(path, 1, interrupt, short_trials())
    stopped = json.loads(path.read_text())["runs"]
    assert 0 < len(stopped) < len(short_trials())
    whole = study(path, 2, lambda done, total: calls.append((done, total)), short_trials())
    assert calls[0][1] > calls[-1][1]  # there was less to do
    assert whole == study(tmp_path / "other.json", 2, lambda done, total: None, short_trials())
    assert SensitivityResult.read(path) == whole
    assert all(run.result.peak_force > 0 for run in whole.runs)


def test_a_file_that_is_no_study_is_refused(tmp_path):
    path = tmp_path / "study.json"
    path.write_text("{}")
    with pytest.raises(
        ValueError, match=r"no complete study of the open items: runs is missing.*; remove it"
    ):
        study(path, 1, lambda done, total: None, short_trials())


@numba.njit
def forces(T, moment, found):
    thrusters.allocate(T, np.array([3.0, -2.0, moment]), 3, 0.0, np.empty((7, 3)), found)


def test_the_printed_moment_row_is_a_smaller_heading_gain():
    l = Robot().half_length
    T = np.random.default_rng(0).normal(size=(3, 5))
    printed = T.copy()
    printed[2] /= l
    ours, theirs = np.empty((2, 5))
    forces(T, 4.0 * l, ours)
    forces(printed, 4.0, theirs)
    np.testing.assert_allclose(ours, theirs, rtol=1e-12)
