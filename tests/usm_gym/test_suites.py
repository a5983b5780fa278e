"""The frozen suites: what they hold, where they come from, and that they stay as they are."""

import json
from pathlib import Path
from typing import Any

import pytest

from usm_gym import suite
from usm_gym.robots import EELY, PAPER, name_of
from usm_gym.suites import NAMES
from usm_gym.suites import __main__ as writer
from usm_gym.support.seeding import EVALUATION, TRAINING, TUNING, VALIDATION, stream
from usm_gym.task.conditions import PRESETS
from usm_gym.task.modes import presets_of
from usm_gym.task.sampling import named, sample


@pytest.mark.parametrize(
    ("name", "count", "mode", "preset", "robot"),
    [
        ("operation", 50, "operation", "field", PAPER),
        ("operation-ideal", 20, "operation", "ideal", PAPER),
        ("operation-basin", 50, "operation", "basin", PAPER),
        ("operation-sea", 50, "operation", "sea", PAPER),
        ("torpedo", 50, "torpedo", "field", PAPER),
        ("torpedo-sea", 50, "torpedo", "sea", PAPER),
        ("operation3d", 50, "operation3d", "field", EELY),
        ("operation3d-basin", 50, "operation3d", "basin", EELY),
        ("operation3d-sea", 50, "operation3d", "sea", EELY),
        ("operation3d-neutral", 50, "operation3d", "field", "eely-neutral"),
        ("torpedo3d", 50, "torpedo3d", "field", EELY),
    ],
)
def test_suites_are_as_documented(
    name: str, count: int, mode: str, preset: str, robot: str
) -> None:
    scenarios = suite(name)
    assert len(scenarios) == len(set(scenarios)) == count
    found = {(s.mode, s.conditions, name_of(s.body)) for s in scenarios}
    assert found == {(mode, presets_of(mode)[preset], robot)}


def test_the_suite_of_table_1_is_its_two_scenarios() -> None:
    assert suite("table1") == [named("table1", "operation"), named("table1", "torpedo")]


def test_a_suite_given_away_is_not_changed_by_its_user() -> None:
    suite("torpedo").clear()
    assert len(suite("torpedo")) == 50
    with pytest.raises(ValueError, match="operation-ideal"):
        suite("oepration")


def test_no_suite_holds_a_scenario_of_another_or_of_any_seed() -> None:
    frozen = [s for name in NAMES for s in suite(name)]
    assert len({s.noise_seed for s in frozen if s.noise_seed}) == len(frozen) - 2
    seeds = {s.noise_seed for s in frozen}
    paths = {s.path for s in frozen}
    for seed in (0, 1, writer.SEED):
        for purpose in (EVALUATION, TRAINING, TUNING, VALIDATION):
            for k in range(50):
                scenario = sample("operation", PRESETS["field"], stream(seed, purpose, k))
                assert scenario.noise_seed not in seeds
                assert scenario.path not in paths


@pytest.mark.parametrize("name", NAMES)
def test_suites_come_from_their_recorded_seed_bit_for_bit(name: str, tmp_path: Path) -> None:
    frozen = Path(writer.__file__).with_name(f"{name}.json")
    assert json.loads(frozen.read_text())["seed"] == writer.SEED
    assert writer.scenarios(name) == suite(name)
    writer.main(name, tmp_path)
    written = (tmp_path / frozen.name).read_text()
    assert written.count("\n") == frozen.read_text().count("\n")
    assert_within(json.loads(frozen.read_text()), json.loads(written))


def assert_within(frozen: Any, written: Any) -> None:
    """Assert equality, but for fields that are younger than the frozen file."""
    if isinstance(frozen, dict):
        assert frozen.keys() <= written.keys()
        for name, value in frozen.items():
            assert_within(value, written[name])
    elif isinstance(frozen, list):
        for one, other in zip(frozen, written, strict=True):
            assert_within(one, other)
    else:
        assert frozen == written


@pytest.mark.parametrize("name", [*NAMES, "another"])
def test_no_suite_is_written_twice(name: str) -> None:
    folder = Path(writer.__file__).parent
    before = {file: file.read_bytes() for file in folder.glob("*.json")}
    assert len(before) == len(NAMES)
    with pytest.raises(ValueError, match=name):
        writer.main(name)
    assert {file: file.read_bytes() for file in folder.glob("*.json")} == before
