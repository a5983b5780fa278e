"""The gains that are shipped."""

import json

import pytest
from usm_baselines import gains, registry, tiers
from usm_baselines.space import in_mode

from usm_gym.suites import suite
from usm_gym.task.conditions import IN_SPACE

# By tier, in space with "3d" behind it, the folder of its gains.
FOLDERS = {
    "field": ".",
    "basin": "basin",
    "sea": "sea",
    "field3d": "eely",
    "basin3d": "eely/basin",
    "sea3d": "eely/sea",
}
TIERS = {tier: sorted((gains.TUNED / folder).glob("*.json")) for tier, folder in FOLDERS.items()}
TIERS["field"] += sorted(gains.FRONT.glob("*.json"))
FILES = sorted(file for files in TIERS.values() for file in files)
# Nearer to an end of its range than this share of it, a gain is one that the range has chosen.
MARGIN = 0.05


def test_shipped_gains_can_be_made() -> None:
    for tier, files in TIERS.items():
        space = tier[len(tier.removesuffix(IN_SPACE)) :]
        of_body, of_head = (suite(name + space)[0].nominal for name in ("operation", "head"))
        for file in files:
            found = gains.read_gains(file)
            steers = registry.entry(found.policy).moves_joints
            registry.make(found.policy, of_head if steers else of_body, **found.gains)


def test_every_tier_has_gains() -> None:
    assert set(FOLDERS) == {"field", *tiers.TIERS}
    assert set(FOLDERS.values()) == {folder or "." for folder in gains.FOLDERS.values()}
    assert all(TIERS.values())


# The search for gains of a law for the head has fewer episodes; in every second of them the vehicle
# reacts later.
HEAD_EPISODES = 16
# Laws whose episodes take up to ten times as long as others: in space, the search of "field" is too
# long for them, and they have that of the other tiers.
SLOW = {"adaptive", "informed", "mpc"}


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
        if registry.entry(each["policy"]).moves_joints:
            assert each["mode"] == ("head3d" if tier.endswith(IN_SPACE) else "head")
            each["mode"] = "operation" + tier[len(tier.removesuffix(IN_SPACE)) :]
            assert each["budget"]["episodes"] == HEAD_EPISODES
            each["budget"]["episodes"] = 50 if tier.startswith("field") else HEAD_EPISODES
        if tier == "field3d" and each["policy"] in SLOW:
            assert each["budget"] == {"trials": 96, "episodes": 16}
            each["budget"] = {"trials": 160, "episodes": 50}
    assert len({json.dumps({name: each[name] for name in kept}) for each in said}) <= 1


# Laws for conditions in which positions are late or rare, or the robot is unknown.
BEYOND_FIELD = {"sta-navigator", "pd-navigator", "pid-navigator", "smc-navigator"}
BEYOND_FIELD |= {"adaptive", "informed", "mpc-limits"}
BEYOND_FIELD |= {f"{law}-{body}" for law in ("rates", "whole") for body in ("adaptive", "informed")}
BEYOND_FIELD |= {"rates-oracle"}


def test_every_law_has_shipped_gains() -> None:
    laws = {id for id in registry.ids() if registry.entry(id).space}
    shipped = {file.stem for file in gains.TUNED.glob("*.json")}
    assert shipped == laws - BEYOND_FIELD


def test_laws_have_gains_in_space_that_have_some_in_the_plane() -> None:
    for tier in ("field", "basin", "sea"):
        plane, space = ({file.stem for file in TIERS[each]} for each in (tier, tier + IN_SPACE))
        assert space <= plane | BEYOND_FIELD


@pytest.mark.parametrize(
    ("tier", "file"),
    [(tier, file) for tier, files in TIERS.items() for file in files],
    ids=lambda part: part if isinstance(part, str) else part.stem,
)
def test_no_shipped_gain_lies_at_an_end_of_its_range(tier, file) -> None:
    found = gains.read_gains(file)
    mode = "operation3d" if tier.endswith(IN_SPACE) else "operation"
    space = in_mode(registry.entry(found.policy).space, mode)
    assert set(found.gains) == set(space)
    for name, span in space.items():
        assert MARGIN < span.place(found.gains[name]) < 1.0 - MARGIN, name
