"""Files of agents: read back to the bit, and refused when anything about them is wrong."""

import contextlib
import dataclasses
import json
import os
import pickle
import sys
from functools import partial
from hashlib import sha256
from itertools import pairwise

import numpy as np
import pytest
from usm_agents.artifact.folder import (
    DESCRIPTION,
    PRETRAINED,
    WEIGHTS,
    agent_contender,
    make_agent,
    read_agent,
    write_agent,
)
from usm_agents.artifact.network import Network, Recurrence
from usm_agents.residual.task import Residual, ResidualPolicy
from usm_baselines import registry

import usm_gym
from usm_cli.program import main
from usm_gym.support.validation import SAID

SUITE = usm_gym.suite("operation")[:2]
NOMINAL = SUITE[0].nominal


def network(inputs, outputs=2):
    rng = np.random.default_rng(0)
    sizes = (inputs, 8, outputs)
    weights = [rng.normal(0, 0.3, pair).astype(np.float32) for pair in pairwise(sizes)]
    biases = [rng.normal(0, 0.1, size).astype(np.float32) for size in sizes[1:]]
    return Network(tuple(weights), tuple(biases), "tanh", "clip")


def described(residual, base, **fields):
    """Description of an agent of a task on a base with its own gains."""
    return {
        "summary": "none that has learned anything",
        "mode": "operation",
        "conditions": {},
        "base": base,
        "gains": {},
        "residual_scale": 2.0,
        "action": "force",
        "omit": [],
        "frames": 1,
        "layout": residual.layout.fingerprint,
        "algorithm": "ppo",
        "seed": 0,
        "steps": 1,
        "training": {},
        "scores": {},
        **fields,
    }


@pytest.fixture
def folder(tmp_path):
    residual = Residual(NOMINAL)
    description = described(residual, "sta", gains=residual.base.gains._asdict())
    write_agent(tmp_path / "agent", description, network(residual.layout.size))
    return tmp_path / "agent"


def change(folder, **fields):
    description = json.loads((folder / DESCRIPTION).read_text())
    (folder / DESCRIPTION).write_text(json.dumps({**description, **fields}))


def test_an_agent_acts_on_the_base_that_it_was_trained_on_only(tmp_path):
    base = "estimator-lqg-joints"
    residual = Residual(NOMINAL, base)
    weights = read_agent(PRETRAINED / base)[0].weights
    for name, known in (("same", weights), ("other", weights[::-1]), ("none", "")):
        description = described(residual, base, base_weights=known)
        write_agent(tmp_path / name, description, network(residual.layout.size))
    assert make_agent(NOMINAL, str(tmp_path / "same")).base.nominal == NOMINAL
    for name in ("other", "none"):
        with pytest.raises(ValueError, match="base_weights"):
            make_agent(NOMINAL, str(tmp_path / name))


def test_an_agent_read_back_is_the_agent_to_the_bit(folder):
    residual = Residual(NOMINAL, residual_scale=2.0)
    ours = usm_gym.evaluate(ResidualPolicy(residual, network(residual.layout.size)), SUITE)
    read = usm_gym.evaluate(agent_contender(str(folder)).make(NOMINAL), SUITE)
    for name, values in ours.per_episode.items():
        assert (read.per_episode[name] == values).all()


def test_an_agent_sees_errors_on_the_scale_of_its_training_wherever_it_is_taken(folder):
    (there,) = usm_gym.suite("operation-basin")[:1]
    there = dataclasses.replace(there, duration=2.0, settle_time=0.5)
    home = Residual(NOMINAL).layout
    assert Residual(there.nominal).layout.fingerprint != home.fingerprint
    residual = Residual(
        there.nominal, residual_scale=2.0, position_noise=SUITE[0].conditions.position_noise
    )
    assert residual.layout.fingerprint == home.fingerprint
    ours = usm_gym.evaluate(ResidualPolicy(residual, network(home.size)), [there])
    read = usm_gym.evaluate(make_agent(there.nominal, str(folder)), [there])
    for name, values in ours.per_episode.items():
        assert (read.per_episode[name] == values).all()


def test_an_agent_may_have_one_as_its_base_that_corrects_estimates(tmp_path, monkeypatch):
    monkeypatch.setattr(registry, "_entries", dict(registry._entries))
    below, rng = Residual(NOMINAL, "sta-navigator", action="estimates"), np.random.default_rng(0)
    sizes = (below.layout.size, 16), (4, 16), 16
    memory = Recurrence(*(rng.normal(0, 0.3, size).astype(np.float32) for size in sizes), period=4)
    net = dataclasses.replace(network(4, below.actions), recurrence=memory)
    description = described(below, "sta-navigator", action="estimates")
    write_agent(tmp_path / "below", description, net)
    registry.register("below", partial(make_agent, folder=str(tmp_path / "below")), "made up")
    residual = Residual(NOMINAL, ResidualPolicy(below, net), residual_scale=2.0)
    above = network(residual.layout.size)
    write_agent(tmp_path / "above", described(residual, "below"), above)
    scenarios = [dataclasses.replace(SUITE[0], duration=3.0, settle_time=0.5)]
    ours = usm_gym.evaluate(ResidualPolicy(residual, above), scenarios)
    read = usm_gym.evaluate(agent_contender(str(tmp_path / "above")).make(NOMINAL), scenarios)
    for name, values in ours.per_episode.items():
        assert (read.per_episode[name] == values).all()
    _, found = read_agent(tmp_path / "below")
    assert found.recurrence.period == 4


def test_a_network_answers_alike_for_one_and_for_many():
    net = network(44)
    seen = np.random.default_rng(1).normal(size=(50, 44)).astype(np.float32)
    together, _ = net.predict(seen)
    assert (together == np.concatenate([net.predict(row[None])[0] for row in seen])).all()
    hidden = np.tanh(seen @ net.weights[0] + net.biases[0])
    expected = np.clip(hidden @ net.weights[1] + net.biases[1], -1, 1)
    np.testing.assert_allclose(together, expected, atol=2e-6)


class Bomb:
    def __reduce__(self):
        return (sys.exit, ("the agent's code was run",))


def with_weights(folder, data):
    (folder / WEIGHTS).write_bytes(data)
    change(folder, weights=sha256(data).hexdigest())


def tampered(folder):
    data = bytearray((folder / WEIGHTS).read_bytes())
    data[-3] ^= 1
    (folder / WEIGHTS).write_bytes(bytes(data))


def truncated(folder):
    with_weights(folder, (folder / WEIGHTS).read_bytes()[:-100])


def poisoned(folder):
    with_weights(folder, pickle.dumps(Bomb()))


def lost(folder):
    (folder / WEIGHTS).unlink()


def cut_short(folder):
    text = (folder / DESCRIPTION).read_text()
    (folder / DESCRIPTION).write_text(text[: len(text) // 2])


def linked(folder):
    secret = folder.parent / "token"
    secret.write_text('{"summary": "secret"}')
    (folder / DESCRIPTION).unlink()
    (folder / DESCRIPTION).symlink_to(secret)


def piped(folder):
    (folder / WEIGHTS).unlink()
    os.mkfifo(folder / WEIGHTS)


def nested(folder):
    (folder / DESCRIPTION).write_text("[" * 200_000)


def in_bfloat16(folder):
    header = b'{"weight_0":{"dtype":"BF16","shape":[1],"data_offsets":[0,2]}}'
    with_weights(folder, len(header).to_bytes(8, "little") + header + b"\0\0")


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (tampered, "SHA-256"),
        (truncated, "is no network"),
        (poisoned, "is no network"),
        (lost, WEIGHTS),
        (cut_short, "is no agent"),
        (linked, "a symbolic link"),
        pytest.param(piped, "a regular file", marks=pytest.mark.posix),
        (nested, "nested too deeply"),
        (in_bfloat16, "'BF16'; allowed: .* float32"),
        (lambda folder: change(folder, summary="x" * 10**6, also=1), "also"),
        (lambda folder: change(folder, frames=10**30), "frames"),
        (lambda folder: change(folder, gains={"surface": 1e300}), "surface"),
        (lambda folder: change(folder, layout="0123"), "observation layout"),
        (lambda folder: change(folder, action="thrusters"), "observation layout"),
        (lambda folder: change(folder, conditions={"position_noise": 1e-3}), "observation layout"),
        (lambda folder: change(folder, conditions={"salt": 1}), "salt"),
        (lambda folder: change(folder, base="nobody"), "policy is 'nobody'"),
        (lambda folder: change(folder, base="os:system"), "policy is 'os:system'"),
        (lambda folder: change(folder, gains={"surface": "1"}), "gains"),
        (lambda folder: change(folder, residual_scale=-1.0), "residual_scale"),
        (lambda folder: change(folder, also=1), "also"),
        (lambda folder: change(folder, output="exec"), "output"),
    ],
)
def test_a_spoilt_agent_is_refused_in_one_line(folder, spoil, message):
    spoil(folder)
    with pytest.raises((ValueError, OSError), match=message) as caught:
        make_agent(NOMINAL, str(folder))
    assert "\n" not in str(caught.value)
    assert "secret" not in str(caught.value)
    assert len(str(caught.value)) < 2 * SAID


@pytest.mark.parametrize("moves", [0, 1, 2, 3])
def test_an_agent_that_is_killed_while_it_is_replaced_is_the_old_one_or_the_new_one(
    moves, folder, monkeypatch
):
    old, net = read_agent(folder)
    description = {
        field.name: getattr(old, field.name)
        for field in dataclasses.fields(old)
        if field.name not in ("activation", "output", "weights")
    }
    newer = dataclasses.replace(net, biases=tuple(each + 1 for each in net.biases))
    left, replace = moves, os.replace

    def killed(part, target):
        nonlocal left
        if left == 0:
            raise KeyboardInterrupt
        left -= 1
        replace(part, target)

    monkeypatch.setattr(os, "replace", killed)
    with contextlib.suppress(KeyboardInterrupt):
        write_agent(folder, {**description, "steps": 2}, newer)
    monkeypatch.undo()
    agent, found = read_agent(folder)
    assert agent.steps == (2 if moves >= 2 else 1)
    expected = newer if moves >= 2 else net
    assert (found.biases[0] == expected.biases[0]).all()
    write_agent(folder, {**description, "steps": 2}, newer)
    assert sorted(file.name for file in folder.iterdir()) == [DESCRIPTION, WEIGHTS]


def test_the_command_line_takes_a_folder(folder, capsys):
    command = ["evaluate", "--policies", str(folder), "--episodes", "1"]
    main(command)
    assert "sampled, 1 scenario, best first" in capsys.readouterr().out
    tampered(folder)
    with pytest.raises(SystemExit) as left:
        main(command)
    errors = capsys.readouterr().err
    assert left.value.code == 2
    assert errors.count("\n") == 1
    assert "SHA-256" in errors
