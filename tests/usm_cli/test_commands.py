"""The `usm` command as a user types it."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.interrupts import listening

from usm_cli.commands import policies
from usm_cli.program import BUG, main
from usm_gym.simulation import Simulation

USM = Path(sys.executable).with_name("usm")


def usm(*arguments, **options):
    return subprocess.run(
        [USM, *arguments], capture_output=True, text=True, check=False, timeout=300, **options
    )


def refused(capsys, *arguments):
    """Return the one line that a command says as it leaves with status 2."""
    with pytest.raises(SystemExit) as left:
        main(list(arguments))
    answer = capsys.readouterr()
    assert left.value.code == 2
    assert answer.out == ""
    assert answer.err.count("\n") == 1
    return answer.err


def small_suite(folder, count=3):
    import usm_gym

    path = folder / "small.json"
    scenarios = []
    for scenario in usm_gym.suite("operation")[:count]:
        data = scenario.to_dict()
        data["duration"], data["settle_time"] = 4.0, 1.0
        scenarios.append(data)
    path.write_text(json.dumps({"scenarios": scenarios}))
    return path


@pytest.mark.parametrize("width", ["80", "140"])
def test_policies_lists_every_policy_under_its_family(width):
    import usm_baselines

    answer = usm("policies", env={**os.environ, "COLUMNS": width})
    assert answer.returncode == 0
    assert answer.stderr == ""
    assert max(map(len, answer.stdout.splitlines())) <= int(width)
    listed = re.findall(r"[\w-]+", answer.stdout)
    assert set(usm_baselines.ids()) <= set(listed)
    places = [answer.stdout.index(title) for title in ("PD and PID:", "Sliding mode:", "Learned:")]
    assert places == sorted(places)
    assert not re.search(r"\(\d+\)", answer.stdout)  # numbers of equations


def test_without_a_command_usm_says_what_it_is_for(capsys):
    main([])
    said = capsys.readouterr().out
    assert "usm evaluate" in said
    assert "usm COMMAND --help" in said


def test_evaluate_prints_a_table_and_writes_the_documented_file(tmp_path):
    output = tmp_path / "result.json"
    answer = usm(
        *("evaluate", "--policies", "pd,sta", "--suite", small_suite(tmp_path)),
        *("--output", output),
        env={**os.environ, "COLUMNS": "80"},
    )
    assert answer.returncode == 0
    assert answer.stderr == ""  # no progress bar in a pipe
    assert max(map(len, answer.stdout.splitlines())) <= 80
    assert re.search(r"1= +sta .+\n.+1= +pd ", answer.stdout)
    said = " ".join(answer.stdout.split())
    assert "sta is ahead with an error of" in said
    assert said.endswith("cannot say who wins; it takes 50.")
    data = json.loads(output.read_text())
    assert data["episodes"] == 3
    assert len(data["scenarios"]) == 3
    assert list(data["results"]) == ["pd", "sta"]
    row = data["results"]["sta"]
    for key in (
        "max_error_x",
        "max_error_y",
        "settled_error_x",
        "settled_error_y",
        "rms_error_x",
        "rms_error_y",
        "thrust_effort",
        "thrust_variation",
    ):
        values = row["per_episode"][key]
        assert len(values) == 3
        assert row[key]["mean"] == pytest.approx(sum(values) / 3)
        assert row[key]["worst"] == max(values)
        assert row[key]["ci95"][0] <= row[key]["mean"] <= row[key]["ci95"][1]
    assert row["failures"] == 0
    assert {"version", "commit", "packages", "seeds", "command"} <= set(data["provenance"])
    assert data["provenance"]["command"].startswith("usm evaluate --policies pd,sta")


@pytest.mark.slow
def test_results_do_not_depend_on_the_workers(tmp_path):
    results = []
    for workers in ("1", "2"):
        output = tmp_path / f"{workers}.json"
        answer = usm(
            *("evaluate", "--policies", "sta,zero", "--suite", small_suite(tmp_path)),
            *("--workers", workers, "--output", output),
        )
        assert answer.returncode == 0, answer.stderr
        results.append(json.loads(output.read_text())["results"])
    assert results[0] == results[1]


def test_sampled_scenarios_come_from_the_seed(tmp_path):
    def scenarios(*arguments):
        output = tmp_path / "result.json"
        main(["evaluate", "--policies", "zero", *arguments, "--output", str(output)])
        data = json.loads(output.read_text())
        assert data["suite"] is None
        return data["scenarios"]

    first = scenarios("--seed", "3", "--episodes", "2")
    assert scenarios("--seed", "3", "--episodes", "3")[:2] == first
    assert scenarios("--seed", "4", "--episodes", "2") != first
    assert scenarios("--seed", "3", "--episodes", "1", "--mode", "torpedo")[0]["mode"] == "torpedo"


def test_conditions_override_the_suites_own_and_are_marked(tmp_path):
    output = tmp_path / "result.json"
    arguments = ["evaluate", "--policies", "zero", "--suite", str(small_suite(tmp_path))]
    arguments += ["--output", str(output), "--conditions"]
    main([*arguments, "ideal"])
    data = json.loads(output.read_text())
    assert data["conditions_override"] == "ideal"
    assert {s["conditions"]["position_noise"] for s in data["scenarios"]} == {0.0}
    main([*arguments, '{"thruster_limit": 5.0}'])
    data = json.loads(output.read_text())
    assert {s["conditions"]["thruster_limit"] for s in data["scenarios"]} == {5.0}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["evaluate", "--policies", "nobody"],
            "policy is 'nobody'; allowed: those that `usm policies` lists",
        ),
        (["evaluate", "--policies", ","], "--policies"),
        (["evaluate", "--suite", "nowhere"], "suite is 'nowhere'; allowed: operation"),
        (["evaluate", "--suite", "missing.json"], "missing.json"),
        (["evaluate", "--conditions", "stormy"], "conditions is 'stormy'"),
        (["evaluate", "--conditions", '{"noise": 1}'], "noise is 1"),
        (["evaluate", "--conditions", '{"noise": '], "no JSON"),
        (["evaluate", "--episodes", "0"], "--episodes is 0"),
        (["evaluate", "--seed", "-1"], "--seed is -1"),
        (["evaluate", "--workers", "0"], "workers is 0"),
        (["evaluate", "--suite", "torpedo", "--seed", "1"], "--suite"),
        (["evaluate", "--output", "missing/result.json"], "missing"),
        (["evaluate", "--output", "."], "directory"),
        (["evaluate", "--sweet"], "--sweet"),
        (["evaluate", "--mode", "swim"], "swim"),
        (["swim"], "swim"),
    ],
)
def test_bad_input_gets_one_line_and_status_2(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    error = refused(capsys, *arguments)
    assert "error" in error
    assert message in error
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "text", ["{", '{"scenarios": 3}', '{"scenarios": [{"mod": 1}]}', "[]", "\0"]
)
def test_a_broken_file_gets_one_line_and_status_2(text, tmp_path, capsys):
    broken = tmp_path / "broken.json"
    broken.write_text(text)
    assert str(broken) in refused(capsys, "evaluate", "--suite", str(broken))


WAITING = """
import pathlib, time

class Waiting:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        pathlib.Path("acting").touch()
        time.sleep(60)
"""


@pytest.mark.posix
@pytest.mark.slow
def test_ctrl_c_leaves_with_status_130_and_no_file(tmp_path):
    (tmp_path / "mine.py").write_text(WAITING)
    process = subprocess.Popen(
        listening(USM, "evaluate", "--policies", "mine:Waiting", "--output", "result.json"),
        cwd=tmp_path,
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
        stderr=subprocess.PIPE,
        text=True,
    )
    while not (tmp_path / "acting").exists():
        assert process.poll() is None
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors == "usm: interrupted\n"
    assert {file.name for file in tmp_path.iterdir()} == {"mine.py", "acting"}


OWN = """
import os

class Zero:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return 0.0 * observation[:, :5], state

class Leaving(Zero):
    def predict(self, *arguments, **options):
        os._exit(3)

class Slipping(Zero):
    def predict(self, *arguments, **options):
        return self.gain
"""


@pytest.mark.slow
def test_own_folders_named_like_ours_hide_none_and_workers_find_own_modules(tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    for package in ("usm_agents", "usm_baselines", "usm_gym", "usm_cli", "tests"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("raise ImportError('not this one')")
    arguments = ("--episodes", "2", "--workers", "2", "--output", "result.json")
    answer = usm("evaluate", "--policies", "zero,mine:Zero", *arguments, cwd=tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")
    results = json.loads((tmp_path / "result.json").read_text())["results"]
    assert (results["zero"].pop("told"), results["mine:Zero"].pop("told")) == ("position only", "")
    assert results["zero"] == results["mine:Zero"]


@pytest.mark.slow
def test_a_worker_that_ends_early_is_one_line(tmp_path):
    (tmp_path / "mine.py").write_text(OWN)
    arguments = ("--policies", "zero,mine:Leaving", "--episodes", "2", "--workers", "2")
    answer = usm("evaluate", *arguments, cwd=tmp_path)
    assert answer.returncode == 2
    said, *others = answer.stderr.splitlines()
    assert said == "usm: error: a worker process ended before its task was done: EXIT(3)"
    # On a busy machine loky's own process may add what it has cleaned up after the worker.
    assert "Traceback" not in answer.stderr
    assert all("resource_tracker" in line or "warnings.warn" in line for line in others)


def test_a_closed_pipe_leaves_no_traceback():
    answer = subprocess.run(
        f"{USM} policies | true", shell=True, capture_output=True, text=True, check=False
    )
    assert answer.stderr == ""


def test_a_bug_is_a_traceback_and_status_1(monkeypatch, capsys):
    def slip(arguments):
        raise ValueError("a slip of ours")

    monkeypatch.setattr(policies, "run", slip)
    with pytest.raises(SystemExit) as left:
        main(["policies"])
    assert left.value.code == 1
    *lines, last = capsys.readouterr().err.splitlines()
    assert lines[0] == "Traceback (most recent call last):"
    assert lines[-1] == "ValueError: a slip of ours"
    assert last == BUG


def test_a_bug_below_a_policy_of_ours_is_no_refusal(monkeypatch, tmp_path, capsys):
    def slip(self, action):
        raise AttributeError("a slip of ours")

    monkeypatch.setattr(Simulation, "step", slip)
    chosen = ["--policies", "sta", "--suite", str(small_suite(tmp_path))]
    with pytest.raises(SystemExit) as left:
        main(["evaluate", *chosen])
    assert left.value.code == 1
    *_, error, last = capsys.readouterr().err.splitlines()
    assert error == "AttributeError: a slip of ours"
    assert last == BUG


def test_a_slip_in_a_controller_of_ones_own_is_a_refusal(monkeypatch, tmp_path, capsys):
    (tmp_path / "slipping.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    chosen = ["--policies", "zero,slipping:Slipping", "--suite", str(small_suite(tmp_path))]
    with pytest.raises(SystemExit) as left:
        main(["evaluate", *chosen, "--output", "result.json"])
    assert left.value.code == 1
    reason = "AttributeError: 'Slipping' object has no attribute 'gain'"
    assert capsys.readouterr().err == f"usm: slipping:Slipping is refused: {reason}\n"
    result = json.loads(Path("result.json").read_text())
    assert (list(result["results"]), result["refused"]) == (["zero"], {"slipping:Slipping": reason})


@pytest.mark.parametrize(
    "arguments", [("--policies", "nobody"), ("--suite", "missing.json")], ids=["input", "file"]
)
def test_debug_shows_where_an_error_was_found(arguments, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    line = refused(capsys, "evaluate", *arguments)
    with pytest.raises(SystemExit) as left:
        main(["--debug", "evaluate", *arguments])
    assert left.value.code == 2
    errors = capsys.readouterr().err
    assert errors.startswith("Traceback (most recent call last):\n")
    assert errors.endswith(line)


def test_reproduce_refuses_a_folder_that_cannot_be_made(tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("")
    for folder in (file / "folder", file):
        assert str(file) in refused(capsys, "reproduce", "--output", str(folder))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--step", "0"), "--step is 0.0"),
        (("--step=-1e-5",), "--step is -1e-05"),
        (("--step", "3e-6"), "--step is 3e-06"),
        (("--step", "nan"), "--step is nan"),
        (("--step", "2e-3"), "--step is 0.002"),
        (("--figures", "fig05,fig99", "--output", "x"), "--figures is 'fig05,fig99'"),
        (("--figures", "fig05"), "--output is None"),
        (("--study",), "--output is None"),
        (("--study", "--fit", "--output", "x"), "not allowed with"),
    ],
)
def test_reproduce_refuses_bad_input(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert message in refused(capsys, "reproduce", *arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_reproduce_writes_the_same_bits_twice(tmp_path):
    """At a step a hundred times the paper's, to save time."""
    for name in "ab":
        options = ("--step", "1e-3", "--figures", "fig04,fig07", "--output", name)
        answer = usm("reproduce", *options, cwd=tmp_path)
        assert answer.returncode == 0, answer.stderr
    documents = [json.loads((tmp_path / name / "table1.json").read_text()) for name in "ab"]
    commands = [document["provenance"].pop("command") for document in documents]
    assert commands[0] != commands[1]
    assert documents[0] == documents[1]
    assert set(documents[0]["rows"]["sta"]) == {"torpedo", "operation", "settled"}
    for file in ("table1.md", "fig04.png", "fig04.svg", "fig07.png", "fig07.svg"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == [
        "fig04.png",
        "fig04.svg",
        "fig07.png",
        "fig07.svg",
        "table1.json",
        "table1.md",
    ]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [(("--rounds", "0"), "--rounds is 0"), (("--output", "missing/b.json"), "missing")],
)
def test_bench_refuses_bad_input(arguments, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert message in refused(capsys, "bench", *arguments)
