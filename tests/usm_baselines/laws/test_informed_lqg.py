"""The law that is told what is constant in an episode, and no more."""

from dataclasses import replace

import numpy as np
import pytest
from usm_baselines import registry

from usm_gym.evaluation import evaluate
from usm_gym.simulation import Simulation
from usm_gym.support.validation import UsageError
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import sample

BASIN = PRESETS["basin"]


def drawn(conditions, count=2):
    return [sample("operation", conditions, np.random.default_rng(k)) for k in range(count)]


def test_without_the_truth_it_does_not_act() -> None:
    scenarios = drawn(BASIN)
    law = registry.make("informed", scenarios[0].nominal)
    with pytest.raises(UsageError, match="snapshot is None; allowed: the true state"):
        law.predict(Simulation(scenarios).observation)


def test_of_the_true_state_it_reads_only_what_is_constant() -> None:
    scenarios = drawn(BASIN)
    law = registry.make("informed", scenarios[0].nominal)
    simulation = Simulation(scenarios)
    start, later = simulation.snapshot(), None
    for _ in range(50):
        simulation.step(np.full((2, 5), 0.3, np.float32))
    later = simulation.snapshot()
    seen = simulation.observation
    first, _ = law.predict(seen, snapshot=start)
    second, _ = law.predict(seen, snapshot=later)
    np.testing.assert_array_equal(first, second)


def test_where_the_robot_is_the_nominal_one_it_knows_nothing_more() -> None:
    nominal = replace(
        BASIN,
        coefficient_range=(1.0, 1.0),
        coefficient_spread=0.0,
        thruster_gain_range=(1.0, 1.0),
        current_limit=0.0,
    )
    scenarios = [replace(s, duration=10.0, settle_time=2.0) for s in drawn(nominal)]
    scenarios = [
        replace(s, inspection=replace(s.inspection, times=(4.0,), deflections=(0.9,)))
        for s in scenarios
    ]
    told, plain = (
        evaluate(registry.make(id, scenarios[0].nominal), scenarios)
        for id in ("informed", "lqg-joints")
    )
    for name, values in told.per_episode.items():
        np.testing.assert_array_equal(values, plain.per_episode[name])


def test_what_it_is_told_is_worth_something() -> None:
    scenarios = drawn(BASIN, 8)
    gains = {"acceleration_noise": 2.4e-3, "disturbance_noise": 0.011, "lead": 0.06}
    told, plain = (
        evaluate(registry.make(id, scenarios[0].nominal, **gains), scenarios)
        for id in ("informed", "lqg-joints")
    )
    assert np.median(told.objective()) < 0.8 * np.median(plain.objective())
