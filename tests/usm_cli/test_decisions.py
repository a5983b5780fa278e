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
    seen = observations("sta", suite("operation")[0])
    assert len(seen) == DECISIONS
    assert all((seen[k] != seen[k + 1]).any() for k in range(DECISIONS - 1))
