"""The commands that compare policies, on episodes of a second."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.episodes import short
from support.results import evaluation
from usm_baselines import registry
from usm_baselines.benchmark import leaderboard as board
from usm_baselines.benchmark import leaderboard_page

from usm_cli.program import main
from usm_gym.support.files import holding

ROOT = Path(__file__).parents[2]
SUITES = {board.PLANE.main: short(3), "other": short(2, seed=1)}
FAULTY = """
class Raising:
    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        raise RuntimeError("no\\nidea")
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(board.Board, "suites", lambda self: SUITES)
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
    rows = documents[0]["suites"][board.PLANE.main]
    means = [row["max_error_x"]["mean"] + row["max_error_y"]["mean"] for row in rows.values()]
    assert means == sorted(means)
    assert "beats_next" not in list(rows.values())[-1]
    lines = list(csv.DictReader((folder / "1" / "leaderboard.csv").open()))
    assert len(lines) == 6
    assert float(lines[0]["max_error_x"]) == next(iter(rows.values()))["max_error_x"]["mean"]
    page = (folder / "page.md").read_text()
    assert page.startswith("before\n<!-- leaderboard -->\n![")
    assert page.endswith("after\n")
    result = board.LeaderboardResult.read(folder / "1" / "leaderboard.json")
    assert page[7:-6] == leaderboard_page.readme_block(result, "2/verdict.svg", {})
    for figure in ("verdict", "profiles", "errors-operation"):
        assert (folder / "1" / f"{figure}.png").stat().st_size > 10_000
        written = [(folder / run / f"{figure}.svg").read_bytes() for run in "12"]
        assert written[0] == written[1]
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
        (["robustness", "--vary", "noise", "--values", "1,inf"], "--values is '1,inf'"),
        (["robustness", "--vary", "model", "--values", "2"], "coefficient_range is 2.0"),
        (["robustness", "--vary", "fix-delay", "--values", "0.5"], "position_delay is 0.5"),
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
