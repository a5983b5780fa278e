"""Hostile files and command lines: one clear line, and nothing of them is run."""

import argparse
import dataclasses
import json
import sys
from hashlib import sha256

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors.numpy import load, save
from support.strategies import JSON, SCALARS, almost_fields
from usm_agents.artifact.folder import DESCRIPTION, PRETRAINED, WEIGHTS, Agent, read_agent
from usm_baselines.gains import GainsFile, read_gains

import usm_gym
from usm_cli.program import COMMANDS, main
from usm_cli.report import chapters
from usm_cli.selection import read_suite
from usm_gym.simulation import Simulation
from usm_gym.support.files import write_json
from usm_gym.support.validation import QUOTED, SAID, UsageError, in_one_line

# The same folder serves all examples, each of which writes its files anew.
anew = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
SHIPPED = PRETRAINED / "residual-ppo"
# What one error line has at most: its own words, and what it quotes.
LINE = SAID + 4 * QUOTED


def refused(call, *arguments):
    """Whether a call refuses what it is given, shortly, on one line."""
    try:
        call(*arguments)
    except (UsageError, OSError) as error:
        text = in_one_line(error)
        assert "\n" not in text
        assert len(text) <= LINE
        return True
    return False


def as_json(value):
    """JSON as hostile as Python writes it, or what JSON cannot hold as text."""
    return json.dumps(value, default=str, skipkeys=True)


@anew
@given(
    content=st.one_of(
        st.binary(max_size=40).map(lambda each: each.decode("latin-1")),
        JSON.map(as_json),
        almost_fields(Agent, st.one_of(SCALARS, JSON)).map(as_json),
    )
)
def test_a_hostile_description_of_an_agent(tmp_path, content):
    (tmp_path / WEIGHTS).write_bytes((SHIPPED / WEIGHTS).read_bytes())
    (tmp_path / DESCRIPTION).write_text(content, encoding="utf-8", errors="surrogateescape")
    assert refused(read_agent, tmp_path)


ARRAYS = load((SHIPPED / WEIGHTS).read_bytes())


@st.composite
def weights(draw):
    """A file of weights with something wrong in its arrays, its header or its bytes."""
    arrays = {name: array.copy() for name, array in ARRAYS.items()}
    name = draw(st.sampled_from(sorted(arrays)))
    kind = draw(st.sampled_from(["lost", "renamed", "cut", "type", "nan", "bytes", "header"]))
    array = arrays.pop(name)
    if kind == "renamed":
        arrays[draw(st.text(min_size=1, max_size=8))] = array
    elif kind == "cut":
        arrays[name] = array[draw(st.integers(1, len(array))) :].copy()
    elif kind == "type":
        arrays[name] = array.astype(draw(st.sampled_from(["f8", "i4", "f2", "u1"])))
    elif kind == "nan":
        array.flat[draw(st.integers(0, array.size - 1))] = float("nan")
        arrays[name] = array
    data = bytearray(save(arrays))
    if kind == "bytes":
        data = data[: draw(st.integers(0, len(data)))]
    if kind == "header":
        for _ in range(draw(st.integers(1, 4))):
            data[draw(st.integers(0, 200))] = draw(st.integers(0, 255))
    return bytes(data)


@anew
@given(data=weights())
def test_hostile_weights(tmp_path, data):
    description = json.loads((SHIPPED / DESCRIPTION).read_text())
    description["weights"] = sha256(data).hexdigest()
    write_json(tmp_path / DESCRIPTION, description)
    (tmp_path / WEIGHTS).write_bytes(data)
    refused(read_agent, tmp_path)


@anew
@given(content=st.one_of(JSON, almost_fields(GainsFile, JSON)))
def test_a_hostile_file_of_gains(tmp_path, content):
    (tmp_path / "gains.json").write_text(as_json(content))
    refused(read_gains, tmp_path / "gains.json")


def replaced(document, draw):
    """A document in which one value, somewhere, is another."""
    path, node = [], document
    while isinstance(node, (dict, list)) and node and draw(st.integers(0, 9)):
        key = draw(st.sampled_from(sorted(node) if isinstance(node, dict) else range(len(node))))
        path.append((node, key))
        node = node[key]
    if path:
        node, key = path[-1]
        if isinstance(node, dict) and draw(st.booleans()):
            del node[key]
        else:
            node[key] = draw(JSON)
    return document


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """An evaluation of two short episodes, as text."""
    made = tmp_path_factory.mktemp("result")
    short = dataclasses.replace(usm_gym.suite("operation")[1], duration=0.2, settle_time=0.1)
    write_json(made / "short.json", {"scenarios": [short.to_dict()] * 2})
    command = ["evaluate", "--policies", "pd,zero", "--suite", str(made / "short.json")]
    main([*command, "--output", str(made / "result.json")])
    return (made / "result.json").read_text()


@anew
@given(data=st.data())
def test_a_hostile_result_in_a_report(tmp_path, result, data):
    pytest.importorskip("jinja2")
    from usm_cli.report.page import html
    from usm_gym.support.provenance import provenance

    document = replaced(json.loads(result), data.draw)
    (tmp_path / "result.json").write_text(as_json(document))

    def report():
        result = chapters.read(tmp_path / "result.json")
        made = chapters.chapter(result, chapters.Choice(), lambda *_: None)
        html([made], provenance({}))

    refused(report)


@anew
@given(data=st.data())
def test_a_hostile_suite(tmp_path, result, data):
    document = replaced({"scenarios": json.loads(result)["scenarios"]}, data.draw)
    (tmp_path / "suite.json").write_text(as_json(document))
    refused(read_suite, str(tmp_path / "suite.json"))


def options():
    """The options of each command."""
    subparsers = argparse.ArgumentParser().add_subparsers()
    for command in COMMANDS:
        command.add_to(subparsers)
    return {
        name: [option for action in parser._actions for option in action.option_strings[-1:]]
        for name, parser in subparsers.choices.items()
    }


OPTIONS = options()
WORDS = st.one_of(
    SCALARS.map(str),
    JSON.map(as_json),
    st.sampled_from(
        ["sta", "pd,sta", "mine.json", "nobody:Code", "field", "1", "0", "-1", "1e999"]
    ),
)


@st.composite
def lines(draw):
    """A command with options of its own and words that are odd or not."""
    name = draw(st.sampled_from(sorted(OPTIONS)))
    words = [name]
    for option in draw(st.lists(st.sampled_from(OPTIONS[name]), max_size=4)):
        words += [option] + ([draw(WORDS)] if draw(st.integers(0, 5)) else [])
    words += draw(st.lists(WORDS, max_size=2))
    # Nothing is written, and nothing long is begun.
    last = (["--workers", "0"], ["--output", "/dev/null/file"])
    return words + [word for pair in last if pair[0] in OPTIONS[name] for word in pair]


@anew
@given(words=lines())
def test_a_hostile_command_line(tmp_path, monkeypatch, capsys, words):
    def never(*_):
        raise UsageError("nothing is computed here")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Simulation, "step", never)
    with pytest.raises(SystemExit) as left:
        sys.exit(
            main([word.encode(errors="replace").replace(b"\0", b"").decode() for word in words])
        )
    assert left.value.code in (None, 0, 1, 2)
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert all(len(line) <= LINE for line in said.splitlines())
    assert not list(tmp_path.iterdir())
