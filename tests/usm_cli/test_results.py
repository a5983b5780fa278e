"""Each kind of result is read as it was written, and a damaged file is refused in one line."""

import json
from functools import cache
from importlib.metadata import version
from pathlib import Path

import pytest
from support.episodes import short
from support.results import PROVENANCE, evaluation, scores, study
from usm_agents.study.results import StudyResult
from usm_baselines.benchmark.leaderboard import LeaderboardResult
from usm_baselines.benchmark.results import ComparisonResult, Difference, EvaluationResult
from usm_baselines.benchmark.robustness import RefusedPoint, RobustnessResult, ScoredPoint
from usm_baselines.paper.reproduction import PAPER, ReproductionResult, declaration
from usm_baselines.paper.reproduction_fit import (
    Assessment,
    Candidate,
    FitProgress,
    FitResult,
    declared,
    seen,
)
from usm_baselines.paper.sensitivity import planned_result, trials
from usm_baselines.paper.sensitivity_result import Outcome, SensitivityResult

from usm_cli.program import main
from usm_cli.speed import SpeedResult
from usm_gym.statistics import compare
from usm_gym.support.validation import SAID, UsageError, validated

STORED = Path(__file__).parents[2] / "results" / version("usm-gym")
SCENARIOS = tuple(short(3))


def comparison():
    difference = Difference.of(compare([1.0, 2.0], [2.0, 1.5]), "one", "other")
    return ComparisonResult(
        first="one",
        second="other",
        episodes=2,
        comparisons={"max_error_x": difference},
        provenance=PROVENANCE,
    )


def robustness():
    row = scores("xy", 1e-3, len(SCENARIOS))
    kept = {"metrics": row.metrics, "failures": 0, "per_episode": row.per_episode}
    return RobustnessResult(
        quantity="noise",
        label="noise [mm]",
        values=(0.0, 1.0),
        scenarios=SCENARIOS,
        results={"pd": (ScoredPoint(value=0.0, **kept), RefusedPoint(value=1.0, refused="odd"))},
        provenance=PROVENANCE,
    )


def reproduction():
    return ReproductionResult(
        step=1e-5,
        settle_time=5.0,
        rows=PAPER,
        thrust_effort={"sta": {"operation": 1.5}},
        peak_joint_torque={"sta": {"operation": 2.5}},
        paper=PAPER,
        scenario=declaration(),
        provenance=PROVENANCE,
    )


def sensitivity():
    axes = {"x": 1e-3, "y": 2e-3}
    outcome = Outcome(
        errors={"torpedo": axes},
        thrust_effort=1.0,
        peak_force=2.0,
        peak_joint_torque=3.0,
        sigma={"first": axes},
    )
    lost, kept = map(planned_result, trials()[:2])
    runs = (lost, type(kept)(**{**vars(kept), "result": outcome}))
    return SensitivityResult(runs=runs, provenance=PROVENANCE)


def fit():
    at = Assessment(step=1e-5, numbers={k: tuple(v) for k, v in seen().items()}, residual=0.0)
    candidate = Candidate(freedoms=declared(), coarse=at, paper=at)
    return FitResult(
        freedom={"speed": (0.02, 0.12)},
        seen=at.numbers,
        aim={"pd": 1.3},
        declared=candidate,
        fitted=candidate,
        evaluations=(((0.5, 0.25), 3.0),),
        provenance=PROVENANCE,
    )


RESULTS = {
    "evaluation": lambda: evaluation("xy", ("sta", "pd"), SCENARIOS),
    "comparison": comparison,
    "leaderboard": lambda: LeaderboardResult.read(STORED / "leaderboard.json"),
    "robustness": robustness,
    "reproduction": reproduction,
    "sensitivity": sensitivity,
    "fit under way": lambda: FitProgress(evaluations=(((0.5,), 3.0),), provenance=PROVENANCE),
    "fit": fit,
    "study": lambda: study(["estimator-lqg-joints-basin"], 2, 4),
    "bench": lambda: SpeedResult.read(STORED / "bench.json"),
}
kinds = pytest.mark.parametrize("kind", RESULTS)


@cache
def made(kind):
    return RESULTS[kind]()


@kinds
def test_a_result_is_read_as_it_was_written(kind, tmp_path):
    result = made(kind)
    result.write(tmp_path / "result.json")
    assert type(result).read(tmp_path / "result.json") == result
    document = json.loads((tmp_path / "result.json").read_text())
    assert document == result.document()
    assert document.get("kind", result.kind) == result.kind


PUBLISHED = {
    "leaderboard.json": LeaderboardResult,
    "bench.json": SpeedResult,
    "study/study.json": StudyResult,
}


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_results_are_written_again_as_they_are(name, tmp_path):
    PUBLISHED[name].read(STORED / name).write(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (STORED / name).read_bytes()


def damages(document):
    """Documents with a key less, a key of another type, and the whole in a list."""
    for key in document:
        yield {name: value for name, value in document.items() if name != key}
        yield document | {key: [None]}
    yield [document]


@kinds
def test_a_damaged_result_is_refused_in_one_line(kind):
    for document in damages(made(kind).document()):
        with pytest.raises(
            UsageError, match=f"^result.json is no complete {made(kind).kind}: "
        ) as e:
            type(made(kind)).parsed(document, "result.json")
        assert "\n" not in str(e.value)
        assert len(str(e.value)) <= SAID + 100


@pytest.mark.parametrize("kind", ["evaluation", "leaderboard", "robustness", "study"])
def test_the_command_refuses_a_damaged_result_with_status_2(kind, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    document = made(kind).document()
    del document["provenance"]
    Path("result.json").write_text(json.dumps(document))
    with pytest.raises(SystemExit) as left:
        main(["report", "result.json", "--output", "page.html"])
    assert left.value.code == 2
    line = f"usm: error: result.json is no complete {kind}: provenance is missing\n"
    assert capsys.readouterr().err == line


def test_rows_of_one_table_have_the_same_axes_and_episodes():
    document = evaluation("xy", ("sta", "pd"), SCENARIOS).document()
    other = evaluation("ab", ("pd",), SCENARIOS).document()["results"]["pd"]
    with pytest.raises(UsageError, match="axes is"):
        EvaluationResult.parsed({**document, "results": document["results"] | {"pd": other}}, "f")
    fewer = evaluation("xy", ("pd",), SCENARIOS[:2]).document()["results"]["pd"]
    with pytest.raises(UsageError, match="episodes is"):
        EvaluationResult.parsed({**document, "results": document["results"] | {"pd": fewer}}, "f")


def test_a_file_of_another_form_is_refused():
    @validated
    class Later(EvaluationResult):
        form = 2

    now = evaluation("xy", ("sta",), SCENARIOS)
    with pytest.raises(UsageError, match="form is 1; allowed: 2"):
        Later.parsed(now.document(), "f")
    later = now.document() | {"form": 2}
    with pytest.raises(UsageError, match="form is 2; allowed: 1"):
        EvaluationResult.parsed(later, "f")
    assert Later.parsed(later, "f").document() == {"kind": "evaluation", "form": 2} | now.document()
