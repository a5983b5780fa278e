"""How long policies take for a decision."""

import usm_agents  # noqa: F401 (registers the shipped agents)

from usm_cli.decisions import DECISIONS, decision_times, observations, policies
from usm_gym.suites import suite


def test_all_policies_are_timed_but_those_that_are_given_true_state():
    ids = policies()
    assert {"sta", "adaptive", "adaptive-basin", "residual-ppo", "lqg-joints-sea"} <= set(ids)
    assert not {"oracle", "informed", "informed-basin"} & set(ids)


def test_a_decision_takes_time_and_is_made_on_what_an_episode_shows():
    times = decision_times(["zero", "sta"], rounds=3)
    for figure in times.values():
        assert 0.0 < figure.low <= figure.median <= figure.high
    assert times["zero"].median < times["sta"].median
    for name in ("operation", "operation3d"):
        seen = observations("sta", suite(name)[0])
        assert len(seen) == DECISIONS
        assert all((seen[k] != seen[k + 1]).any() for k in range(DECISIONS - 1))


def test_in_space_decisions_are_timed_of_policies_that_are_meant_for_it():
    ids = policies("operation3d")
    assert {"sta", "pd"} <= set(ids)
    assert not {"sta-tuned", "lqg-joints-basin", "residual-ppo"} & set(ids)
    times = decision_times(["zero", "sta"], rounds=3, mode="operation3d")
    assert times["zero"].median < times["sta"].median
