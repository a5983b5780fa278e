"""The commands that compare policies, on episodes of a second."""

import csv
import json
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.episodes import short
from support.results import evaluation
from usm_baselines import gains, registry
from usm_baselines.benchmark import leaderboard as board
from usm_baselines.benchmark import leaderboard_page

from usm_cli.commands import leaderboard
from usm_cli.program import main
from usm_gym.suites import suite
from usm_gym.support.files import holding
from usm_gym.task.nominal import shared_nominal

ROOT = Path(__file__).parents[2]
SUITES = {board.MAIN: short(3), "other": short(2, seed=1)}
FAULTY = """
class Raising:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        raise RuntimeError("no\\nidea")
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(leaderboard, "suites", lambda: SUITES)
    monkeypatch.setattr(registry, "_entries", dict(registry._entries))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "raising.py").write_text(FAULTY)
    return tmp_path


def suite_file(path: Path, count: int, duration: float = 1.0) -> Path:
    scenarios = [each.to_dict() for each in short(count, duration)]
    path.write_text(json.dumps({"scenarios": scenarios}))
    return path


def read(path: Path) -> Any:
    return json.loads(path.read_text())


def test_every_suite_is_there_and_a_row_with_the_joints_still() -> None:
    chosen = board.suites()
    assert len(chosen) == 6
    assert chosen["table1"] == suite("table1")
    for moving, still in zip(chosen[board.MAIN], chosen[board.STILL], strict=True):
        assert moving.shifts
        assert not still.shifts
        assert still == replace(moving, conditions=still.conditions)


@pytest.mark.slow
def test_the_leaderboard_is_the_same_with_one_and_two_workers(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    documents = []
    (folder / "page.md").write_text(
        "before\n<!-- leaderboard -->\nold\n<!-- end of leaderboard -->\nafter\n"
    )
    for workers in ("1", "2"):
        options = ["--workers", workers, "--output", workers, "--insert", "page.md"]
        main(["leaderboard", "--policies", "zero,sta,pd", *options])
        documents.append(read(folder / workers / "leaderboard.json"))
        documents[-1].pop("provenance")
    assert documents[0] == documents[1]
    rows = documents[0]["suites"][board.MAIN]
    means = [row["max_error_x"]["mean"] + row["max_error_y"]["mean"] for row in rows.values()]
    assert means == sorted(means)
    assert "beats_next" not in list(rows.values())[-1]
    lines = list(csv.DictReader((folder / "1" / "leaderboard.csv").open()))
    assert len(lines) == 6
    assert float(lines[0]["max_error_x"]) == next(iter(rows.values()))["max_error_x"]["mean"]
    page = (folder / "page.md").read_text()
    assert page.startswith("before\n<!-- leaderboard -->\n| policy |")
    assert page.endswith("after\n")
    result = board.LeaderboardResult.read(folder / "1" / "leaderboard.json")
    assert page[7:-6] == leaderboard_page.readme_block(result)
    for figure in ("errors", "profiles", "variation"):
        assert (folder / "1" / f"{figure}.png").stat().st_size > 10_000
    capsys.readouterr()


def test_a_refused_policy_leaves_the_rest_of_the_leaderboard_complete(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(["leaderboard", "--policies", "zero,raising:Raising", "--output", "out"])
    assert left.value.code == 1
    errors = capsys.readouterr().err.splitlines()
    assert errors == ["usm: raising:Raising is refused: RuntimeError: no idea"]
    found = read(folder / "out" / "leaderboard.json")
    assert all(list(rows) == ["zero"] for rows in found["suites"].values())
    assert set(found["refused"]) == set(SUITES)
    text = (folder / "out" / "leaderboard.md").read_text()
    assert text.count("raising:Raising is refused: RuntimeError: no idea") == 2


def test_shipped_gains_are_registered_and_their_front_is_shown(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    from support.episodes import METRICS
    from usm_baselines.contender import contender

    from usm_gym.evaluation import Evaluation

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
    from support.episodes import METRICS
    from usm_baselines.contender import contender

    from usm_gym.evaluation import Evaluation

    order = ("lqg", "lqg-tuned", "sta-tuned", "pid-tuned", "sta", "pid")
    rows = board.ranked(
        [
            (contender(id), Evaluation({n: np.full(50, k) for n in METRICS}, np.zeros(50, bool)))
            for k, id in enumerate(order)
        ]
    )
    lines = leaderboard_page.brief_table(rows).splitlines()[2:]
    assert [line.split(" | ")[0] for line in lines] == [
        f"| {id}" for id in ("lqg", "sta-tuned", "pid-tuned", "sta")
    ]
    assert lines[1].endswith("| 2000 / 2000 | 2.00 | 0 |")


def test_readme_and_results_show_the_tables_of_the_leaderboard() -> None:
    made = ROOT / "results" / version("usm-gym") / "leaderboard.json"
    if not made.exists():
        pytest.skip("there is no leaderboard of this version yet")
    found = board.LeaderboardResult.read(made)
    assert made.with_suffix(".md").read_text(encoding="utf-8") == leaderboard_page.markdown(found)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert readme.count(leaderboard_page.MARKS[0]) == 1
    assert leaderboard_page.readme_block(found) in readme


def test_shipped_gains_can_be_made() -> None:
    nominal = shared_nominal(SUITES[board.MAIN])
    files = [*gains.TUNED.glob("*.json"), *gains.FRONT.glob("*.json")]
    budgets = set()
    for file in files:
        found = gains.read_gains(file)
        budgets.add(found.budget)
        registry.make(found.policy, nominal, **found.gains)
    assert len(budgets) <= 1  # the same for every policy


@pytest.mark.parametrize("second", ["pd", "results.json:pd"])
def test_compare_says_in_words_whether_the_data_decide(
    folder: Path, capsys: pytest.CaptureFixture[str], second: str
) -> None:
    scenarios = str(suite_file(folder / "suite.json", 50))
    main(["evaluate", "--policies", "zero,pd", "--suite", scenarios, "--output", "results.json"])
    capsys.readouterr()
    main(["compare", "results.json:zero", second, "--output", "compared.json"])
    lines = capsys.readouterr().out.replace("\n", " ")
    found = read(folder / "compared.json")["comparisons"]["max_error_x"]
    episodes = [
        np.array(row["per_episode"]["max_error_x"])
        for row in read(folder / "results.json")["results"].values()
    ]
    assert found["difference"] == pytest.approx((episodes[1] - episodes[0]).mean())
    assert found["decided"]
    assert f"the data decide: {second} is better than results.json:zero" in lines


def test_compare_draws_no_conclusion_from_few_episodes(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["compare", "zero", "pd", "--suite", str(suite_file(folder / "suite.json", 4))])
    assert "no conclusion: 4 episodes" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["compare", "zero", "zero"], "another policy than A"),
        (["compare", "zero", "nobody"], "nobody"),
        (["compare", "zero", "missing.json"], "missing.json"),
        (["compare", "zero", "suite.json"], "suite.json is no complete evaluation: kind is None"),
        (["compare", "results.json", "zero"], "results.json:zero, results.json:pd"),
        (["compare", "results.json:sta", "zero"], "results.json:zero, results.json:pd"),
        (["compare", "results.json:pd", "zero", "--seed", "1"], "--seed"),
        (["compare", "results.json:pd", "others.json:pd"], "the scenarios of A"),
        (["robustness", "--vary", "colour"], "colour"),
        (["robustness", "--vary", "noise", "--values", "much"], "--values"),
        (["robustness", "--vary", "model", "--values", "2"], "model is 2.0"),
        (["leaderboard", "--insert", "suite.json", "--policies", "zero"], "marks of the table"),
        (["leaderboard", "--time-limit", "0"], "time_limit is 0.0"),
        (["tune", "zero"], "zero"),
        (["tune", "sta", "--output", "missing/sta.json"], "missing"),
        (["evaluate", "--cluster", "nowhere:1"], "nowhere:1"),
    ],
)
def test_bad_input_gets_one_line_and_status_2(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], said: str
) -> None:
    for name, seed in (("results", 0), ("others", 1)):
        scenarios = tuple(short(1, seed=seed))
        evaluation("xy", ("zero", "pd"), scenarios).write(folder / f"{name}.json")
    suite_file(folder / "suite.json", 1)
    with pytest.raises(SystemExit) as left:
        main(arguments)
    errors = capsys.readouterr().err
    assert left.value.code == 2
    assert errors.count("\n") == 1
    assert said in errors


@pytest.mark.parametrize(
    ("arguments", "output"),
    [
        (["tune", "sta", "--output", "sta.json"], "sta.json"),
        (["leaderboard", "--policies", "zero", "--output", "out"], "out"),
        (["study", "residual", "--output", "out"], "out"),
    ],
)
def test_of_two_commands_on_one_output_the_second_gets_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], output: str
) -> None:
    if output == "out":
        (folder / output).mkdir()
    with holding(output), pytest.raises(SystemExit, match="2"):
        main(arguments)
    assert capsys.readouterr().err == f"usm: error: {output} is in use by another command\n"


def test_the_help_says_that_a_cluster_runs_code(capsys: pytest.CaptureFixture[str]) -> None:
    main(["evaluate", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert "Ray runs the code of whoever can reach it" in text
