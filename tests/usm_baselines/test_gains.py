"""The gains that are shipped."""

import json

import pytest
from usm_baselines import gains, registry

from usm_gym.suites import suite

TIERS = {
    "field": [*gains.TUNED.glob("*.json"), *gains.FRONT.glob("*.json")],
    "basin": [*(gains.TUNED / "basin").glob("*.json")],
    "sea": [*(gains.TUNED / "sea").glob("*.json")],
}
FILES = sorted(file for files in TIERS.values() for file in files)
# Nearer to an end of its range than this share of it, a gain is one that the range has chosen.
MARGIN = 0.05


def test_shipped_gains_can_be_made() -> None:
    nominal = suite("operation")[0].nominal
    for file in FILES:
        found = gains.read_gains(file)
        registry.make(found.policy, nominal, **found.gains)


@pytest.mark.parametrize("tier", TIERS)
def test_every_law_was_tuned_as_long_as_every_other_and_for_the_same(tier) -> None:
    kept = ("budget", "weight", "mode", "provenance")
    assert {gains.read_gains(file).tuned_for for file in TIERS[tier]} <= {tier}
    said = [json.loads(file.read_text(encoding="utf-8")) for file in TIERS[tier]]
    for each in said:
        each["budget"] = {name: each["budget"][name] for name in ("trials", "episodes")}
        each["provenance"] = each["provenance"]["seeds"]
        if (gains.FRONT / f"{each['policy']}-{each['weight']}.json").exists():
            each["weight"] = 0.002
    assert len({json.dumps({name: each[name] for name in kept}) for each in said}) <= 1


# Laws for conditions in which positions are late or rare, or the robot is unknown.
BEYOND_FIELD = {"sta-navigator", "pd-navigator", "pid-navigator", "smc-navigator"}
BEYOND_FIELD |= {"adaptive", "informed", "mpc-limits"}


def test_every_law_has_shipped_gains() -> None:
    laws = {id for id in registry.ids() if registry.entry(id).space}
    assert {file.stem for file in gains.TUNED.glob("*.json")} == laws - BEYOND_FIELD


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}-{file.stem}")
def test_no_shipped_gain_lies_at_an_end_of_its_range(file) -> None:
    found = gains.read_gains(file)
    space = registry.entry(found.policy).space
    assert set(found.gains) == set(space)
    for name, span in space.items():
        assert MARGIN < span.place(found.gains[name]) < 1.0 - MARGIN, name
