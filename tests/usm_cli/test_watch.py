"""`usm watch`: films that play, windows that close, and nothing left where something fails."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pygame
import pytest
from support.interrupts import listening, listening_here
from usm_baselines.contender import contender

import usm_gym
from usm_cli import film
from usm_cli.program import main
from usm_cli.take import instants, take
from usm_gym.rendering.window import _windows
from usm_gym.task.head_sampling import nominal_head
from usm_gym.task.spatial_sampling import nominal_in_space
from usm_gym.task.spatial_scenario import SpatialPath

USM = Path(sys.executable).with_name("usm")
SHORT = dataclasses.replace(usm_gym.suite("operation")[1], duration=2.0, settle_time=0.5)

IN_SPACE = dataclasses.replace(
    nominal_in_space("operation3d"), duration=1.0, settle_time=0.5, path=SpatialPath(speed=0.2)
)
OF_HEAD, OF_HEAD_IN_SPACE = (
    dataclasses.replace(nominal_head(mode), duration=1.0, settle_time=0.5)
    for mode in ("head", "head3d")
)


def usm(*arguments, **options):
    return subprocess.run(
        [USM, *map(str, arguments)], capture_output=True, text=True, check=False, **options
    )


@pytest.fixture
def short(tmp_path):
    """A suite of two episodes of two seconds, in a folder of its own."""
    folder = tmp_path / "suites"
    folder.mkdir()
    path = folder / "short.json"
    path.write_text(json.dumps({"scenarios": [SHORT.to_dict()] * 2}))
    return path


@pytest.fixture
def output(tmp_path):
    folder = tmp_path / "output"
    folder.mkdir()
    return folder / "run.mp4"


def probe(path):
    """What a player sees: its description, and its first and last frame."""
    reader = imageio_ffmpeg.read_frames(str(path))
    about = next(reader)
    width, height = about["size"]
    frames = [np.frombuffer(each, np.uint8).reshape(height, width, 3) for each in reader]
    return about, frames


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "policies", "speed", "size", "fps", "frames"),
    [
        (".mp4", "sta,pd", 1, (720, 804), 25, 51),
        (".mp4", "sta", 4, (960, 720), 25, 13),
        (".gif", "sta", 1, (640, 480), 12.5, 26),
    ],
)
def test_a_film_plays(short, output, suffix, policies, speed, size, fps, frames):
    path = output.with_suffix(suffix)
    options = ("--suite", short, "--scenario", 1, "--speed", speed, "--output", path)
    answer = usm("watch", "--policies", policies, *options)
    assert answer.returncode == 0, answer.stderr
    assert answer.stderr == ""
    assert all(name in answer.stdout for name in policies.split(","))
    assert list(output.parent.iterdir()) == [path]
    about, images = probe(path)
    assert about["size"] == size
    assert about["fps"] == pytest.approx(fps, rel=0.01)
    assert about["duration"] == pytest.approx(frames / fps, abs=0.05)
    assert len(images) == frames
    assert (images[0] != images[-1]).any()
    assert images[0].std() > 10  # not blank


def test_two_policies_meet_the_same_scenario_and_noise():
    shown = instants(SHORT, 25.0, 1.0)
    takes = [take(contender(name), SHORT, shown) for name in ("sta", "pd")]
    first, second = (each.pictures for each in takes)
    assert len(first) == len(second) == len(shown)
    assert (first[0].body.centres == second[0].body.centres).all()
    assert all((a.current == b.current).all() for a, b in zip(first, second, strict=True))
    assert (first[-1].errors != second[-1].errors).any()
    np.testing.assert_allclose(first[-1].errors[1:], takes[0].trajectory.error, atol=1e-15)


@pytest.mark.parametrize(
    ("scenario", "names", "suffix", "width", "size"),
    [
        (IN_SPACE, ["pd"], ".mp4", 320, (320, 240)),
        (IN_SPACE, ["pd", "sta"], ".gif", 240, (240, 268)),
        (OF_HEAD, ["rates-pd"], ".mp4", 320, (320, 240)),
        (OF_HEAD, ["rates-pd", "rates-lqg-joints"], ".gif", 240, (240, 268)),
        (OF_HEAD_IN_SPACE, ["rates-pd", "rates-lqg-joints"], ".gif", 240, (240, 268)),
    ],
)
def test_other_robots_are_filmed_as_the_papers(scenario, names, suffix, width, size, output):
    shown = instants(scenario, 12.5, 2.0)
    takes = [take(contender(name), scenario, shown) for name in names]
    made = film.Film(takes, names, len(shown), width, speed=2.0)
    path = output.with_suffix(suffix)
    film.write(made, path, 12.5)
    about, images = probe(path)
    assert about["size"] == size
    assert len(images) == len(shown) == 7
    assert (images[0] != images[-1]).any()
    errors, expected = takes[0].pictures[-1].errors[1:], takes[0].trajectory.error
    np.testing.assert_allclose(errors, expected[: len(errors)], atol=1e-15)


def test_frames_keep_time_at_any_speed():
    assert instants(SHORT, 25.0, 1.0) == list(range(0, 101, 2))
    assert instants(SHORT, 25.0, 0.25)[:5] == [0, 0, 1, 2, 2]  # rounded half to even
    assert instants(SHORT, 25.0, 2.0) == list(range(0, 101, 4))
    assert instants(SHORT, 25.0, 1000.0) == [0, 100]


def test_a_lost_robot_keeps_its_last_picture():
    away = dataclasses.replace(SHORT.path, speed=2.0)
    scenario = dataclasses.replace(SHORT, path=away)
    shown = instants(scenario, 25.0, 1.0)
    lost = take(contender("zero"), scenario, shown)
    assert lost.trajectory.lost
    assert lost.pictures[-1].lost
    assert not any(each.lost for each in lost.pictures[:-1])
    made = film.Film([lost], ["zero"], len(shown), 320)
    assert (made.frame(len(lost.pictures) - 1) == made.frame(len(shown) - 1)).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--speed", "0"], "--speed is 0.0; allowed: 0.01 to 1000"),
        (["--speed", "inf"], "--speed is inf"),
        (["--output", "run.avi"], "--output is 'run.avi'; allowed: a file .mp4 or .gif"),
        (["--output", "missing/run.mp4"], "no directory missing"),
        (
            ["--policies", "sta,pd,zero,heading", "--output", "run.mp4"],
            "allowed: one to three names",
        ),
        (["--policies", "sta,pd", "--names", "A,", "--output", "run.mp4"], "allowed: 2 names"),
        (["--policies", "nobody", "--output", "run.mp4"], "policy is 'nobody'"),
        (["--scenario", "50", "--output", "run.mp4"], "--scenario is 50; allowed: 0 to 49"),
        (["--scenario", "-1", "--output", "run.mp4"], "--scenario is -1"),
        (["--suite", "torpedo", "--seed", "1", "--output", "run.mp4"], "--suite"),
        (["--policies", "controllers:Broken", "--output", "run.mp4"], "is refused: KeyError"),
    ],
)
def test_bad_input_gets_one_line_and_status_2(arguments, message, tmp_path, monkeypatch, capsys):
    (tmp_path / "controllers.py").write_text(
        "class Broken:\n"
        "    def predict(self, observation, state=None, start=None, deterministic=True):\n"
        "        raise KeyError('gain')\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(SystemExit) as left:
        main(["watch", *arguments])
    assert left.value.code == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert message in errors
    assert not list(tmp_path.glob("*.mp4"))


@pytest.mark.parametrize("module", ["pygame", "imageio_ffmpeg", "matplotlib"])
def test_a_missing_package_is_named_with_its_extra(module, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(SystemExit) as left:
        main(["watch"])
    assert left.value.code == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert module.replace("_", "-") in errors
    assert "pip install 'usm-gym[render]'" in errors


def test_without_a_display_a_film_is_asked_for():
    answer = usm("watch", env={**os.environ, "SDL_VIDEODRIVER": "offscreen"})
    assert answer.returncode == 2
    assert "no display found; add --output run.mp4" in answer.stderr
    assert answer.stderr.count("\n") == 1


@pytest.mark.slow
def test_a_window_shows_the_episode_to_its_end(short):
    answer = usm("watch", "--policies", "sta,pd", "--suite", short, "--speed", "4")
    assert answer.returncode == 0, answer.stderr
    assert answer.stderr == ""


class Endless:
    """A film in which something happens at the third frame."""

    size, length, drawn = (64, 48), 10**9, 0

    def __init__(self, happens):
        self.happens = happens

    def frame(self, index):
        self.drawn += 1
        if self.drawn == 3:
            self.happens()
        return np.zeros((48, 64, 3), np.uint8)


def test_a_closed_window_ends_the_show():
    others = set(_windows)

    def close():
        (window,) = _windows - others
        pygame.event.post(pygame.Event(pygame.WINDOWCLOSE, window=window))

    film.play(Endless(close), 1000.0)
    assert _windows == others


def test_ctrl_c_closes_the_window():
    others = set(_windows)
    with listening_here(), pytest.raises(KeyboardInterrupt):
        film.play(Endless(lambda: signal.raise_signal(signal.SIGINT)), 1000.0)
    assert _windows == others


@pytest.mark.parametrize(
    ("reader", "status", "said"),
    [("gone", 1, ""), ("full", 2, "usm: error: [Errno 28] No space left on device\n")],
)
def test_a_film_is_whole_whatever_becomes_of_the_scores(
    reader, status, said, short, output, monkeypatch, capsys
):
    if reader == "gone":
        end, handle = os.pipe()
        os.close(end)
    else:
        handle = os.open("/dev/full", os.O_WRONLY)
    monkeypatch.setattr(sys, "stdout", os.fdopen(handle, "w"))
    with pytest.raises(SystemExit) as left:
        main(["watch", "--suite", str(short), "--speed", "4", "--output", str(output)])
    assert left.value.code == status
    assert capsys.readouterr().err == said
    assert len(probe(output)[1]) == 13


@pytest.mark.posix
def test_a_full_disk_leaves_one_line_and_no_file(output):
    import resource  # which Windows lacks

    taken = take(contender("sta"), SHORT, instants(SHORT, 25.0, 1.0))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        with pytest.raises(OSError, match="cannot write") as caught:
            film.write(film.Film([taken], ["sta"], 51, 640), output, 25.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert "\n" not in str(caught.value)
    assert list(output.parent.iterdir()) == []


@pytest.mark.posix
@pytest.mark.slow
def test_ctrl_c_leaves_with_status_130_and_no_file(output):
    arguments = ["watch", "--seed", "1", "--speed", "0.01", "--output", output]
    process = subprocess.Popen(listening(USM, *arguments), stderr=subprocess.PIPE, text=True)
    while process.poll() is None and not list(output.parent.glob("run.part*")):
        time.sleep(0.1)
    time.sleep(0.5)
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert errors == "usm: interrupted\n"
    assert process.returncode == 130
    assert list(output.parent.iterdir()) == []
