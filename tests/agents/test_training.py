"""Training: goes on after an interruption to the bit, says when it diverges, leaves an agent."""

import json
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import usm_gym
from agents import algorithms, training
from agents.artifact import make_agent
from agents.plan import Plan
from agents.sb3_vec_env import SB3VecEnv
from agents.training import DivergedError, train
from usm_gym.nominal import nominal_of
from usm_gym.robot import Robot

# Trains in children that are killed after random times, and at last in one that is not. Children
# are forked, so that each does not import everything again.
KILLER = """
import os, random, signal, sys, time
from pathlib import Path
from agents import training
from agents.plan import Plan

training.ROBOTS = {"ppo": 16}
training.VALIDATION_EPISODES = training.TEST_EPISODES = 2
plan, folder = Plan(steps=4096, interval=1024), Path(sys.argv[1])
chance, steps, kills = random.Random(0), 0, 0
while True:
    child = os.fork()
    if child == 0:
        training.train(plan, folder, lambda steps, line: None)
        os._exit(0)
    if kills < 10:
        time.sleep(chance.uniform(0.0, 4.0))
        os.kill(child, signal.SIGKILL)
        kills += 1
    _, status = os.waitpid(child, 0)
    kept = training.latest_checkpoint(folder)
    reached = int(kept.name.partition("-")[2]) if kept else 0
    assert reached >= steps, (reached, steps)
    steps = reached
    if status == 0:
        break
print(kills, steps)
"""
PLAN = Plan(steps=4096, interval=1024)
SILENT = lambda steps, line: None  # noqa: E731


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(training, "ROBOTS", dict.fromkeys(algorithms.CLASSES, 4) | {"ppo": 16})
    monkeypatch.setattr(training, "VALIDATION_EPISODES", 2)
    monkeypatch.setattr(training, "TEST_EPISODES", 2)


def errors(curve):
    return [(point["steps"], point["max_error_x"], point["max_error_y"]) for point in curve]


def test_a_training_that_is_killed_ten_times_ends_with_the_same_bits(tmp_path):
    whole = train(PLAN, tmp_path / "whole", SILENT)
    folder = tmp_path / "killed"
    answer = subprocess.run(
        [sys.executable, "-c", KILLER, str(folder)], capture_output=True, text=True, check=False
    )
    assert answer.returncode == 0, answer.stderr
    assert errors(read_curve(folder)) == errors(whole)
    models = [
        PPO.load(training.latest_checkpoint(each) / "model.zip", device="cpu")
        for each in (tmp_path / "whole", folder)
    ]
    for ours, theirs in zip(*(model.policy.parameters() for model in models), strict=True):
        assert (ours == theirs).all()


def test_a_recurrent_training_that_is_stopped_goes_on_with_its_memory(tmp_path):
    plan = Plan(algorithm="recurrent-ppo", steps=1024, interval=256)
    whole = train(plan, tmp_path / "whole", SILENT)

    def stop(steps, line):
        if steps >= 512:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(plan, tmp_path / "stopped", stop)
    assert errors(train(plan, tmp_path / "stopped", SILENT)) == errors(whole)
    scenarios = usm_gym.suite("operation")[:1]
    policy = make_agent(nominal_of(Robot(), scenarios[0]), str(tmp_path / "stopped"))
    assert not usm_gym.evaluate(policy, scenarios).failed.any()


def read_curve(folder):
    try:
        return json.loads((folder / training.CURVE).read_text())
    except FileNotFoundError:
        return []


def test_the_log_has_the_metric_on_held_out_scenarios(tmp_path):
    curve = train(PLAN, tmp_path, SILENT)
    log = EventAccumulator(str(tmp_path)).Reload()
    logged = [(each.step, each.value) for each in log.Scalars("validation/max_error_x")]
    assert logged == [(each["steps"], np.float32(each["max_error_x"])) for each in curve]


@pytest.mark.parametrize("algorithm", ["sac", "td3", "tqc"])
def test_the_others_train_resume_and_leave_an_agent(algorithm, tmp_path, monkeypatch):
    settings = algorithms.SETTINGS[algorithm]
    monkeypatch.setitem(settings, "learning_starts", 100)
    monkeypatch.setitem(settings, "buffer_size", 1000)
    train(Plan(algorithm=algorithm, steps=200, interval=100), tmp_path, SILENT)
    curve = train(Plan(algorithm=algorithm, steps=300, interval=100), tmp_path, SILENT)
    assert [point["steps"] for point in curve] == [0, 100, 200, 300]
    scenarios = usm_gym.suite("operation")[:1]
    policy = make_agent(nominal_of(Robot(), scenarios[0]), str(tmp_path))
    assert not usm_gym.evaluate(policy, scenarios).failed.any()


@pytest.mark.parametrize("algorithm", list(algorithms.CLASSES))
def test_a_network_is_what_the_model_does(algorithm):
    envs = gym.make_vec(
        "agents:USM-OperationResidual-v0",
        num_envs=16,
        vectorization_mode="vector_entry_point",
        autoreset_mode="SameStep",
    )
    model = algorithms.make_model(algorithm, SB3VecEnv(envs))
    with torch.no_grad():
        for each in model.policy.parameters():
            each.mul_(3.0)
    random, network = np.random.default_rng(0), algorithms.network_of(algorithm, model)
    their_state, our_state = None, None
    for start in (np.ones(100, bool), np.zeros(100, bool), random.random(100) < 0.5):
        seen = random.normal(size=(100, 44)).astype(np.float32)
        expected, their_state = model.predict(seen, their_state, start, deterministic=True)
        found, our_state = network.predict(seen, our_state, start)
        np.testing.assert_allclose(found, expected, atol=1e-6)
        assert np.abs(found).max() > 1e-4


def test_a_diverging_training_is_stopped_with_a_clear_word(tmp_path, monkeypatch):
    def wild(algorithm, env):
        model = algorithms.make_model(algorithm, env)
        model.lr_schedule = lambda remaining: 1e30
        return model

    monkeypatch.setattr(training, "make_model", wild)
    with pytest.raises(
        DivergedError, match=r"diverged after \d+ steps: .*; the last checkpoint is"
    ):
        train(PLAN, tmp_path, SILENT)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"algorithm": "luck"}, "algorithm is 'luck'"),
        ({"env": "CartPole-v1"}, "env is 'CartPole-v1'"),
        ({"steps": 0}, "steps"),
        ({"seed": -1}, "seed is -1"),
        ({"base": "os:system"}, "base is 'os:system'"),
    ],
)
def test_bad_plans_are_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        Plan(**fields)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--resume"], "holds no training"),
        (["--algorithm", "luck"], "algorithm is 'luck'"),
        (["--resume", "--seed", "1"], "--resume"),
        (["--conditions", "stormy"], "conditions is 'stormy'"),
    ],
)
def test_the_command_refuses_in_one_line(options, message, tmp_path):
    code = "import sys; from agents.main import main; main(sys.argv[1:])"
    command = [sys.executable, "-c", code, "train", "--output", str(tmp_path / "new"), *options]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    assert answer.returncode == 2
    assert answer.stderr.count("\n") == 1
    assert message in answer.stderr
    assert not (tmp_path / "new").exists()
