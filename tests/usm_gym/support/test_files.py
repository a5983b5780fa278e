import errno
import json
import os
import signal
import subprocess
import sys

import pytest

from usm_gym.support.files import (
    check_writable,
    holding,
    read_bytes,
    read_json,
    replacing,
    write_text,
)


@pytest.mark.posix
def test_a_pipe_or_a_device_is_refused_at_once(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, "/dev/zero", tmp_path):
        with pytest.raises((ValueError, OSError), match=r"regular file|directory"):
            read_bytes(path)


def test_a_link_is_refused_where_none_is_allowed(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("{}")
    link = tmp_path / "agent.json"
    link.symlink_to(secret)
    assert read_json(link) == {}
    with pytest.raises(ValueError, match="symbolic link"):
        read_json(link, links=False)


@pytest.mark.posix
def test_a_pipe_or_a_device_is_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, "/dev/null"):
        with pytest.raises(OSError, match="no regular file"):
            check_writable(path)


def test_a_large_file_is_refused_unread(tmp_path):
    with open(tmp_path / "large", "wb") as file:
        file.truncate(1000)
    with pytest.raises(ValueError, match="up to 999 bytes"):
        read_bytes(tmp_path / "large", 999)


@pytest.mark.parametrize(
    "text",
    ["", "[" * 200_000, "\x00", "1" * 5000, json.dumps({"key": "secret" * 100})[:-1]],
    ids=["empty", "deep", "binary", "long integer", "cut"],
)
def test_what_is_no_json_is_said_in_a_line_that_does_not_quote_the_file(tmp_path, text):
    file = tmp_path / "file.json"
    file.write_text(text)
    with pytest.raises(ValueError, match=r"file\.json is (no JSON|nested)") as caught:
        read_json(file)
    assert "secret" not in str(caught.value)
    assert "\n" not in str(caught.value)


def test_parts_of_killed_writers_of_the_same_file_are_cleared_and_no_others(tmp_path):
    dead = [tmp_path / name for name in ("out.part_killed0.json", "out.partabcdefgh.json")]
    others = ["other.partabcdefgh.json", "out.partabcdefgh.csv", "out.parts.json", "out.part.json"]
    for file in (*dead, *(tmp_path / name for name in others)):
        file.write_text("half")
    with replacing(tmp_path / "out.json") as part:
        write_text(tmp_path / "out.json", "from another command")
        assert part.exists()
        part.write_text("new")
    assert (tmp_path / "out.json").read_text() == "new"
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(["out.json", *others])


def test_what_is_written_survives_a_power_cut(tmp_path, monkeypatch):
    done = []
    fsync, replace = os.fsync, os.replace

    def named(handle):
        fsync(handle)
        done.append(os.readlink(f"/proc/self/fd/{handle}"))

    def moved(part, target):
        replace(part, target)
        done.append("moved")

    if not os.path.exists("/proc/self/fd"):
        pytest.skip("handles have no names here")
    monkeypatch.setattr(os, "fsync", named)
    monkeypatch.setattr(os, "replace", moved)
    write_text(tmp_path / "out.json", "new")
    assert done[0].startswith(str(tmp_path / "out.part"))
    assert done[1:] == ["moved", str(tmp_path)]


def test_a_full_disk_is_said_with_the_name_of_the_file(tmp_path):
    def fail():
        with replacing(tmp_path / "out.json"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OSError, match=r"No space left on device: .*out\.json"):
        fail()
    assert not list(tmp_path.iterdir())


def test_holding_an_output_makes_no_folder(tmp_path):
    with pytest.raises(FileNotFoundError, match="missing"), holding(tmp_path / "missing" / "out"):
        pass
    assert not list(tmp_path.iterdir())


HOLDER = """
import sys
from usm_gym.support.files import holding
with holding(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.mark.posix
@pytest.mark.parametrize("kind", ["file", "folder"])
def test_an_output_is_held_by_one_process_until_it_ends_however_it_ends(kind, tmp_path):
    output = tmp_path / "out"
    if kind == "folder":
        output.mkdir()
    command = [sys.executable, "-c", HOLDER, str(output)]
    holder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert holder.stdout.readline() == "held\n"
    with pytest.raises(BlockingIOError, match="out is in use by another command"), holding(output):
        pass
    holder.send_signal(signal.SIGKILL)
    holder.communicate()
    with holding(output), holding(tmp_path / "another"):
        pass
    assert not [file for file in tmp_path.rglob("*") if file.name.endswith(".lock")]
