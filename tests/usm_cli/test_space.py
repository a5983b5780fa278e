"""The commands on the robot in space, from end to end, on episodes of a second or two."""

import json
from dataclasses import replace

import pytest

from usm_cli import selection
from usm_cli.program import main
from usm_gym import suite
from usm_gym.robots import name_of
from usm_gym.task.conditions import SPATIAL_PRESETS
from usm_gym.task.spatial_scenario import NO_SCAN

SUITES = ("operation3d", "operation3d-basin", "operation3d-neutral", "torpedo3d")


def brief(scenario):
    return replace(scenario, scan=NO_SCAN, duration=1.0, settle_time=0.5)


@pytest.fixture
def result(tmp_path, monkeypatch):
    """What a command writes that is given brief episodes."""
    monkeypatch.setattr(selection, "suite", lambda name: [brief(s) for s in suite(name)[:2]])
    sampled = selection.unseen
    monkeypatch.setattr(selection, "unseen", lambda *of: [brief(s) for s in sampled(*of)])
    output = tmp_path / "result.json"

    def written(*arguments):
        main([*arguments, "--output", str(output)])
        return json.loads(output.read_text())

    return written


def refused(capsys, *arguments):
    """The one line with which a command refuses its arguments."""
    with pytest.raises(SystemExit) as left:
        main(list(arguments))
    errors = capsys.readouterr().err
    assert left.value.code == 2
    assert errors.count("\n") == 1
    return errors


@pytest.mark.parametrize("name", SUITES)
def test_a_suite_is_scored(name, result, capsys):
    data = result("evaluate", "--suite", name, "--policies", "sta,pd")
    assert set(data["results"]) == {"sta", "pd"}
    assert data["scenarios"] == [brief(scenario).to_dict() for scenario in suite(name)[:2]]
    for row in data["results"].values():
        assert row["failures"] == 0
        for axis in "xyz":
            assert 0.0 < row[f"max_error_{axis}"]["mean"] < 0.5
        assert {"pitch_error", "yaw_error", "roll", "thrust_effort"} <= set(row)
        assert "heading_error" not in row
    assert "error x + y + z" in " ".join(capsys.readouterr().out.split())


def test_scenarios_are_sampled_of_a_mode_under_its_conditions(result):
    chosen = ("--mode", "torpedo3d", "--episodes", "2", "--policies", "zero", "--seed", "3")
    first = result("evaluate", *chosen)
    assert [each["mode"] for each in first["scenarios"]] == ["torpedo3d"] * 2
    assert {each["conditions"]["thruster_limit"] for each in first["scenarios"]} == {40.0}
    assert result("evaluate", *chosen)["results"] == first["results"]
    rougher = result("evaluate", *chosen, "--conditions", "sea")["scenarios"][0]["conditions"]
    assert rougher["wave_limit"] == SPATIAL_PRESETS["sea"].wave_limit
    assert rougher["deflection_range"] == list(SPATIAL_PRESETS["sea"].deflection_range)
    fields = result("evaluate", *chosen, "--conditions", '{"current_limit": 0.2}')
    changed = fields["scenarios"][0]["conditions"]
    assert (changed["current_limit"], changed["thruster_limit"]) == (0.2, 40.0)


def test_conditions_replace_those_of_a_suite_by_the_presets_of_space(result):
    data = result("evaluate", "--suite", "operation3d", "--policies", "zero", "--conditions", "sea")
    for each in data["scenarios"]:
        assert each["conditions"]["thruster_limit"] == SPATIAL_PRESETS["sea"].thruster_limit
        assert len(each["water"]["waves"]) == 4


def test_a_file_of_scenarios_may_be_of_another_robot(tmp_path, result):
    path = tmp_path / "mine.json"
    scenarios = [brief(scenario).to_dict() for scenario in suite("operation3d-neutral")[:2]]
    path.write_text(json.dumps({"scenarios": scenarios}))
    data = result("evaluate", "--suite", str(path), "--policies", "pd")
    assert data["scenarios"] == scenarios
    read = selection.read_suite(str(path))
    assert {name_of(scenario.body) for scenario in read} == {"eely-neutral"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--suite", "operation3d", "--policies", "residual-ppo"), "robot is SpatialRobot("),
        (("--suite", "operation", "--policies", "residual-eely"), "robot is Robot("),
        (("--suite", "operation3D"), "suite is 'operation3D'; allowed: operation,"),
        (("--mode", "diving3d"), "invalid choice: 'diving3d'"),
        (("--mode", "operation3d", "--conditions", "calm"), "conditions is 'calm'; allowed: ideal"),
        (("--mode", "operation3d", "--conditions", '{"keel": 1}'), "keel is 1"),
    ],
)
def test_what_does_not_fit_gets_one_line(arguments, message, capsys):
    assert message in refused(capsys, "evaluate", *arguments)


def test_gains_are_tuned_in_space(tmp_path, monkeypatch, capsys):
    tuning = pytest.importorskip(
        "usm_baselines.benchmark.tuning", reason="the extra `tune` is not installed"
    )
    sample = tuning.sample_of
    monkeypatch.setattr(tuning, "sample_of", lambda *of: brief(sample(*of)))
    output = tmp_path / "pd.json"
    budget = ("--trials", "2", "--episodes", "1")
    main(["tune", "pd", "--mode", "operation3d", *budget, "--output", str(output)])
    data = json.loads(output.read_text())
    assert data["mode"] == "operation3d"
    assert data["conditions"]["thruster_limit"] == SPATIAL_PRESETS["field"].thruster_limit
    assert set(data["gains"]) == set(data["space"])
    for name, span in data["space"].items():
        assert span["low"] <= data["gains"][name] <= span["high"]
    said = capsys.readouterr().out
    assert "k_p = " in said
