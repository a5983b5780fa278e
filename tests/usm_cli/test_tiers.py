"""By default, conditions of a tier bring their own suite and the policies that are meant for it."""

import json
from argparse import Namespace
from dataclasses import replace

import pytest
import usm_agents  # noqa: F401 (registers the shipped agents)
import usm_baselines
from support.tiers import register_with_tiers
from usm_baselines import registry

from usm_cli import selection
from usm_cli.program import main
from usm_gym.suites import suite, unseen
from usm_gym.task.modes import presets_of


@pytest.fixture
def chosen(tmp_path, monkeypatch):
    """Return what an evaluation of a scenario of the chosen suite writes; the laws are made up."""
    register_with_tiers(monkeypatch, tmp_path, "mine")
    monkeypatch.setattr(selection, "suite", lambda name: suite(name)[:1])
    monkeypatch.setenv("COLUMNS", "120")
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


@pytest.mark.parametrize("width", [80, 120])
def test_tables_of_scans_are_readable(width, chosen, monkeypatch, capsys):
    of_body = (id for id in usm_baselines.ids() if not registry.entry(id).moves_joints)
    longest = max((id for id in of_body if "basin" in id), key=len)
    monkeypatch.setenv("COLUMNS", str(width))
    chosen("--suite", "operation-basin", "--policies", f"{longest},pd-navigator-basin")
    said = capsys.readouterr().out
    assert said.count(longest) >= 2
    assert "…" not in said
    assert max(map(len, said.splitlines())) <= width


def test_the_short_list_has_competitors_and_all_has_them_all():
    for mode, tier in (("operation", "field"), ("operation", "basin"), ("operation3d", "field")):
        (scenario,) = unseen(mode, presets_of(mode)[tier], 0, 1)
        everyone = [each.name for each in selection.chosen_contenders("all", scenario)]
        short = [each.name for each in selection.chosen_contenders(None, scenario)]
        assert {"sta", "pd"} <= set(short) <= set(everyone)
        assert not any(registry.entry(id).privileged for id in everyone)
        more = selection.chosen_contenders("oracle,all,sta", scenario)
        assert [each.name for each in more] == ["oracle", *everyone]


@pytest.mark.parametrize(("policies", "given", "workers"), [(2, None, 1), (40, None, 4), (2, 3, 3)])
def test_the_cores_are_used_where_there_is_enough_to_do(policies, given, workers, monkeypatch):
    used = []
    monkeypatch.setattr(selection, "cpu_count", lambda: 4)
    monkeypatch.setattr(selection, "score_all", lambda jobs, workers, *rest: used.append(workers))
    scenarios = suite("operation")
    jobs = selection.jobs([selection.named("pd")] * policies, scenarios, 1.0)
    selection.scored(jobs, Namespace(workers=given, cluster=None))
    assert used == [workers]


def test_a_suite_of_ones_own_choice_keeps_its_joint_motion(chosen):
    options = ("--policies", "zero", "--suite", "torpedo", "--conditions", "sea")
    assert chosen(*options)["suite"] == "torpedo"
    assert chosen("--policies", "zero", "--conditions", "ideal")["suite"] == "operation"


def test_the_list_of_policies_says_for_what_they_are_tuned(tmp_path, monkeypatch, capsys):
    register_with_tiers(monkeypatch, tmp_path, "mine")
    main(["policies"])
    listed = capsys.readouterr().out
    assert "Others:" in listed
    assert "also: mine-tuned, mine-basin, mine-sea" in listed
    for gains, tier in (("tuned", "field"), ("basin", "basin"), ("sea", "sea")):
        assert f"NAME-{gains}: with gains tuned for {tier}" in listed
