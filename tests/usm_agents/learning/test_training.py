"""Training: goes on after an interruption, bit for bit, says when it diverges, leaves an agent."""

import pickle
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support.trainings import shorten
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from usm_agents.artifact.folder import make_agent
from usm_agents.learning import training
from usm_agents.learning.checkpoint import CURVE, PROGRESS, latest_checkpoint
from usm_agents.learning.divergence import DivergedError
from usm_agents.learning.plan import PLAN as PLAN_FILE
from usm_agents.learning.plan import Plan
from usm_agents.learning.sb3 import learner
from usm_agents.learning.sb3.learner import MODEL, REPLAY, STATES
from usm_agents.learning.sb3.models import CLASSES, make_model
from usm_agents.learning.settings import SETTINGS

import usm_gym
from usm_cli.program import main
from usm_gym.support.files import holding

PLAN = Plan(steps=4096, interval=1024)
train = partial(training.train, validation_episodes=2, test_episodes=2)


def silent(steps, line):
    pass


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Few robots, episodes of two seconds: they end within the training."""
    shorten(monkeypatch)
    for algorithm, settings in SETTINGS.items():
        monkeypatch.setitem(settings, "robots", 16 if algorithm == "ppo" else 4)


def errors(curve):
    return [(each["steps"], each["max_error_x"], each["max_error_y"]) for each in curve]


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["ppo", "smooth-ppo", "recurrent-ppo"])
def test_a_training_that_is_stopped_goes_on_bit_for_bit(algorithm, tmp_path):
    robots = SETTINGS[algorithm]["robots"]
    plan = Plan(algorithm=algorithm, steps=256 * robots, interval=64 * robots)
    whole = train(plan, tmp_path / "whole", silent)

    def stop(steps, line):
        if steps >= plan.steps // 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(plan, tmp_path / "stopped", stop)
    assert errors(train(plan, tmp_path / "stopped", silent, resume=True)) == errors(whole)
    models = [
        CLASSES[algorithm].load(latest_checkpoint(folder) / MODEL, device="cpu")
        for folder in (tmp_path / "whole", tmp_path / "stopped")
    ]
    for ours, theirs in zip(*(model.policy.parameters() for model in models), strict=True):
        assert (ours == theirs).all()
    scenarios = usm_gym.suite("operation")[:1]
    policy = make_agent(scenarios[0].nominal, str(tmp_path / "stopped"))
    assert not usm_gym.evaluate(policy, scenarios).failed.any()


class Bomb:
    """A checkpoint that leaves a file when it is loaded."""

    def __init__(self, file):
        self.file = file

    def __reduce__(self):
        return Path.touch, (self.file,)


def armed(folder, name="checkpoint-0000000000"):
    """Put a checkpoint that is code into a folder; the file that its code makes."""
    (folder / name).mkdir(parents=True)
    for file in (PROGRESS, MODEL, REPLAY, STATES):
        (folder / name / file).write_bytes(pickle.dumps(Bomb(folder / "was run")))
    return folder / "was run"


@pytest.mark.parametrize(
    "trace",
    [
        "checkpoint-0000000000",
        "checkpoint.part",
        PLAN_FILE,
        CURVE,
        "agent.json",
        "policy.safetensors",
        "events.out.tfevents.1.host.2.0",
    ],
)
def test_a_folder_with_anything_of_a_training_is_refused_unread(trace, tmp_path, capsys):
    ran = armed(tmp_path, trace)
    with pytest.raises(SystemExit, match="2"):
        main(["train", "--steps", "16", "--output", str(tmp_path)])
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert trace in message
    assert "--resume" in message
    assert not ran.exists()
    assert [file.name for file in tmp_path.iterdir()] == [trace]


def test_a_checkpoint_without_a_plan_is_not_resumed(tmp_path, capsys):
    ran = armed(tmp_path)
    with pytest.raises(SystemExit, match="2"):
        main(["train", "--resume", "--output", str(tmp_path)])
    assert "holds no training" in capsys.readouterr().err
    assert not ran.exists()


def test_a_finished_training_that_is_resumed_leaves_the_same_files(tmp_path):
    plan = Plan(steps=1024, interval=1024)
    curve = train(plan, tmp_path, silent)
    before = {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}
    assert train(plan, tmp_path, silent, resume=True) == curve
    assert before == {file: file.read_bytes() for file in tmp_path.rglob("*") if file.is_file()}


@pytest.mark.parametrize("file", [PROGRESS, MODEL, STATES])
def test_a_checkpoint_that_cannot_be_read_gets_one_line(file, tmp_path):
    plan = Plan(steps=1024, interval=1024)
    train(plan, tmp_path, silent)
    damaged = latest_checkpoint(tmp_path) / file
    for data in (damaged.read_bytes()[:1000], pickle.dumps({"curve": []})):
        damaged.write_bytes(data)
        with pytest.raises(ValueError, match="is damaged, or of another version") as caught:
            train(plan, tmp_path, silent, resume=True)
        assert "\n" not in str(caught.value)


def test_two_trainings_in_one_folder_are_one_and_one_line(tmp_path, capsys):
    with holding(tmp_path), pytest.raises(SystemExit, match="2"):
        main(["train", "--output", str(tmp_path)])
    assert capsys.readouterr().err == f"usm: error: {tmp_path} is in use by another command\n"


def test_the_log_has_the_metric_on_held_out_scenarios(tmp_path):
    curve = train(PLAN, tmp_path, silent)
    log = EventAccumulator(str(tmp_path)).Reload()
    logged = [(each.step, each.value) for each in log.Scalars("validation/max_error_x")]
    assert logged == [(each["steps"], np.float32(each["max_error_x"])) for each in curve]


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ["sac", "td3", "tqc"])
def test_the_others_train_resume_and_leave_an_agent(algorithm, tmp_path, monkeypatch):
    settings = SETTINGS[algorithm]
    monkeypatch.setitem(settings, "learning_starts", 100)
    monkeypatch.setitem(settings, "buffer_size", 1000)
    train(Plan(algorithm=algorithm, steps=200, interval=100), tmp_path, silent)
    longer = Plan(algorithm=algorithm, steps=300, interval=100)
    curve = train(longer, tmp_path, silent, resume=True)
    assert [each["steps"] for each in curve] == [0, 100, 200, 300]
    scenarios = usm_gym.suite("operation")[:1]
    policy = make_agent(scenarios[0].nominal, str(tmp_path))
    assert not usm_gym.evaluate(policy, scenarios).failed.any()


def test_a_diverging_training_is_stopped_with_a_clear_word(tmp_path, monkeypatch):
    def wild(*arguments):
        model = make_model(*arguments)
        model.lr_schedule = lambda remaining: 1e30
        return model

    monkeypatch.setattr(learner, "make_model", wild)
    with pytest.raises(
        DivergedError, match=r"diverged after \d+ steps: .*; the last checkpoint is"
    ):
        train(PLAN, tmp_path, silent)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--resume"], "holds no training"),
        (["--algorithm", "luck"], "algorithm is 'luck'"),
        (["--resume", "--seed", "1"], "--resume"),
        (["--conditions", "stormy"], "conditions is 'stormy'"),
    ],
)
def test_the_command_refuses_in_one_line(options, message, tmp_path, capsys):
    with pytest.raises(SystemExit, match="2"):
        main(["train", "--output", str(tmp_path / "new"), *options])
    answer = capsys.readouterr().err
    assert answer.count("\n") == 1
    assert message in answer
    assert not (tmp_path / "new").exists()
