"""The oracle: near perfect, given the truth by the evaluation alone, and out of competition."""

import dataclasses
from typing import Any

import numpy as np
import pytest
import usm_baselines
from support.episodes import HARDER

from usm_cli.selection import chosen_contenders
from usm_gym import Robot, evaluate
from usm_gym.evaluation import rollout, score
from usm_gym.suites.__main__ import SEED
from usm_gym.support.seeding import SUITE, TUNING, stream
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import sample

ROBOT = Robot()


def scenarios(conditions: str, count: int) -> list[Any]:
    drawn = [sample("operation", PRESETS[conditions], stream(5, TUNING, i)) for i in range(count)]
    return [dataclasses.replace(each, duration=24.0) for each in drawn]


@pytest.mark.parametrize("conditions", ["ideal", "field"])
def test_leaves_hundredths_of_a_millimetre(conditions: str) -> None:
    episodes = scenarios(conditions, 8)
    scores = evaluate(usm_baselines.make("oracle", episodes[0].nominal), episodes)
    for axis in "xy":
        assert scores.per_episode[f"max_error_{axis}"].mean() < 5e-5


def test_knows_the_limits_of_the_thrusters() -> None:
    # With clipped commands it would swing ever wider after the second change of the joints.
    drawn = sample("operation", HARDER, stream(SEED, SUITE, 2, 34))
    episode = dataclasses.replace(drawn, duration=24.0)
    (mine,), (others,) = (
        rollout(usm_baselines.make(id, episode.nominal), [episode]) for id in ("oracle", "mpc")
    )
    limit = episode.conditions.thruster_limit
    assert np.abs(mine.command).max() <= limit
    assert np.count_nonzero(np.abs(mine.command) > 0.99 * limit) > 10
    for axis in "xy":
        assert score(mine)[f"max_error_{axis}"] < 0.1 * score(others)[f"max_error_{axis}"]


@pytest.mark.parametrize("limit", [20.0, 8.0])
def test_alone_and_side_by_side_the_bits_are_the_same(limit: float) -> None:
    episodes = [
        dataclasses.replace(
            each,
            duration=6.0,
            conditions=dataclasses.replace(each.conditions, thruster_limit=limit),
        )
        for each in scenarios("field", 3)
    ]
    policy = usm_baselines.make("oracle", episodes[0].nominal)
    together = evaluate(policy, episodes).per_episode
    for i, episode in enumerate(episodes):
        alone = evaluate(policy, [episode]).per_episode
        assert all(np.array_equal(together[name][i : i + 1], alone[name]) for name in together)


def test_is_no_competitor_and_wants_the_truth() -> None:
    episodes = scenarios("field", 1)
    assert "oracle" not in [each.name for each in chosen_contenders(None, episodes[0])]
    policy: Any = usm_baselines.make("oracle", episodes[0].nominal)
    assert policy.privileged
    with pytest.raises(ValueError, match="snapshot is None; allowed: the true state"):
        policy.predict(np.zeros((1, 94), np.float32))
