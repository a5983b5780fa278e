"""The leaderboard: its suites, its order, and the tables that are published."""

import json
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.episodes import METRICS, short
from support.results import PROVENANCE
from support.tiers import register_with_tiers
from usm_baselines import registry
from usm_baselines.benchmark import leaderboard as board
from usm_baselines.benchmark import leaderboard_page
from usm_baselines.benchmark.scoring import Job, Refusal
from usm_baselines.benchmark.verdict import choices, front
from usm_baselines.contender import contender
from usm_baselines.gains import FOLDERS

from usm_cli.commands.leaderboard import decision_times
from usm_gym.evaluation import Evaluation, metric_names
from usm_gym.planar_world import PlanarWorld
from usm_gym.robot import Robot
from usm_gym.statistics import compare
from usm_gym.suites import NAMES, suite
from usm_gym.task.nominal import shared_nominal

ROOT = Path(__file__).parents[3]
SUITES = {board.PLANE.main: short(3), "other": short(2, seed=1)}


def test_every_suite_is_on_one_board() -> None:
    suites = [which.suites() for which in board.BOARDS]
    listed = [name for chosen in suites for name in chosen]
    assert sorted(listed) == sorted([*NAMES, board.PLANE.still, board.SPACE.still])
    plane, space, head, _ = suites
    assert plane["table1"] == suite("table1")
    assert space["torpedo3d"] == suite("torpedo3d")
    assert list(head) == ["head", "head-basin"]


@pytest.mark.parametrize("which", [board.PLANE, board.SPACE])
def test_a_board_has_a_row_with_the_joints_still(which: board.Board) -> None:
    chosen = which.suites()
    for moving, still in zip(chosen[which.main], chosen[which.still], strict=True):
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
    nominal = shared_nominal(SUITES[board.PLANE.main])
    tuned: Any = registry.make("mine-tuned", nominal)
    assert tuned.gains.k_p == 3.0
    assert "9 trials of 8 episodes" in registry.entry("mine-tuned").summary
    fronts = board.front()
    made: list[Any] = [each.make(nominal) for each in fronts["mine"]]
    assert [each.gains.k_p for each in made] == [0.001, 0.01]
    places = board.places([], fronts, SUITES)
    assert [place.suite for place in places] == [board.PLANE.main] * 2


def test_policies_meet_the_suites_that_they_are_meant_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    register_with_tiers(monkeypatch, tmp_path, "mine")
    chosen = {name: suite(name)[:1] for name in NAMES}
    mine = [
        (place.suite, place.job.contender.name)
        for place in board.places(None, {}, chosen)
        if place.job.contender.name in ("mine-tuned", "mine-basin", "mine-sea")
    ]
    assert mine == [
        ("operation", "mine-tuned"),
        ("operation-ideal", "mine-tuned"),
        ("operation-basin", "mine-basin"),
        ("operation-sea", "mine-sea"),
        ("torpedo", "mine-tuned"),
        ("torpedo-sea", "mine-sea"),
        ("table1", "mine-tuned"),
    ]
    named = board.places([contender("mine-sea")], {}, chosen)
    assert [place.suite for place in named] == list(NAMES)


def test_a_law_is_one_whatever_its_gains() -> None:
    for id in ("lqg-joints", *(f"lqg-joints-{suffix}" for suffix in FOLDERS)):
        assert registry.law_of(id) == "lqg-joints"
        assert registry.base_of(id) == "lqg-joints"
    assert registry.base_of("sta-navigator-basin") == registry.base_of("sta-lag-tuned") == "sta"


@pytest.mark.parametrize("which", board.BOARDS)
def test_a_result_knows_its_board_and_its_tiers(which: board.Board) -> None:
    result = made_up({"pd": ""}, (which.main, f"{which.main}-basin"))
    assert result.board == which
    assert list(result.tiers) == ["field", "basin"]
    assert result.tiers["field"] == result.main


def made_up(
    tuned: dict[str, str], suites: tuple[str, ...], names: Sequence[str] = METRICS
) -> board.LeaderboardResult:
    """Return a leaderboard of policies with their tiers; the second loses one of two robots."""
    scored: list[tuple[board.Place, Evaluation | Refusal]] = []
    for name in suites:
        scenarios = tuple(short(2))
        for number, (id, tier) in enumerate(tuned.items()):
            policy = replace(contender("pd"), name=id, tuned_for=tier)
            job = Job(policy, scenarios, shared_nominal(scenarios))
            errors = 1e-3 * (1 + number) * np.ones(2)
            lost = np.array([False, number == 1])
            errors[lost] = 0.5
            scored.append((board.Place(name, job), Evaluation(dict.fromkeys(names, errors), lost)))
    return board.leaderboard(scored, {}, "9", PROVENANCE)


GAINS = {"pd-tuned": "field", "pd-basin": "basin", "pd-sea": "sea"}
CROSSED = ("operation", "operation-basin", "operation-sea")


def test_gains_of_every_tier_in_every_tier_make_a_cross_table() -> None:
    result = made_up(GAINS, CROSSED)
    lines = leaderboard_page.cross_table(result).splitlines()
    assert lines[0] == "| law | tuned for | operation | operation-basin | operation-sea |"
    assert [line.split(" | ")[:3] for line in lines[2:]] == [
        ["| pd", "field", "1.00 / 1.00, 0 lost"],
        ["| pd", "basin", "251 / 251, 1 (50 %) lost"],
        ["| pd", "sea", "3.00 / 3.00, 0 lost"],
    ]
    assert leaderboard_page.cross_table(result) in leaderboard_page.markdown(result)
    for less in (made_up(GAINS, CROSSED[:2]), made_up({"pd-tuned": "field"}, CROSSED)):
        assert leaderboard_page.cross_table(less) == ""
        assert "across tiers" not in leaderboard_page.markdown(less)


def test_where_robots_are_lost_a_table_has_medians_and_their_share() -> None:
    rows = made_up(GAINS, CROSSED).main
    head, _, first, _, last, *_ = leaderboard_page.table(rows).splitlines()
    cells = [dict(zip(head.split(" | "), line.split(" | "), strict=True)) for line in (first, last)]
    assert [each["median x / y"] for each in cells] == ["1.00 / 1.00", "251 / 251"]
    assert [each["lost"] for each in cells] == ["0", "1 (50 %)"]
    assert "median" not in leaderboard_page.table(made_up({"pd": ""}, CROSSED).main)


def test_scans_have_a_table_of_errors_by_shift() -> None:
    names = metric_names(PlanarWorld(Robot()), by_shift=True)
    result = made_up({"pd": ""}, ("operation",), names)
    lines = leaderboard_page.shift_table(result.main).splitlines()
    assert lines[0] == "| policy | first | third | fifth | last |"
    assert lines[2] == "| pd |" + " 1.00 / 1.00 |" * 4
    assert leaderboard_page.shift_table(result.main) in leaderboard_page.markdown(result)
    assert "first_shift_error_x" in leaderboard_page.csv_text(result).splitlines()[0].split(",")


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


def made_up_rows(variation: dict[str, float]) -> dict[str, board.Standing]:
    """Rows of policies by their thrust variation, N/s, each with a larger error than the last."""
    scored = []
    for k, (id, thrust) in enumerate(variation.items()):
        scores = {name: np.full(50, 1e-3 * (1 + k)) for name in METRICS}
        scores["thrust_variation"] = np.full(50, thrust)
        scored.append((contender(id), Evaluation(scores, np.zeros(50, bool))))
    return board.ranked(scored)


def test_of_each_law_there_are_the_better_gains_the_calmer_ones_and_those_of_the_paper() -> None:
    order = ("lqg", "lqg-tuned", "sta-lag", "sta-tuned", "pid-tuned", "sta", "pid")
    rows = made_up_rows(dict.fromkeys(order, 1.0) | {"pid": 0.5, "lqg-tuned": 2.0})
    assert list(board.best_of_laws(rows)) == ["lqg", "sta-lag", "pid-tuned", "sta", "pid"]
    lines = leaderboard_page.brief_table(rows).splitlines()[2:]
    assert [line.split(" | ")[1] for line in lines] == list(order)


def test_a_verdict_names_the_best_of_each_kind_and_what_could_be_reached() -> None:
    thrust = {"lqg-joints": 30.0, "indi": 40.0, "sta-lag-tuned": 50.0, "pid": 20.0, "sta": 200.0}
    rows = made_up_rows({"informed": 35.0, **thrust})
    found = choices(rows)
    assert list(found) == [*thrust, "informed"]
    assert found["lqg-joints"] == ["best overall", "best without learning"]
    assert found["indi"] == ["best without the joint references"]
    assert found["sta-lag-tuned"] == ["the paper's law, best gains"]
    assert found["pid"] == ["best with at most 20 N/s"]
    assert found["sta"] == ["the paper's law and gains"]
    # Nobody is ahead of these in error and in thrust variation.
    assert front(rows) == ["pid", "lqg-joints"]
    lines = leaderboard_page.verdict_table(rows, {"pid": 12.3}).splitlines()[2:]
    cells = lines[3].split(" | ")
    assert cells[1:3] == ["`pid`", "best with at most 20 N/s"]
    assert cells[3:] == [f"{5.0 * len(rows['pid'].axes):.1f} ± 0.0", "20.0", "12.3 |"]


def test_going_down_rows_share_a_rank_until_the_data_tell_one_from_the_first_of_them() -> None:
    rng = np.random.default_rng(0)

    def scores(error: float, noise: float) -> Evaluation:
        drawn = rng.standard_normal(50)
        episodes = error + noise * (drawn - drawn.mean())
        return Evaluation(dict.fromkeys(METRICS, episodes), np.zeros(50, bool))

    # The noise of the last but one hides that it is worse than any row but the first.
    ids = ("lqg", "pid", "ladrc", "smc", "dob", "indi", "gsta")
    errors = (1.0, 2.0, 2.001, 2.002, 2.1, 2.9, 4.0)
    noise = (0.05, 0.05, 0.05, 0.05, 0.05, 5.0, 0.05)
    pairs = [(contender(id), scores(*each)) for id, *each in zip(ids, errors, noise, strict=True)]
    seer = replace(contender("zero"), name="seer", privileged=True)
    rows = board.ranked([*pairs, (seer, scores(0.5, 0.0))])
    labels = leaderboard_page.rank_labels(rows)
    assert list(labels.values()) == ["1", "2=", "2=", "2=", "5=", "5=", "7", ""]
    places = [int(label.rstrip("=")) for label in labels.values() if label]
    assert places == sorted(places)
    tied = compare(rows["pid"].objectives, rows["indi"].objectives)
    assert not tied.decided  # and yet they share no rank


def test_readme_and_results_show_the_tables_of_the_leaderboard() -> None:
    made = ROOT / "results" / version("usm-gym") / "leaderboard.json"
    if not made.exists():
        pytest.skip("there is no leaderboard of this version yet")
    found = board.LeaderboardResult.read(made)
    assert made.with_suffix(".md").read_text(encoding="utf-8") == leaderboard_page.markdown(found)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme.count(leaderboard_page.MARKS[0]) == 1
    figure = f"results/{version('usm-gym')}/verdict.svg"
    decisions = decision_times(made.parent)
    assert leaderboard_page.readme_block(found, figure, decisions) in readme
    assert (ROOT / figure).exists()
