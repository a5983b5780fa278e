"""The leaderboard: its suites, its order, and the tables that are published."""

import json
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.episodes import METRICS, short
from usm_baselines import registry
from usm_baselines.benchmark import leaderboard as board
from usm_baselines.benchmark import leaderboard_page
from usm_baselines.contender import contender

from usm_gym.evaluation import Evaluation
from usm_gym.suites import suite
from usm_gym.task.nominal import shared_nominal

ROOT = Path(__file__).parents[3]
SUITES = {board.MAIN: short(3), "other": short(2, seed=1)}


def test_every_suite_is_there_and_a_row_with_the_joints_still() -> None:
    chosen = board.suites()
    assert len(chosen) == 6
    assert chosen["table1"] == suite("table1")
    for moving, still in zip(chosen[board.MAIN], chosen[board.STILL], strict=True):
        assert moving.shifts
        assert not still.shifts
        assert still == replace(moving, conditions=still.conditions)


def test_shipped_gains_are_registered_and_their_front_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path
    monkeypatch.setattr(registry, "_entries", dict(registry._entries))
    monkeypatch.setattr(registry, "TUNED", folder)
    monkeypatch.setattr(board, "FRONT", folder / "front")
    (folder / "front").mkdir()
    data = {"policy": "mine", "gains": {"k_p": 3.0}, "budget": {"trials": 9, "episodes": 8}}
    (folder / "mine.json").write_text(json.dumps({**data, "weight": 0.002}))
    for weight in (0.01, 0.001):
        text = json.dumps({**data, "gains": {"k_p": weight}, "weight": weight})
        (folder / "front" / f"mine-{weight}.json").write_text(text)
    registry.register("mine", registry.entry("pd").factory, "mine")
    assert registry.ids()[-2:] == ["mine", "mine-tuned"]
    nominal = shared_nominal(SUITES[board.MAIN])
    tuned: Any = registry.make("mine-tuned", nominal)
    assert tuned.gains.k_p == 3.0
    assert "9 trials of 8 episodes" in registry.entry("mine-tuned").summary
    fronts = board.front()
    made: list[Any] = [each.make(nominal) for each in fronts["mine"]]
    assert [each.gains.k_p for each in made] == [0.001, 0.01]
    places = board.places([], fronts, SUITES)
    assert [place.suite for place in places] == [board.MAIN] * 2


def test_a_policy_that_is_no_competitor_comes_last_and_says_so() -> None:
    def scores(error: float) -> Evaluation:
        return Evaluation({name: np.full(50, error) for name in METRICS}, np.zeros(50, bool))

    seer = replace(contender("zero"), name="seer", privileged=True)
    pairs = [
        (seer, scores(1e-6)),
        (contender("pd"), scores(2e-3)),
        (contender("sta"), scores(1e-3)),
    ]
    rows = board.ranked(pairs)
    assert list(rows) == ["sta", "pd", "seer"]
    assert rows["sta"].beats_next is not None
    assert rows["sta"].beats_next.decided
    assert rows["pd"].beats_next is None
    table = leaderboard_page.table(rows)
    assert "| seer (no competitor) |" in table
    assert "| yes (1.00) |" in table


def test_the_short_table_has_of_each_law_the_better_gains_and_those_of_the_paper() -> None:
    order = ("lqg", "lqg-tuned", "sta-lag", "sta-tuned", "pid-tuned", "sta", "pid")
    rows = board.ranked(
        [
            (contender(id), Evaluation({n: np.full(50, k) for n in METRICS}, np.zeros(50, bool)))
            for k, id in enumerate(order)
        ]
    )
    lines = leaderboard_page.brief_table(rows).splitlines()[2:]
    assert [line.split(" | ")[1] for line in lines] == ["lqg", "sta-lag", "pid-tuned", "sta"]
    assert lines[1].endswith(
        "| lag | 2000 [2000, 2000] | 2000 [2000, 2000] "
        "| 2000 / 2000 | 2000 / 2000 | 115 | 2.00 | 0 |"
    )


def test_rows_that_the_data_do_not_tell_from_the_first_share_its_rank() -> None:
    rng = np.random.default_rng(0)

    def scores(error: float, noise: float) -> Evaluation:
        episodes = error + noise * rng.standard_normal(50)
        return Evaluation(dict.fromkeys(METRICS, episodes), np.zeros(50, bool))

    ids = ("lqg", "pid", "ladrc", "smc", "gsta")
    errors = (1.0, 2.0, 2.001, 2.002, 3.0)
    pairs = [(contender(id), scores(e, 0.05)) for id, e in zip(ids, errors, strict=True)]
    seer = replace(contender("zero"), name="seer", privileged=True)
    rows = board.ranked([*pairs, (seer, scores(0.5, 0.0))])
    assert {id: rows[id].rank for id in ids} == dict(zip(ids, (1, 2, 2, 2, 5), strict=True))
    assert rows["seer"].rank is None
    labels = leaderboard_page.rank_labels(rows)
    assert [labels[id] for id in (*ids, "seer")] == ["1", "2=", "2=", "2=", "5", ""]


def test_readme_and_results_show_the_tables_of_the_leaderboard() -> None:
    made = ROOT / "results" / version("usm-gym") / "leaderboard.json"
    if not made.exists():
        pytest.skip("there is no leaderboard of this version yet")
    found = board.LeaderboardResult.read(made)
    assert made.with_suffix(".md").read_text(encoding="utf-8") == leaderboard_page.markdown(found)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme.count(leaderboard_page.MARKS[0]) == 1
    assert leaderboard_page.readme_block(found) in readme
