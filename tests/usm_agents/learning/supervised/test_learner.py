"""Learned estimators: they learn, go on as if not interrupted, and act without torch."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import usm_baselines
from support.trainings import brief, shorten
from usm_agents.artifact.folder import make_agent, read_agent
from usm_agents.learning import training
from usm_agents.learning.checkpoint import latest_checkpoint
from usm_agents.learning.plan import Plan
from usm_agents.learning.settings import SETTINGS
from usm_agents.learning.supervised.learner import EstimatorLearner, mean_ahead

from usm_gym.evaluation import rollout
from usm_gym.task.conditions import PRESETS
from usm_gym.task.sampling import named

PLAN = Plan(
    algorithm="estimator",
    action="estimates",
    base="lqg-joints",
    conditions=PRESETS["basin"],
    steps=1600,
    interval=400,
)
train = partial(training.train, validation_episodes=2, test_episodes=2)


def silent(steps, line):
    pass


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Four robots, episodes of two seconds, so that a round has 400 steps."""
    few = {"robots": 4, "units": 8, "hidden": 8, "window": 5, "batch": 2}
    monkeypatch.setitem(SETTINGS, "estimator", SETTINGS["estimator"])
    for name, value in few.items():
        monkeypatch.setitem(SETTINGS["estimator"], name, value)
    shorten(monkeypatch)


@pytest.mark.slow
def test_a_training_that_is_stopped_goes_on_bit_for_bit(tmp_path):
    whole = train(PLAN, tmp_path / "whole", silent)

    def stop(steps, line):
        if steps >= PLAN.steps // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(PLAN, tmp_path / "stopped", stop)
    resumed = train(PLAN, tmp_path / "stopped", silent, resume=True)
    for ours, theirs in zip(whole, resumed, strict=True):
        assert {**ours, "seconds": 0} == {**theirs, "seconds": 0}
    files = [
        latest_checkpoint(tmp_path / name) / "estimator.pickle" for name in ("whole", "stopped")
    ]
    assert files[0].name == files[1].name
    agents = [read_agent(tmp_path / name) for name in ("whole", "stopped")]
    assert agents[0][0].weights == agents[1][0].weights
    # A network that corrects nothing, as before the first round, is the base.
    scenarios = [brief(named("nominal", "operation", PRESETS["basin"]))]
    corrected = rollout(make_agent(scenarios[0].nominal, str(tmp_path / "whole")), scenarios)[0]
    base = rollout(usm_baselines.make("lqg-joints", scenarios[0].nominal), scenarios)[0]
    assert np.abs(corrected.error - base.error).max() < 0.05


def test_the_mean_of_a_label_is_of_periods_that_count():
    values = np.array([1.0, 2.0, 4.0, 8.0, 16.0])[:, None, None].repeat(2, axis=2)
    valid = np.array([[1.0], [1.0], [0.0], [1.0], [0.0]], np.float32)
    values[valid[:, 0] == 0.0] = 1e6  # of another episode
    means = mean_ahead(values, valid, 2)
    assert means[:, 0, 0].tolist() == [1.5, 2.0, 8.0, 8.0, 0.0]
    assert (means[:, :, 0] == means[:, :, 1]).all()


def test_it_learns_what_is_wanted(tmp_path):
    setup = training.prepare(PLAN, tmp_path)
    learner = EstimatorLearner(setup)
    seen = learner._collect()
    learner._rounds, wanted = [seen], seen.wanted[seen.valid > 0.0]
    for _ in range(30):
        learner._fit(done=0.0)
    network, kept, off = learner.export(), None, []
    for now, right, counted in zip(*seen, strict=True):
        answer, kept = network.predict(now, kept)
        off.append((answer - right)[counted > 0.0])
    assert (np.mean(np.concatenate(off) ** 2, axis=0) < 0.9 * np.mean(wanted**2, axis=0)).all()


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"action": "wrench"}, "estimates"),
        ({"base": "sta"}, "estimates by the plant"),
        ({"base": "lqg"}, "estimates by the plant"),
    ],
)
def test_what_cannot_be_corrected_is_refused(changed, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        train(replace(PLAN, **changed), tmp_path / "new", silent)
    assert not [file for file in tmp_path.glob("new/*") if file.name != ".lock"]
