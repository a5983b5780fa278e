"""The start and the end of a command: Ctrl-C at any time, streams that are closed or full."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.interrupts import listening

pytestmark = [pytest.mark.posix, pytest.mark.slow]  # one process or more for every test

USM = Path(sys.executable).with_name("usm")
# Interrupts the process group, as a terminal does, at the first import of a module: deterministic,
# and independent of how fast the machine is. Workers are told apart by how joblib starts them.
SITE = """
import os, signal, sys

wanted = os.environ.get("WORKER_MOMENT" if "popen_loky" in str(sys.orig_argv) else "MOMENT")

def interrupt(event, details):
    global wanted
    if event == "import" and details[0] == wanted:
        wanted = None
        os.killpg(0, signal.SIGINT)

sys.addaudithook(interrupt)
"""
INTERRUPTING = """
import os, signal, time

class Interrupting:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        os.killpg(0, signal.SIGINT)
        time.sleep(60)
"""
SWALLOWING = """
import os, signal, time

try:
    os.killpg(0, signal.SIGINT)
    time.sleep(0)
except BaseException:
    pass

class Waiting:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        time.sleep(200)
"""
THREADED = """
import os, signal, threading, time

def fail():
    raise RuntimeError("stopped in the midst of it")

class Threaded:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        try:
            os.killpg(0, signal.SIGINT)
            time.sleep(60)
        finally:
            thread = threading.Thread(target=fail)
            thread.start()
            thread.join()
"""
# The first import after Ctrl-C is listened for, one of an extension module, and the last: all of
# them before the command is known.
STARTING = ("usm_cli.program", "numpy._core._multiarray_umath", "usm_cli.terminal")
# What a command imports when it is known, and after which it has much to do.
RUNNING = {
    "tune sta --trials 2 --output tuned.json": "optuna",
    "train --output agent": "torch",
    "study residual --only scale-6 --output study": "usm_agents.study.figures",
    "watch --output film.mp4": "usm_cli.film",
}


def interrupted(folder: Path, command: list[object], **moments: str) -> tuple[int, str]:
    """Return status and errors of a command that is interrupted; no process of it is left then."""
    site = folder / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(SITE)
    answer = subprocess.run(
        listening(*command),
        capture_output=True,  # waits until nobody holds the pipes any more
        text=True,
        check=False,
        timeout=120,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(site), **moments},
        start_new_session=True,
    )
    return answer.returncode, answer.stderr


@pytest.mark.parametrize("moment", STARTING)
def test_ctrl_c_at_the_start(moment: str, tmp_path: Path) -> None:
    found = interrupted(tmp_path, [USM, "reproduce"], MOMENT=moment)
    assert found == (130, "usm: interrupted\n")


@pytest.mark.parametrize("command", RUNNING)
def test_ctrl_c_while_a_command_imports_what_it_needs(command: str, tmp_path: Path) -> None:
    found = interrupted(tmp_path, [USM, *command.split()], MOMENT=RUNNING[command])
    assert found == (130, "usm: interrupted\n")


def test_ctrl_c_is_not_lost_in_a_module_that_swallows_it(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(SWALLOWING)
    found = interrupted(tmp_path, [USM, "evaluate", "--policies", "mine:Waiting"])
    assert found == (130, "usm: interrupted\n")


def test_threads_that_fail_because_of_ctrl_c_are_no_news(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(THREADED)
    found = interrupted(tmp_path, [USM, "evaluate", "--policies", "mine:Threaded"])
    assert found == (130, "usm: interrupted\n")


def test_ctrl_c_at_the_start_of_the_package(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "usm_cli", "policies"]
    assert interrupted(tmp_path, command, MOMENT="numpy") == (130, "usm: interrupted\n")


def test_ctrl_c_while_workers_start(tmp_path: Path) -> None:
    command = [USM, "evaluate", "--policies", "sta,pd", "--workers", "2"]
    assert interrupted(tmp_path, command, WORKER_MOMENT="joblib") == (130, "usm: interrupted\n")


def test_ctrl_c_while_workers_work(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(INTERRUPTING)
    command = [USM, "evaluate", "--policies", "mine:Interrupting,sta", "--workers", "2"]
    assert interrupted(tmp_path, command) == (130, "usm: interrupted\n")


def test_a_command_that_was_started_to_ignore_ctrl_c_ignores_it(tmp_path: Path) -> None:
    command = ["sh", "-c", f"trap '' INT; {USM} policies"]
    assert interrupted(tmp_path, command, MOMENT="usm_cli.terminal") == (0, "")


@pytest.mark.parametrize(("closed", "workers"), [(">&-", 1), ("2>&-", 1), ("<&- >&- 2>&-", 2)])
def test_closed_streams_do_not_stop_a_command(closed: str, workers: int, tmp_path: Path) -> None:
    arguments = f"evaluate --policies sta --episodes 1 --workers {workers} --output result.json"
    answer = subprocess.run(
        f"{USM} {arguments} {closed}",
        shell=True,
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert (answer.returncode, answer.stderr) == (0, "")
    assert ("sta" in answer.stdout) == (">&-" not in closed.split())
    assert set(json.loads((tmp_path / "result.json").read_text())["results"]) == {"sta"}


@pytest.mark.parametrize("arguments", ["policies", "--help"])
def test_a_full_disk_behind_the_output_is_one_line(arguments: str) -> None:
    environment = {**os.environ}
    environment.pop("PYTHONUNBUFFERED", None)
    answer = subprocess.run(
        f"{USM} {arguments} > /dev/full",
        shell=True,
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    assert answer.returncode == 2
    assert answer.stderr == "usm: error: [Errno 28] No space left on device\n"
