"""Tables, pages and figures of results that have other axes than the planar robot's."""

import json

import pytest
from rich.console import Console
from support.ball import BallScenario
from support.episodes import short
from support.results import PROVENANCE, evaluation, scores
from usm_baselines.benchmark import leaderboard_figures, robustness_figure
from usm_baselines.benchmark.leaderboard import PLANE, FrontPoint, LeaderboardResult, Standing
from usm_baselines.benchmark.leaderboard_page import brief_table, csv_text, markdown
from usm_baselines.benchmark.results import EvaluationResult, MiddleSummary
from usm_baselines.benchmark.robustness import RefusedPoint, RobustnessResult, ScoredPoint

from usm_cli.commands.robustness import table as robustness_table
from usm_cli.program import main
from usm_cli.score_table import table

SCENARIOS = short(4)
AXES = ("a", "abc")
axes = pytest.mark.parametrize("axes", AXES)


def standing(axes, size):
    """Return a row of the leaderboard."""
    row = scores(axes, size, len(SCENARIOS))
    errors = {
        f"max_error_{axis}": MiddleSummary(
            mean=e.mean, ci95=e.ci95, worst=e.worst, iqm=e.mean, iqm_ci95=e.ci95
        )
        for axis, e in row.errors.items()
    }
    return Standing(
        metrics={**row.metrics, **errors}, failures=0, per_episode=row.per_episode, competitor=True
    )


@axes
def test_an_evaluation(axes, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    result = evaluation(axes, ("pd", "sta"), SCENARIOS)
    rows = {name: standing(axes, 1e-3 * (k + 1)) for k, name in enumerate(("pd", "sta"))}
    headings = [column.header for column in table(rows, Console(width=400)).columns]
    joint = " / ".join(axes)
    assert headings[:3] == ["", "policy", f"error {' + '.join(axes)}\nmm"]
    assert headings[3:] == [
        *(f"{axis}\nmm" for axis in axes),
        *(f"worst\n{joint}", f"rms\n{joint}", "N/s", "objective\nmm", "lost", "told"),
    ]
    result.write("result.json")
    main(["report", "result.json", "--output", "page.html"])
    text = (tmp_path / "page.html").read_text()
    assert f"error {' + '.join(axes)}, mm" in text
    assert f'"label": "error {" + ".join(axes)}, mm"' in text
    assert f"this result is in {'a, b and c' if len(axes) == 3 else 'a'}" in text
    assert 'data-replay="' not in text
    assert "pd is ahead with an error of" in text
    capsys.readouterr()
    main(["compare", "result.json:pd", "result.json:sta", "--output", "compared.json"])
    said = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in said] == [*axes, "objective"]
    compared = json.loads((tmp_path / "compared.json").read_text())["comparisons"]
    assert list(compared) == [*(f"max_error_{axis}" for axis in axes), "objective"]


@axes
def test_a_leaderboard(axes, tmp_path):
    point = FrontPoint(means={f"max_error_{axis}": 1e-3 for axis in axes} | {"thrust_variation": 9})
    result = LeaderboardResult(
        version="9",
        suites={PLANE.main: {"pd": standing(axes, 1e-3), "sta": standing(axes, 2e-3)}},
        front={"pd": (point,)},
        refused={},
        provenance=PROVENANCE,
    )
    words = " ".join(markdown(result).split())
    assert f"the means in {'a, b and c' if len(axes) == 3 else 'a'} added up" in words
    columns = " | ".join(f"{axis}, mm" for axis in axes)
    error = f"error {' + '.join(axes)}, mm"
    assert f"| rank | policy | {error} | {columns} | worst {' / '.join(axes)} |" in markdown(result)
    assert f"worst {' / '.join(axes)} |" in brief_table(result.main)
    head, *lines = csv_text(result).splitlines()
    assert [name for name in head.split(",") if name.startswith("max_error") and name[-2] == "_"]
    assert {len(line.split(",")) for line in lines} == {len(head.split(","))}
    leaderboard_figures.draw_all(result, tmp_path)
    assert {path.stem for path in tmp_path.glob("*.png")} == {
        "verdict",
        "profiles",
        f"errors-{PLANE.main}",
    }


@axes
def test_robustness_curves(axes, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    row = scores(axes, 1e-3, len(SCENARIOS))
    point = ScoredPoint(value=0.0, metrics=row.metrics, failures=0, per_episode=row.per_episode)
    result = RobustnessResult(
        quantity="noise",
        label="noise [mm]",
        values=(0.0, 1.0),
        scenarios=tuple(SCENARIOS),
        results={"pd": (point, RefusedPoint(value=1.0, refused="too much"))},
        provenance=PROVENANCE,
    )
    (cells,) = ([*column.cells] for column in robustness_table(result).columns[1:2])
    assert cells == [" / ".join(f"{k + 1}.00" for k in range(len(axes)))]
    assert len(robustness_figure.draw(result).axes) == len(axes)
    result.write("noise.json")
    main(["report", "noise.json", "--output", "page.html"])
    text = (tmp_path / "page.html").read_text()
    assert all(f"pd, {axis}" in text for axis in axes)
    assert "pd is refused at 1: too much" in text


def test_a_result_of_another_world(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    result = evaluation("xyz", ("pd", "sta"), [BallScenario(noise_seed=k) for k in range(3)])
    result.write("ball.json")
    assert EvaluationResult.read("ball.json") == result
    main(["report", "ball.json", "--output", "page.html"])
    text = (tmp_path / "page.html").read_text()
    assert "this result is in x, y and z" in text
    assert "thruster lag" not in text
    main(["compare", "ball.json:pd", "ball.json:sta"])
    assert "z: ball.json:pd 3.00 mm" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="2"):
        main(["compare", "ball.json:pd", "sta"])
    assert "of another world" in capsys.readouterr().err


def test_a_result_in_which_everybody_is_refused_has_a_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    evaluation("a", (), SCENARIOS).write("result.json")
    main(["report", "result.json", "--output", "page.html"])
    assert (tmp_path / "page.html").exists()
