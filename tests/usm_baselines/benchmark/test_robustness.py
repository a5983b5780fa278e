"""A robustness curve varies what it says, and nothing else."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.episodes import METRICS
from support.results import PROVENANCE
from usm_baselines.benchmark.robustness import QUANTITIES, RobustnessResult, curves, jobs
from usm_baselines.benchmark.robustness_figure import draw
from usm_baselines.benchmark.scoring import Refusal, score_all
from usm_baselines.contender import contender

from usm_gym import suite
from usm_gym.evaluation import Evaluation
from usm_gym.support.validation import UsageError
from usm_gym.task.conditions import FIELD
from usm_gym.task.nominal import shared_nominal

SCENARIOS = suite("operation")[:2]
ANGLE_NOISE = ("tail_angle_noise", "joint_angle_noise", "rate_noise")
SPREADS = ("gain", "links")


# By quantity, the value of the suite and another.
OWN = {
    "noise": (0.05, 0.025),
    "fix-period": (1.0, 5.0),
    "fix-delay": (0.0, 3.0),
    "fix-missing": (0.0, 0.1),
    "angle-noise": (0.0, 1.0),
    "lag": (0.05, 0.025),
    "delay": (0.0, 3.0),
    "limit": (20.0, 10.0),
    "dead-band": (0.0, 0.4),
    "gain": (0.0, 0.2),
    "speed": (1.0, 0.5),
    "amplitude": (1.0, 0.5),
    "current": (0.05, 0.025),
    "waves": (0.0, 0.1),
    "model": (0.2, 0.1),
    "links": (0.0, 0.2),
    "rate": (50.0, 25.0),
    "step": (1.0, 0.5),
}


@pytest.mark.parametrize("name", QUANTITIES)
def test_the_suites_own_value_changes_nothing_and_another_one_thing(name: str) -> None:
    quantity, (own, other) = QUANTITIES[name], OWN[name]
    for scenario in SCENARIOS:
        assert quantity.vary(scenario, own) == scenario
        changed = quantity.vary(scenario, other)
        assert changed != scenario
        for kept in ("path", "duration", "noise_seed", "mode"):
            assert getattr(changed, kept) == getattr(scenario, kept)
        if name not in ("current", "waves", "model", "links"):
            assert changed.water == scenario.water
        if name != "gain":
            assert changed.thruster_gains == scenario.thruster_gains
        if name not in ("speed", "amplitude"):
            assert changed.inspection == scenario.inspection


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("delay", {"action_delay": 3}),
        ("fix-period", {"position_period": 5}),
        ("fix-delay", {"position_delay": 3}),
        ("fix-missing", {"position_missing": 0.1}),
        ("dead-band", {"thruster_dead_band": 0.4}),
        ("angle-noise", dict.fromkeys(ANGLE_NOISE, 1e-3)),
    ],
)
def test_quantities_of_sensors_and_thrusters_are_conditions(
    name: str, changed: dict[str, Any]
) -> None:
    for scenario in SCENARIOS:
        varied = QUANTITIES[name].vary(scenario, OWN[name][1])
        assert varied.conditions == replace(FIELD, **changed)


def test_a_spread_stretches_what_is_drawn() -> None:
    for scenario in SCENARIOS:
        gains, links = ([QUANTITIES[n].vary(scenario, s) for s in (0.1, 0.2)] for n in SPREADS)
        for one, two in zip(*(each.thruster_gains for each in gains), strict=True):
            assert two - 1.0 == pytest.approx(2.0 * (one - 1.0))
        for one, two in zip(*(each.water.link_factors for each in links), strict=True):
            assert two - 1.0 == pytest.approx(2.0 * (one - 1.0))


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("delay", 0.5, "action_delay is 0.5; allowed: a whole number of control periods"),
        ("fix-delay", 2.5, "position_delay is 2.5; allowed: a whole number of control periods"),
        ("fix-period", float("inf"), "position_period is inf; allowed: a whole number"),
        ("fix-period", 0.0, "position_period is 0"),
        ("fix-missing", 1.0, "position_missing is 1.0"),
        ("dead-band", 30.0, "thruster_dead_band is 30.0; allowed: up to thruster_limit = 20.0"),
        ("gain", 1.0, "spread of thruster_gain_range is 1.0; allowed: 0 or more, below 1"),
        ("links", -0.1, "coefficient_spread is -0.1"),
        ("waves", 9.0, "wave_limit is 9.0"),
        ("angle-noise", -1.0, "tail_angle_noise is -0.001"),
        ("rate", 0.0, "control rate is 0.0; allowed: more than 0 Hz"),
    ],
)
def test_an_impossible_value_is_refused_in_one_line(name: str, value: float, said: str) -> None:
    with pytest.raises(UsageError, match=re.escape(said)) as error:
        QUANTITIES[name].vary(SCENARIOS[0], value)
    assert "\n" not in str(error.value)


def test_policies_keep_the_nominal_knowledge_but_know_their_period() -> None:
    nominal = shared_nominal(SCENARIOS)
    for name, quantity in QUANTITIES.items():
        for job, value in zip(
            jobs([contender("pd")], SCENARIOS, quantity, quantity.values),
            quantity.values,
            strict=True,
        ):
            period = 1 / value if name == "rate" else 0.02
            assert job.nominal == replace(nominal, control_period=pytest.approx(period))


def test_every_value_can_be_run() -> None:
    brief = [replace(each, duration=0.4, settle_time=0.2) for each in SCENARIOS]
    for quantity in QUANTITIES.values():
        outcomes = score_all(jobs([contender("zero")], brief, quantity, quantity.values))
        assert not any(isinstance(outcome, Refusal) for outcome in outcomes)


def test_lost_robots_are_drawn_and_not_hidden_in_a_mean() -> None:
    def scores(lost: list[bool]) -> Evaluation:
        errors = np.where(lost, 0.5, 2e-3)
        return Evaluation(dict.fromkeys(METRICS, errors), np.array(lost))

    scored = [scores([False, False]), scores([False, True]), scores([True, True])]
    result = RobustnessResult(
        quantity="noise",
        label="noise [mm]",
        values=(0.0, 1.0, 2.0),
        scenarios=tuple(SCENARIOS),
        results=curves(["pd"], [0.0, 1.0, 2.0], scored),
        provenance=PROVENANCE,
    )
    x, _, share = draw(result).axes
    curve, *points = x.lines
    assert curve.get_xydata().tolist() == [[0.0, 2.0], [1.0, 2.0]]
    assert [point.get_markerfacecolor() == "white" for point in points] == [False, True]
    assert share.lines[0].get_xydata().tolist() == [[0.0, 0.0], [1.0, 50.0], [2.0, 100.0]]
