"""The figures that the paper prints and those that this project claims, within their bounds."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import usm_baselines
from numpy.typing import NDArray

import usm_gym
from usm_gym import Conditions, Scenario
from usm_gym.evaluation import Evaluation
from usm_gym.support.seeding import EVALUATION, stream
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named, sample
from usm_gym.task.scenario import Mode

Array = NDArray[np.float64]

IDEAL = PRESETS["ideal"]


def score(id: str, scenarios: list[Scenario], **gains: float) -> Evaluation:
    nominal = scenarios[0].nominal
    return usm_gym.evaluate(usm_baselines.make(id, nominal, **gains), scenarios)


def errors(id: str, mode: Mode, conditions: Conditions = IDEAL) -> Array:
    """Return the largest errors in x and y in the nominal scenario, mm."""
    scores = score(id, [named("nominal", mode, conditions)])
    assert not scores.failed.any()
    worst = [scores.per_episode[f"max_error_{axis}"][0] for axis in "xy"]
    return 1e3 * np.array(worst)


@cache
def in_the_field(id: str) -> Evaluation:
    """Score fifty drawn operations, as `usm evaluate --seed 0 --episodes 50` draws them."""
    field = PRESETS["field"]
    return score(id, [sample("operation", field, stream(0, EVALUATION, i)) for i in range(50)])


def test_the_default_step_is_fine_enough() -> None:
    default = errors("pd", "operation")
    fine = errors("pd", "operation", replace(IDEAL, physics_step=1e-4))
    np.testing.assert_allclose(default, fine, rtol=0.01)


def test_pd_in_the_ideal_operation_is_of_the_size_of_table_1() -> None:
    x, y = errors("pd", "operation")
    assert 5.0 < x < 40.0
    assert 5.0 < y < 40.0


def test_super_twisting_in_the_ideal_operation() -> None:
    x, y = errors("sta", "operation")
    assert x < 1.5
    assert y < 0.3


@pytest.mark.parametrize("mode", ["operation", "torpedo"])
def test_super_twisting_is_far_better_than_pd_where_actuators_are_ideal(mode: Mode) -> None:
    assert (errors("sta", mode) < 0.3 * errors("pd", mode)).all()


@pytest.mark.parametrize(
    ("id", "x", "y"),
    [("sta", (6.0, 13.0), (10.0, 20.0)), ("pd", (45.0, 90.0), (15.0, 35.0))],
)
def test_mean_errors_in_the_field(id: str, x: tuple[float, float], y: tuple[float, float]) -> None:
    scores = in_the_field(id)
    assert x[0] < 1e3 * scores.per_episode["max_error_x"].mean() < x[1]
    assert y[0] < 1e3 * scores.per_episode["max_error_y"].mean() < y[1]


def test_super_twisting_loses_no_robot_in_the_field() -> None:
    assert not in_the_field("sta").failed.any()


def test_super_twisting_chatters_in_the_field() -> None:
    # What limits it there is its own chattering: some sixty times the variation of the PD.
    variation = {
        id: in_the_field(id).per_episode["thrust_variation"].mean() for id in ("sta", "pd")
    }
    assert 200.0 < variation["sta"] < 400.0
    assert variation["pd"] < 0.2 * variation["sta"]


def test_table_1_of_the_paper_by_the_pd_controller() -> None:
    # Paths, joint references and the start are not printed, so a factor of two is agreement.
    scores = score("pd", usm_gym.suite("table1"), heading_gain=125.0).per_episode
    table = {  # mm: operation, torpedo
        "max_error_x": (19.5, 1.8),
        "max_error_y": (22.7, 9.5),
    }
    for name, printed in table.items():
        ratio = 1e3 * scores[name] / printed
        assert (ratio > 0.5).all()
        assert (ratio < 2.0).all()
    settled = (scores["settled_error_x"][0], scores["settled_error_y"][0])
    ratio = 1e3 * np.array(settled) / (3.2, 7.3)
    assert (ratio > 0.5).all()
    assert (ratio < 2.0).all()
