"""Validations of an agent in training."""

import numpy as np
import pytest
from pydantic import TypeAdapter
from usm_agents.artifact.network import Network
from usm_agents.learning.plan import Plan
from usm_agents.learning.validation import best_of, held_out, in_words, validate
from usm_agents.residual.task import Residual
from usm_agents.study.results import CurvePoint
from usm_baselines.registry import make

import usm_gym
from usm_gym.suites import unseen
from usm_gym.task.metrics import objective

OLD = {
    "steps": 0,
    "seconds": 1.0,
    "max_error_x": 2e-3,
    "max_error_y": 1e-3,
    "thrust_variation": 95.4,
    "failures": 0,
}
POINT = TypeAdapter(CurvePoint)
NEW = {**OLD, "heading_error": np.radians(5.0)}


def test_a_validation_has_all_that_its_objective_needs():
    plan = Plan(base="pd")
    nominal = unseen(plan.mode, plan.conditions, 0, 1)[0].nominal
    base = make("pd", nominal)
    residual = Residual(nominal, base, 20.0, "wrench", (), 1)
    size = residual.layout.size
    idle = Network(
        (np.zeros((size, residual.actions), np.float32),),
        (np.zeros(residual.actions, np.float32),),
        "tanh",
        "clip",
    )
    scenarios = held_out(plan, residual, 2)
    found = validate(residual, idle, scenarios, 512, 1.5)
    alone = usm_gym.evaluate(base, scenarios)
    assert found["heading_error"] == pytest.approx(alone.per_episode["heading_error"].mean())
    assert objective(found) == pytest.approx(alone.objective().mean())
    assert (found["steps"], found["seconds"], found["failures"]) == (512, 1.5, 0)


def test_the_best_is_so_by_heading_too():
    worse = {**NEW, "max_error_x": 1.9e-3, "heading_error": np.radians(10.0)}
    assert best_of([worse, NEW]) is NEW
    assert best_of([NEW, {**NEW, "thrust_variation": 40.0}])["thrust_variation"] == 40.0
    assert best_of([NEW, dict(NEW)]) is NEW


def test_curves_without_heading_can_still_be_read():
    old, new = (POINT.validate_python(point) for point in (OLD, NEW))
    assert old.errors == new.errors == {"x": 2e-3, "y": 1e-3}
    assert new.objective == pytest.approx(old.objective + 0.05 * 5.0)
    assert best_of([OLD]) is OLD


def test_progress_is_said_with_heading_where_there_is_one():
    assert in_words(OLD) == "2.00 / 1.00 mm at 95 N/s"
    assert in_words(NEW) == "2.00 / 1.00 mm, 5.0° at 95 N/s"
