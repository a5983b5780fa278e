"""A robustness curve varies what it says, and nothing else."""

from dataclasses import replace

import pytest
from usm_baselines.benchmark.robustness import QUANTITIES, jobs
from usm_baselines.benchmark.scoring import Refusal, score_all
from usm_baselines.contender import contender

from usm_gym import suite
from usm_gym.task.conditions import FIELD
from usm_gym.task.nominal import shared_nominal

SCENARIOS = suite("operation")[:2]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("noise", 0.05),
        ("lag", 0.05),
        ("limit", 20.0),
        ("speed", 1.0),
        ("amplitude", 1.0),
        ("current", 0.05),
        ("model", 0.2),
        ("rate", 50.0),
        ("step", 1.0),
    ],
)
def test_the_suites_own_value_changes_nothing_and_another_one_thing(
    name: str, value: float
) -> None:
    quantity = QUANTITIES[name]
    for scenario in SCENARIOS:
        assert quantity.vary(scenario, value) == scenario
        changed = quantity.vary(scenario, 0.5 * value)
        assert changed != scenario
        for kept in ("path", "duration", "noise_seed", "mode"):
            assert getattr(changed, kept) == getattr(scenario, kept)
        if name not in ("current", "model"):
            assert changed.water == scenario.water
        if name not in ("speed", "amplitude"):
            assert changed.inspection == scenario.inspection


def test_a_delay_is_that_of_the_commands() -> None:
    quantity = QUANTITIES["delay"]
    for scenario in SCENARIOS:
        assert quantity.vary(scenario, 0.0) == scenario
        assert quantity.vary(scenario, 3.0).conditions == replace(FIELD, action_delay=3)
        with pytest.raises(ValueError, match="delay"):
            quantity.vary(scenario, 0.5)


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
