"""A learner that is not of Stable-Baselines3 is trained, resumed and scored as the others are."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from support.regression import SETTINGS, Regression
from support.trainings import shorten
from usm_agents.artifact.folder import read_agent
from usm_agents.artifact.network import Network
from usm_agents.learning import learner
from usm_agents.learning.learner import register
from usm_agents.learning.plan import TEST_SEED, Plan, read_plan
from usm_agents.learning.training import train
from usm_agents.learning.validation import best_of
from usm_agents.residual.env import ResidualVectorEnv

from usm_cli.commands import train as commands_train
from usm_cli.program import main
from usm_gym.envs.vector_env import TrackingVectorEnv
from usm_gym.support.validation import UsageError
from usm_gym.task.metrics import objective

# A PD law leaves the disturbance to its agent.
PLAN = Plan(algorithm="regression", base="pd-tuned", steps=4096, interval=1024)
SMALL = {"validation_episodes": 2, "test_episodes": 2}
RESULTS = ("plan.json", "curve.json", "agent.json", "policy.safetensors")


def silent(steps, line):
    pass


def results(folder):
    """What a training has left, without times and versions."""
    found = {name: (folder / name).read_bytes() for name in RESULTS}
    for name in RESULTS[:-1]:
        found[name] = without_times(json.loads(found[name]))
    return found


def without_times(value):
    if isinstance(value, dict):
        left_out = ("seconds", "provenance", "command")
        return {k: without_times(each) for k, each in value.items() if k not in left_out}
    return [without_times(each) for each in value] if isinstance(value, list) else value


@pytest.mark.slow
@pytest.mark.parametrize("stops", [(0,), (1100, 1100, 3000)])
def test_it_goes_on_as_if_it_had_not_been_stopped(stops, tmp_path, monkeypatch):
    shorten(monkeypatch)
    train(PLAN, tmp_path / "whole", silent, **SMALL)
    for number, stop in enumerate(stops):

        def report(steps, line, stop=stop):
            if steps >= stop:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            train(PLAN, tmp_path / "stopped", report, resume=number > 0, **SMALL)
    train(PLAN, tmp_path / "stopped", silent, resume=True, **SMALL)
    assert results(tmp_path / "stopped") == results(tmp_path / "whole")


def test_the_command_scores_its_agent_as_its_training_did(tmp_path, capsys):
    curve = train(PLAN, tmp_path / "mine", silent, **SMALL)
    assert [each["steps"] for each in curve] == [0, 1024, 2048, 3072, 4096]
    agent, _ = read_agent(tmp_path / "mine")
    out = tmp_path / "scores.json"
    chosen = ["--policies", str(tmp_path / "mine"), "--seed", f"{TEST_SEED}", "--episodes", "2"]
    main(["evaluate", *chosen, "--output", str(out)])
    capsys.readouterr()
    (scores,) = json.loads(out.read_text())["results"].values()
    assert scores["max_error_x"] == agent.scores["sampled"]["max_error_x"]
    assert agent.training["settings"] == SETTINGS
    # What it was told is of use: the disturbance that it cancels is that of the simulation.
    assert objective(best_of(curve)) < 0.7 * objective(curve[0])


MINE = """
from support.regression import SETTINGS, Regression
from usm_agents.learning.learner import register

register("mine", Regression, SETTINGS)
"""


@pytest.fixture
def forget(tmp_path, monkeypatch):
    """Forget the learner of a module in the current folder, as a new process would."""
    (tmp_path / "my_module.py").write_text(MINE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))

    def forget():
        sys.modules.pop("my_module", None)
        learner._algorithms.pop("mine", None)

    yield forget
    forget()


def test_the_command_trains_a_learner_of_ones_own_and_resumes_it(forget, monkeypatch, capsys):
    def not_installed(*arguments):
        raise UsageError("the extra is missing")

    shorten(monkeypatch)
    monkeypatch.setattr(commands_train, "check_installed", not_installed)
    chosen = ["--algorithm", "my_module:mine", "--steps", "256", "--output", "agent"]
    main(["train", *chosen])
    trained = capsys.readouterr().out
    assert "after 256 steps" in trained
    assert read_plan(Path("agent")).algorithm == "my_module:mine"
    agent, _ = read_agent(Path("agent"))
    assert agent.summary == "MINE residual on sta"
    assert "--algorithm my_module:mine" in agent.training["command"]
    forget()
    main(["train", "--resume", "--output", "agent"])
    assert capsys.readouterr().out == trained


@pytest.mark.parametrize(
    ("algorithm", "said"),
    [
        ("absent:mine", "algorithm absent:mine: module 'absent' cannot be imported"),
        ("my_module:yours", "algorithm is 'my_module:yours'; allowed: "),
        ("my_module:ppo", "algorithm is 'my_module:ppo'; allowed: "),
    ],
)
def test_a_learner_that_does_not_exist_is_refused_and_nothing_written(
    algorithm, said, forget, capsys
):
    with pytest.raises(SystemExit) as left:
        main(["train", "--algorithm", algorithm, "--output", "agent"])
    assert left.value.code == 2
    assert capsys.readouterr().err.startswith(f"usm: error: {said}")
    assert not Path("agent").exists()
    forget()


def watch(monkeypatch, kind, name):
    """The arguments and answers of a method, as it is called from now on."""
    original, calls = getattr(kind, name), []

    def watched(self, *arguments, **named):
        answer = original(self, *arguments, **named)
        calls.append((arguments, named, answer))
        return answer

    monkeypatch.setattr(kind, name, watched)
    return calls


def as_lists(value):
    """Nested dicts, tuples and arrays, also of arrays, as lists that are compared by ==."""
    if isinstance(value, dict):
        return [[key, as_lists(each)] for key, each in value.items()]
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.tolist()
    return list(map(as_lists, value)) if isinstance(value, list | tuple | np.ndarray) else value


@pytest.mark.slow
def test_the_truth_reaches_the_learner_and_nobody_else(tmp_path, monkeypatch):
    shorten(monkeypatch)
    told, networks = [], []
    for force in (1.5, -2.5):
        truth = {"disturbance": np.full((SETTINGS["robots"], 2), force)}
        with monkeypatch.context() as patch:
            patch.setattr(TrackingVectorEnv, "truth", lambda self, truth=truth: truth)
            resets, steps = (watch(patch, ResidualVectorEnv, name) for name in ("reset", "step"))
            predictions = watch(patch, Network, "predict")
            exports = watch(patch, Regression, "export")
            train(PLAN, tmp_path / f"{force}", silent, **SMALL)
        told.append(as_lists([*resets, *steps]))
        for (observation, _, _, deterministic), named, _ in predictions:
            assert observation.shape[1:] == steps[0][2][0].shape[1:]
            assert (deterministic, named) == (True, {})
        networks.append([network for _, _, network in exports])
    # Whatever the truth is, observations, rewards and infos are the same.
    assert told[0] == told[1]
    assert len(told[0]) > PLAN.steps // SETTINGS["robots"]
    for one, other in list(zip(*networks, strict=True))[1:]:
        assert (one.weights[0] != other.weights[0]).any()


@pytest.mark.parametrize("name", ["regression", "ppo"])
def test_a_name_is_registered_once_and_with_robots(name):
    with pytest.raises(ValueError, match=f"name is '{name}'"):
        register(name, Regression, SETTINGS)
    with pytest.raises(ValueError, match="settings\\['robots'\\] is None"):
        register("other", Regression, {})
