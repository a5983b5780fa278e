"""The study of agents: what it trains, that it goes on where it stopped, and what its rows say."""

import json
import pickle
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from usm_agents.artifact.folder import read_agent
from usm_agents.learning.plan import Plan, write_plan
from usm_agents.learning.settings import SETTINGS
from usm_agents.learning.training import train
from usm_agents.study import dissection, page, plans, scores, trainings
from usm_agents.study.dissection import lateness
from usm_agents.study.plans import PLANS, SEEDS, TRANSFER
from usm_agents.study.results import CurvePoint, StudyResult
from usm_agents.study.scores import best_so_far, steps_to
from usm_agents.study.trainings import planned

import usm_gym
from usm_cli.program import main
from usm_gym.evaluation import Evaluation
from usm_gym.statistics import interval, ratio_interval
from usm_gym.support.files import write_json
from usm_gym.task.conditions import FIELD

STORED = Path(__file__).parents[3] / "results" / usm_gym.__version__ / "study" / "study.json"


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setitem(SETTINGS["ppo"], "robots", 16)
    small_train = partial(train, validation_episodes=2, test_episodes=2)
    monkeypatch.setattr(trainings, "train", small_train)
    monkeypatch.setattr(plans, "RIVALS", ("sta", "zero"))
    monkeypatch.setattr(scores, "TRANSFER", {"still": TRANSFER["still"]})
    monkeypatch.setattr(dissection, "EPISODES", 1)


@pytest.mark.slow
def test_a_small_study_end_to_end(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "study"
    command = ["study", "residual", "--only", "residual-ppo,reference", "--seeds", "1"]
    command += ["--steps", "1024", "--episodes", "4", "--output", str(folder)]
    shipped = tmp_path / "shipped"
    main([*command, "--ship", str(shipped)])
    found = json.loads((folder / "study.json").read_text())
    assert list(found["rows"]) == ["residual-ppo", "reference"]
    assert [name for name, each in found["rows"].items() if each["agent"]] == ["residual-ppo"]
    ours = found["rows"]["residual-ppo"]["scores"]
    assert set(ours) == {"field", "still"}
    assert set(found["rows"]["reference"]["scores"]) == {"field"}
    for name in ("study.md", "curves.png", "front.png", "spectra.png"):
        assert (folder / name).stat().st_size > 0
    dissected = found["dissected"]["residual-ppo"]["x"]["deviation"]
    assert dissected["base alone"] > dissected["needed"] > 0.0

    against = found["against"]["residual-ppo"]
    assert list(against) == ["sta", "zero"]
    theirs = found["rivals"]["sta"]["scores"]["field"]
    mean = ours["field"]["max_error_x"]["mean"] / theirs["max_error_x"]["mean"]
    (low, high), *_ = against["sta"]["ratio_ci95"]
    assert low <= against["sta"]["ratio"][0] == mean <= high

    # The same scores as `usm evaluate` gives.
    out = tmp_path / "scores.json"
    agent = str(folder / "runs" / "residual-ppo-0")
    chosen = ["--policies", agent, "--seed", "7", "--episodes", "4"]
    main(["evaluate", *chosen, "--output", str(out)])
    again = json.loads(out.read_text())["results"][agent]["per_episode"]["max_error_x"]
    assert ours["field"]["per_episode"]["max_error_x"] == again

    # A shipped agent is the same under its own name.
    assert [each.name for each in shipped.iterdir()] == ["residual-ppo"]
    agent_file, network = read_agent(shipped / "residual-ppo")
    assert agent_file.training["command"] == "usm train --steps 1024 --output residual-ppo"
    assert (network.weights[0] == read_agent(Path(agent))[1].weights[0]).all()

    page = tmp_path / "page.html"
    main(["report", str(folder / "study.json"), "--policies", "sta,zero", "--output", str(page)])
    text = page.read_text()
    assert "Learning curves" in text
    assert "residual-ppo" in text

    # What is done is not done again; another training in its place is refused.
    monkeypatch.setattr(trainings, "train_one", None)
    main(command)
    capsys.readouterr()
    with pytest.raises(SystemExit, match="2"):
        main(["2048" if word == "1024" else word for word in command])
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "--steps 1024" in message
    assert "--steps 2048" in message


@pytest.mark.parametrize("plan", [None, Plan(steps=2048)], ids=["no plan", "another plan"])
def test_a_study_opens_no_checkpoint_but_those_of_its_own_plans(plan, tmp_path, capsys):
    folder = tmp_path / "runs" / "reference-0"
    (folder / "checkpoint-0000000000").mkdir(parents=True)
    (folder / "checkpoint-0000000000" / "state").write_bytes(pickle.dumps(Bomb()))
    if plan is not None:
        write_plan(plan, folder)
    command = ["study", "residual", "--only", "scale-3,reference", "--steps", "1024"]
    with pytest.raises(SystemExit, match="2"):
        main([*command, "--output", str(tmp_path)])
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "runs/reference-0" in message
    assert not (tmp_path / "runs" / "scale-3-0").exists()  # refused before anything is trained


class Bomb:
    def __reduce__(self):
        return sys.exit, ("a checkpoint was run",)


@pytest.mark.parametrize("curve", [{}, [], 5, [{"steps": "x"}], [[]]])
def test_a_damaged_learning_curve_is_said_to_be_one(tmp_path, curve):
    (run,) = planned(["residual-ppo"], 1, tmp_path)
    write_plan(run.plan, run.folder)
    write_json(run.folder / "curve.json", curve)
    with pytest.raises(ValueError, match="a learning curve"):
        assert run.done


def test_every_seed_has_its_own_training_and_early_seeds_come_first(tmp_path):
    chosen = planned(list(PLANS), 5, tmp_path)
    assert [run.plan.seed for run in chosen] == sorted(run.plan.seed for run in chosen)
    assert len({run.folder for run in chosen}) == len(chosen)
    for name in PLANS:
        seeds = [run.plan.seed for run in chosen if run.name == name]
        assert seeds == list(range(SEEDS[name]))
    assert SEEDS["residual-ppo"] > 1
    with pytest.raises(ValueError, match="--only is 'nobody'"):
        planned(["nobody"], 1, tmp_path)


def test_plans_differ_from_the_reference_in_what_they_are_named_for():
    reference = PLANS["reference"]
    assert PLANS["no-randomisation"].conditions != FIELD
    for name in ("thrusters", "scale-3", "no-kalman-states", "no-joint-references"):
        assert PLANS[name] != reference
        assert PLANS[name].steps == reference.steps


def test_lateness_is_found():
    needed = np.random.default_rng(0).normal(size=(400, 3))
    assert lateness(np.roll(needed, 4, axis=0), needed) == 4
    assert lateness(np.roll(needed, -3, axis=0), needed) == -3


def test_scores_over_seeds_are_those_of_their_tables():
    rng = np.random.default_rng(1)
    names = ["max_error_x", "settled_error_x", "heading_error", *scores.OTHERS]
    parts = [
        Evaluation(
            per_episode={name: rng.exponential(size=60) for name in names},
            failed=np.arange(60) == seed,
        )
        for seed in range(3)
    ]
    found = scores.over_seeds(parts)
    assert (list(found.metrics), found.failures, found.axes) == (names, 3, ("x",))
    for name, summary in found.metrics.items():
        table = np.stack([part.per_episode[name] for part in parts])
        assert (found.table(name) == table).all()
        assert summary.mean == pytest.approx(table.mean())
        assert summary.seeds == pytest.approx(table.mean(axis=1))
        assert summary.iqm == pytest.approx(np.sort(table.ravel())[45:135].mean())
        assert summary.worst == table.max()
        assert summary.ci95 == interval(np.mean, table)

    rival = scores.over_seeds(parts[:1])
    claim = scores.against(found, rival)
    assert claim.ratio_ci95 == (
        ratio_interval(found.table("max_error_x"), rival.table("max_error_x")),
    )
    assert claim.better_in_both == 0.0  # its seed 0 is the rival itself
    means = found.metrics["max_error_x"].seeds
    assert claim.better_seeds == sum(mean < means[0] for mean in means)


def test_the_stored_study_is_summarised_as_its_episodes_say():
    stored = StudyResult.read(STORED)
    ours, theirs = (
        row.scores[stored.home] for row in (stored.rows["residual-ppo"], stored.rivals["lqg-tuned"])
    )
    tables = {name: ours.table(name) for name in ours.metrics}
    assert scores.summarised(tables, ours.failures) == ours
    assert scores.against(ours, theirs) == stored.against["residual-ppo"]["lqg-tuned"]


def test_a_study_of_an_older_plant_says_so_in_its_head():
    stored = StudyResult.read(STORED)
    said = "of the plant of 0.1.0, whose step has been mended since"
    assert said in page.markdown(stored).partition("## Agents")[0]
    today = replace(stored, provenance=replace(stored.provenance, version="0.2.0"))
    assert "mended" not in page.markdown(today)


def test_steps_to_an_objective_are_those_of_the_best_agents_so_far():
    def curve(*errors):
        return [
            CurvePoint(
                steps=100 * k,
                seconds=0.0,
                means={"max_error_x": 1e-3 * error, "max_error_y": 0.0, "thrust_variation": 0.0},
                failures=0,
            )
            for k, error in enumerate(errors)
        ]

    curves = {"0": curve(5.0, 3.0, 1.0), "1": curve(5.0, 1.0, 9.0)}
    assert best_so_far(curves) == pytest.approx({0: 5.0, 100: 2.0, 200: 1.0})
    assert steps_to(curves, 5.0) == 0
    assert steps_to(curves, 1.9) == 200
    assert steps_to(curves, 0.5) is None
