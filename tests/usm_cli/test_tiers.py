"""By default, conditions of a tier bring their own suite and the policies that are meant for it."""

import json
import re
from dataclasses import replace

import pytest
import usm_agents  # noqa: F401 (registers the shipped agents)
import usm_baselines
from rich.console import Console
from support.tiers import register_with_tiers

from usm_cli import selection
from usm_cli.commands import evaluate, policies
from usm_cli.program import main
from usm_gym.suites import suite


@pytest.fixture
def chosen(tmp_path, monkeypatch):
    """Return what an evaluation of a scenario of the chosen suite writes; the laws are made up."""
    register_with_tiers(monkeypatch, tmp_path, "mine")
    monkeypatch.setattr(selection, "suite", lambda name: suite(name)[:1])
    output = tmp_path / "result.json"

    def evaluated(*arguments):
        main(["evaluate", *arguments, "--output", str(output)])
        return json.loads(output.read_text())

    return evaluated


def test_a_tier_brings_its_suite_and_its_policies(chosen, capsys, monkeypatch):
    data = chosen("--conditions", "basin")
    assert (data["suite"], data["conditions_override"]) == ("operation-basin", "basin")
    assert data["scenarios"] == [suite("operation-basin")[0].to_dict()]
    assert {"sta", "pd", "mine-basin"} <= set(data["results"])
    assert all(name in ("sta", "pd") or name.endswith("-basin") for name in data["results"])
    row = data["results"]["mine-basin"]
    assert row["tuned_for"] == "basin"
    assert "tuned_for" not in data["results"]["sta"]
    episode = row["per_episode"]["last_shift_error_y"]
    assert row["last_shift_error_y"]["mean"] == row["last_shift_error_y"]["median"] == episode[0]
    said = capsys.readouterr().out
    assert "median" in said
    assert "fifth" in said
    again = chosen("--suite", "operation-basin", "--policies", "sta")
    assert again["results"]["sta"] == data["results"]["sta"]
    brief = replace(suite("operation-basin")[0], duration=22.0)
    monkeypatch.setattr(selection, "suite", lambda name: [brief])
    assert list(chosen("--suite", "operation-basin")["results"]) == list(data["results"])


def test_tables_of_scans_are_readable_on_120_columns(chosen, tmp_path):
    longest = max((id for id in usm_baselines.ids() if "basin" in id), key=len)
    chosen("--suite", "operation-basin", "--policies", f"{longest},pd-navigator-basin")
    result = evaluate.EvaluationResult.read(tmp_path / "result.json")
    for table in (evaluate.table(result), evaluate.shift_table(result)):
        console = Console(width=120, highlight=False)
        with console.capture() as capture:
            console.print(table)
        assert longest in capture.get()
        assert "…" not in capture.get()


def test_a_suite_of_ones_own_choice_keeps_its_joint_motion(chosen):
    options = ("--policies", "zero", "--suite", "torpedo", "--conditions", "sea")
    assert chosen(*options)["suite"] == "torpedo"
    assert chosen("--policies", "zero", "--conditions", "ideal")["suite"] == "operation"


def test_the_list_of_policies_says_for_what_they_are_tuned(tmp_path, monkeypatch, capsys):
    register_with_tiers(monkeypatch, tmp_path, "mine")
    monkeypatch.setattr(policies, "output_console", lambda: Console(width=200))
    main(["policies"])
    listed = capsys.readouterr().out
    for gains, tier in (("tuned", "field"), ("basin", "basin"), ("sea", "sea")):
        assert re.search(rf"mine-{gains} +mine, tuned for {tier} in", listed)
