import json
import os

import pytest

from usm_gym.files import read_bytes, read_json


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
