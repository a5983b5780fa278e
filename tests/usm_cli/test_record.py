"""`usm record`: what it writes, and what it refuses."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from usm_cli.program import main

minari = pytest.importorskip("minari", reason="the extra `datasets` is not installed")

USM = Path(sys.executable).with_name("usm")
NAME = "usm/operation/mine-v0"
OWN = """
import pathlib, time

class Failing:
    steps = 0

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        self.steps += 1
        return observation[:, : 5 if self.steps < 4 else 4], state

class Waiting:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        pathlib.Path("acting").touch()
        time.sleep(60)
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """The folder of the datasets, in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    return tmp_path / "datasets"


def test_a_dataset_says_how_it_was_made(capsys, monkeypatch):
    arguments = ["record", "pd", "--mode", "torpedo", "--conditions", "ideal", "--seed", "5"]
    arguments += ["--episodes", "2", "--output", NAME]
    monkeypatch.setattr(sys, "argv", ["usm", *arguments])
    main(arguments)
    dataset = minari.load_dataset(NAME)
    assert dataset.total_episodes == 2
    known = dataset.storage.metadata
    assert known["algorithm_name"] == "pd"
    assert known["provenance"]["seeds"] == {"seed": 5}
    assert known["provenance"]["command"] == f"usm {' '.join(arguments)}"
    env = dataset.recover_environment()  # warns where the version of usm-gym is another one
    assert (env.unwrapped.mode, env.unwrapped.conditions.position_noise) == ("torpedo", 0.0)
    assert env.spec == dataset.spec.env_spec
    answer = capsys.readouterr()
    assert answer.out.startswith(f"{NAME}: 2 episodes of pd, 0 lost, {dataset.total_steps} steps")
    assert answer.err == ""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nobody",), "policy is 'nobody'"),
        (("sta", "--episodes", "0"), "--episodes is 0"),
        (("sta", "--seed", "-1"), "--seed is -1"),
        (("sta", "--conditions", "stormy"), "conditions is 'stormy'"),
        (("sta", "--mode", "swim"), "swim"),
        (("sta", "--output", "sta"), "dataset is 'sta'; allowed: NAME-vN"),
        (("missing:Mine",), "missing"),
    ],
)
def test_bad_input_gets_one_line_and_leaves_nothing(arguments, message, tmp_path, capsys):
    assert message in refused(capsys, arguments)
    assert not list(tmp_path.iterdir())


def test_a_policy_that_fails_leaves_no_dataset(folder, capsys):
    Path("mine.py").write_text(OWN)
    assert "mine:Failing is refused: the action's shape is" in refused(capsys, ["mine:Failing"])
    assert not list(folder.iterdir())


def test_what_is_there_stays(capsys):
    main(["record", "zero", "--episodes", "1", "--output", NAME])
    capsys.readouterr()
    said = refused(capsys, ["zero"])
    assert f"dataset is '{NAME}'; allowed: a new one" in said


def test_without_minari_it_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("usm_cli.options.find_spec", lambda name: None)
    assert "pip install 'usm-gym[datasets]'" in refused(capsys, ["sta"])
    assert not list(tmp_path.iterdir())


@pytest.mark.posix
@pytest.mark.slow
def test_a_killed_recording_leaves_no_dataset_and_keeps_nobody_out(tmp_path, folder):
    Path("mine.py").write_text(OWN)
    process = subprocess.Popen([USM, "record", "mine:Waiting", "--output", NAME])
    while not (tmp_path / "acting").exists():
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGKILL)
    process.wait(timeout=60)
    assert list(folder.iterdir())  # what a kill leaves is not seen
    assert not minari.list_local_datasets()
    with pytest.raises(FileNotFoundError):
        minari.load_dataset(NAME)
    main(["record", "zero", "--episodes", "1", "--output", NAME])
    assert list(minari.list_local_datasets()) == [NAME]
    assert [each.name for each in folder.iterdir()] == ["usm"]


def refused(capsys, arguments):
    """Return the one line that a command says as it leaves with status 2."""
    with pytest.raises(SystemExit) as left:
        main(["record", "--output", NAME, *arguments])
    answer = capsys.readouterr()
    assert (left.value.code, answer.out) == (2, "")
    assert answer.err.count("\n") == 1
    return answer.err
