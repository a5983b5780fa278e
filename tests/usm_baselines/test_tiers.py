"""Policies with gains for a tier are there, and are scored where they are meant to be."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.tiers import TIERS, gains_file, register_with_tiers
from usm_baselines import registry
from usm_baselines.contender import contender
from usm_baselines.gains import FOLDERS
from usm_baselines.tiers import PAPER, meant_for, short_list, tier_of

from usm_gym.support.validation import UsageError
from usm_gym.task.conditions import PRESETS, SPATIAL_PRESETS, Conditions
from usm_gym.task.modes import presets_of
from usm_gym.task.sampling import named


@pytest.fixture(autouse=True)
def _tiers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    register_with_tiers(monkeypatch, tmp_path, "mine")


def test_gains_of_every_tier_are_registered_under_its_name() -> None:
    nominal = named("nominal", "operation").nominal
    assert registry.ids()[-7:] == ["mine", *(f"mine-{suffix}" for suffix in FOLDERS)]
    for gain, (suffix, tier) in enumerate(zip(FOLDERS, TIERS, strict=True), start=1):
        policy: Any = registry.make(f"mine-{suffix}", nominal)
        assert policy.gains.k_p == gain
        assert registry.entry(f"mine-{suffix}").tuned_for == tier
        assert contender(f"mine-{suffix}").tuned_for == tier
    assert registry.entry("mine").tuned_for == contender("mine").tuned_for == ""


def test_a_file_says_for_what_its_gains_are_tuned(tmp_path: Path) -> None:
    for tier in ("basin", None):
        file = gains_file(tmp_path / "own.json", "mine", tier, k_p=1.0)
        assert contender(f"mine@{file}").tuned_for == (tier or "")
    file.write_text(file.read_text()[:-1] + ', "conditions": {"position_period": 0}}')
    with pytest.raises(UsageError, match="position_period is 0"):
        contender(f"mine@{file}")


def test_a_tier_is_for_its_own_policies_the_papers_and_those_that_see_the_truth() -> None:
    for tier in ("basin", "sea"):
        chosen = meant_for(PRESETS[tier])
        assert {*PAPER, "oracle", f"mine-{tier}"} <= set(chosen)
        assert not {"mine", "mine-tuned", "zero", "pid", "pid-tuned"} & set(chosen)
        assert all(
            registry.entry(id).tuned_for == tier or registry.entry(id).privileged or id in PAPER
            for id in chosen
        )


def test_in_space_policies_are_for_the_robot_there() -> None:
    field = meant_for(SPATIAL_PRESETS["field"], "operation3d")
    assert {*PAPER, "mine-eely"} <= set(field)
    assert not {"mine", "mine-tuned", "mine-basin", "mine-eely-sea"} & set(field)
    assert meant_for(replace(SPATIAL_PRESETS["field"], thruster_limit=9.0), "torpedo3d") == field
    assert "mine-eely-sea" in meant_for(SPATIAL_PRESETS["sea"], "operation3d")


@pytest.mark.parametrize(
    "conditions", [PRESETS["field"], PRESETS["ideal"], Conditions(thruster_limit=9.0)]
)
def test_all_other_conditions_are_for_all_but_policies_of_tiers(conditions: Conditions) -> None:
    assert tier_of(conditions) == "field"
    left_out = [id for id in registry.ids() if id not in meant_for(conditions)]
    others = [tier for tier in TIERS if tier != "field"]
    entries = [registry.entry(id) for id in left_out]
    assert all(entry.tuned_for in others or entry.moves_joints for entry in entries)
    assert {"mine-basin", "mine-sea"} <= set(left_out)


@pytest.mark.parametrize("mode", ["head", "head3d"])
@pytest.mark.parametrize("conditions", ["field", "basin"])
def test_laws_for_the_head_are_meant_for_it_alone_with_gains_that_fit(mode, conditions) -> None:
    preset = presets_of(mode)[conditions]
    laws = {id for id in registry.ids() if registry.entry(id).moves_joints}
    meant = set(meant_for(preset, mode))
    fitting = ("", tier_of(preset, mode))
    assert meant == {id for id in laws if registry.entry(id).tuned_for in fitting}
    gains = {"field": ("tuned", "eely"), "basin": ("basin", "eely-basin")}[conditions]
    assert f"rates-sta-{gains[mode == 'head3d']}" in meant
    assert {"rates-sta", "whole-lqg-joints"} <= set(short_list(preset, mode)) < meant
    for other in ("operation", "operation3d"):
        assert not laws & set(meant_for(presets_of(other)[conditions], other))  # type: ignore[arg-type]
