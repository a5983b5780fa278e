"""The study of agents: what it trains, that it goes on where it stopped, and what its rows say."""

import json
import pickle
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from usm_agents.artifact.folder import read_agent
from usm_agents.learning.plan import Plan, write_plan
from usm_agents.learning.settings import SETTINGS
from usm_agents.learning.training import train
from usm_agents.study import claims, dissection, plans, scores, trainings
from usm_agents.study.claims import best_so_far, steps_to
from usm_agents.study.dissection import lateness
from usm_agents.study.plans import ABLATED, ABLATIONS, AGENTS, PLANS, SEEDS, Home, home_of
from usm_agents.study.results import CurvePoint
from usm_agents.study.trainings import planned
from usm_baselines import registry
from usm_baselines.benchmark.scoring import Refusal

from usm_cli.program import main
from usm_gym import statistics
from usm_gym.evaluation import SHIFT_METRICS, Evaluation
from usm_gym.statistics import interval, ratio_interval
from usm_gym.support.files import write_json
from usm_gym.task.conditions import FIELD, IN_SPACE, PRESETS
from usm_gym.task.modes import presets_of
from usm_gym.task.nominal import shared_nominal


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setitem(SETTINGS["ppo"], "robots", 16)
    small_train = partial(train, validation_episodes=2, test_episodes=2)
    monkeypatch.setattr(trainings, "train", small_train)
    monkeypatch.setitem(plans.RIVALS, "field", ("sta", "zero"))
    still = {"still": plans.ELSEWHERE["field"]["still"]}
    monkeypatch.setitem(plans.ELSEWHERE, "field", still)
    monkeypatch.setattr(dissection, "EPISODES", 1)
    monkeypatch.setattr(statistics, "RESAMPLES", 500)


@pytest.fixture
def shipped_base(monkeypatch):
    """Register a law under the name of the agent that is another one's base."""
    id = PLANS["residual-sta-navigator-basin"].base
    law = registry.entry("sta-navigator-basin")
    monkeypatch.setitem(registry._entries, id, law)
    return id


@pytest.mark.slow
def test_a_small_study_end_to_end(tmp_path, monkeypatch, capsys):
    folder = tmp_path / "study"
    command = ["study", "residual", "--only", "residual-ppo,scale-6", "--seeds", "1"]
    command += ["--steps", "1024", "--episodes", "4", "--output", str(folder)]
    shipped = tmp_path / "shipped"
    main([*command, "--ship", str(shipped)])
    found = json.loads((folder / "study.json").read_text())
    assert list(found["homes"]) == ["field"]
    home = found["homes"]["field"]
    assert (list(home["agents"]), list(home["ablations"])) == (["residual-ppo"], ["scale-6"])
    ours = home["agents"]["residual-ppo"]
    assert list(ours["elsewhere"]) == list(home["transfer"]["residual-ppo"]) == ["still"]
    assert home["ablations"]["scale-6"]["elsewhere"] == {}
    for kind in ("curves", "front", "profiles", "spectra"):
        assert (folder / f"field-{kind}.png").stat().st_size > 0
    dissected = home["dissected"]["residual-ppo"]["x"]["deviation"]
    assert dissected["base alone"] > dissected["needed"] > 0.0

    against = home["against"]["residual-ppo"]
    assert list(against) == ["sta", "zero"]
    assert list(home["against"]["scale-6"]) == ["residual-ppo"]
    theirs = home["rivals"]["sta"]["home"]["max_error_x"]["mean"]
    ratio = against["sta"]["ratios"]["max_error_x"]
    low, high = ratio["ci95"]
    assert low <= ratio["value"] == ours["home"]["max_error_x"]["mean"] / theirs <= high
    assert "thrust_variation" not in against["zero"]["ratios"]

    # The same scores as `usm evaluate` gives.
    out = tmp_path / "scores.json"
    agent = str(folder / "runs" / "residual-ppo-0")
    chosen = ["--policies", agent, "--seed", "7", "--episodes", "4"]
    main(["evaluate", *chosen, "--output", str(out)])
    again = json.loads(out.read_text())["results"][agent]["per_episode"]["max_error_x"]
    assert ours["home"]["per_episode"]["max_error_x"] == again

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
    folder = tmp_path / "runs" / "scale-6-0"
    (folder / "checkpoint-0000000000").mkdir(parents=True)
    (folder / "checkpoint-0000000000" / "state").write_bytes(pickle.dumps(Bomb()))
    if plan is not None:
        write_plan(plan, folder)
    command = ["study", "residual", "--only", "scale-40,scale-6", "--steps", "1024"]
    with pytest.raises(SystemExit, match="2"):
        main([*command, "--output", str(tmp_path)])
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "runs/scale-6-0" in message
    assert not (tmp_path / "runs" / "scale-40-0").exists()  # refused before anything is trained


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


def test_every_seed_has_its_own_training_and_early_seeds_come_first(tmp_path, shipped_base):
    chosen = planned(list(PLANS), 10, tmp_path)
    assert [run.plan.seed for run in chosen] == sorted(run.plan.seed for run in chosen)
    assert len({run.folder for run in chosen}) == len(chosen)
    for name in PLANS:
        seeds = [run.plan.seed for run in chosen if run.name == name]
        assert seeds == list(range(SEEDS[name]))
    assert SEEDS["residual-ppo"] == 2 * SEEDS["scale-6"]
    with pytest.raises(ValueError, match="--only is 'nobody'"):
        planned(["nobody"], 1, tmp_path)


def test_an_agent_on_another_agent_waits_until_that_one_is_shipped(tmp_path, monkeypatch, capsys):
    name = "residual-sta-navigator-basin"
    base = PLANS[name].base
    monkeypatch.delitem(registry._entries, base, raising=False)
    with pytest.raises(SystemExit, match="2"):
        main(["study", "residual", "--only", f"scale-6,{name}", "--output", str(tmp_path)])
    message = capsys.readouterr().err
    assert f"--only {base} --ship" in message
    assert not (tmp_path / "runs").exists()
    monkeypatch.setitem(registry._entries, base, registry.entry("sta-navigator-basin"))
    assert len(planned([name], 1, tmp_path)) == 1


def test_seeds_that_were_trained_in_another_way_are_refused(tmp_path, monkeypatch):
    chosen = trainings.planned(["residual-ppo", "scale-6"], 3, tmp_path)
    unchanged = {"gains": {}, "base_weights": ""}
    made = {
        each.folder: SimpleNamespace(training={"settings": {"gamma": 0.9}}, **unchanged)
        for each in chosen
    }
    monkeypatch.setattr(trainings, "read_agent", lambda folder: (made[folder], None))
    trainings.require_alike(chosen)
    last = chosen[-1].folder
    for changed in ({"training": {"settings": {"gamma": 0.8}}}, {"base_weights": "other"}):
        made[last] = SimpleNamespace(**{**vars(made[chosen[0].folder]), **changed})
        with pytest.raises(ValueError, match="was trained with"):
            trainings.require_alike(chosen)


def test_an_ablation_is_the_ablated_agent_but_for_one_thing(tmp_path):
    whole = AGENTS[ABLATED].record()
    for name, plan in ABLATIONS.items():
        changed = {key for key, value in plan.record().items() if value != whole[key]}
        assert len(changed - {"residual_scale"}) <= 1
        assert changed
        assert home_of(name) == home_of(ABLATED)
    assert ABLATIONS["no-randomisation"].conditions != FIELD


def test_homes_are_the_conditions_and_modes_of_the_trainings():
    assert home_of("residual-torpedo") == Home("field", "torpedo")
    assert home_of("residual-torpedo").name == "torpedo-field"
    assert home_of("residual-torpedo-eely") == Home("field3d", "torpedo3d")
    assert home_of("residual-torpedo-eely").name == "torpedo3d-field"
    assert home_of("residual-eely").name == "field3d"
    for name, plan in AGENTS.items():
        home = home_of(name)
        presets = presets_of(home.mode)
        assert presets[home.tier.removesuffix(IN_SPACE)] == plan.conditions == home.conditions
        assert home.sets[home.tier] == plan.conditions
        assert plan.mode == home.mode
        # No worse than its base can be read off: it is a rival.
        assert plan.base in plans.rivals_of(home, [name]).values()
    basin = plans.rivals_of(Home("basin", "operation"), list(AGENTS))
    assert basin["estimator-sta-navigator-basin, shipped"] == "estimator-sta-navigator-basin"


def test_a_rival_may_have_gains_of_its_own(monkeypatch, tmp_path):
    file = registry.TUNED / "sta.json"
    monkeypatch.setitem(plans.RIVALS, "field", (f"sta@{file}",))
    (home,) = rivals = scores.rivals(planned(["residual-ppo"], 1, tmp_path))
    assert list(rivals[home]) == ["sta@sta.json", "sta"]
    monkeypatch.setitem(plans.RIVALS, "field", ("sta@missing.json",))
    with pytest.raises(OSError, match="missing"):
        scores.rivals(planned(["residual-ppo"], 1, tmp_path))


def test_where_the_nominal_model_is_right_nothing_is_drawn_but_the_motion():
    for tier in ("field", "basin"):
        conditions = plans.exact(PRESETS[tier])
        robots = []
        for seed in range(3):
            (scenario,) = scores.unseen("operation", conditions, seed, 1)
            robots.append(scenario.body)
            assert shared_nominal([scenario]).robot == scenario.body
        assert robots[0] == robots[1] == robots[2]


def test_lateness_is_found():
    needed = np.random.default_rng(0).normal(size=(400, 3))
    assert lateness(np.roll(needed, 4, axis=0), needed) == 4
    assert lateness(np.roll(needed, -3, axis=0), needed) == -3


def test_scores_over_seeds_are_those_of_their_tables():
    rng = np.random.default_rng(1)
    names = ["max_error_x", "settled_error_x", "heading_error", *claims.OTHERS]
    parts = [
        Evaluation(
            per_episode={name: rng.exponential(size=60) for name in names},
            failed=np.arange(60) == seed,
        )
        for seed in range(3)
    ]
    found = claims.over_seeds(parts)
    assert (list(found.metrics), found.failures, found.axes) == (names, 3, ("x",))
    for name, summary in found.metrics.items():
        table = np.stack([part.per_episode[name] for part in parts])
        assert (found.table(name) == table).all()
        assert summary.mean == pytest.approx(table.mean())
        assert summary.seeds == pytest.approx(table.mean(axis=1))
        assert summary.iqm == pytest.approx(np.sort(table.ravel())[45:135].mean())
        assert summary.worst == table.max()
        assert summary.ci95 == interval(np.mean, table)

    rival = claims.over_seeds(parts[:1])
    claim = claims.against(found, rival)
    ours, theirs = found.table("max_error_x"), rival.table("max_error_x")
    named = ["max_error_x", "heading_error", "thrust_variation", "objective"]
    assert list(claim.ratios) == named
    ratio = claim.ratios["max_error_x"]
    assert ratio.value == pytest.approx(ours.mean() / theirs.mean())
    assert ratio.ci95 == ratio_interval(ours, theirs)
    mine, other = (np.mean([part.objective() for part in of]) for of in (parts, parts[:1]))
    assert claim.ratios["objective"].value == pytest.approx(mine / other)
    # Its seed 0 is the rival itself: ties count half.
    share = ((ours < theirs).mean() + (ours <= theirs).mean()) / 2
    assert claim.improvements["x"].value == pytest.approx(share)
    means = found.metrics["max_error_x"].seeds
    assert claim.better_seeds == sum(mean < means[0] for mean in means)
    assert claims.adaptation(found) == {}


def test_who_halves_its_error_from_the_first_shift_to_the_fifth_has_a_ratio_of_a_half():
    rng = np.random.default_rng(2)
    names = ["max_error_x", "settled_error_x", "heading_error", *claims.OTHERS]
    parts = []
    for _ in range(3):
        scores = {name: rng.exponential(size=20) for name in names}
        scores |= {f"{name}_x": scores["max_error_x"] for name in SHIFT_METRICS}
        scores["fifth_shift_error_x"] = 0.5 * scores["first_shift_error_x"]
        parts.append(Evaluation(scores, np.zeros(20, bool)))
    assert "first_shift_error_x" not in claims.over_seeds(parts).metrics
    found = claims.adaptation(claims.over_seeds(parts, by_shift=True))["x"]
    assert found.value == pytest.approx(0.5)
    assert found.ci95 == pytest.approx((0.5, 0.5))


def test_a_policy_may_be_refused_elsewhere_but_not_at_home(monkeypatch, tmp_path):
    home = Home("field", "operation")
    keys = [scores.Key(home, "sta", where) for where in home.sets]
    monkeypatch.setattr(scores, "score_all", lambda jobs, *of: [Refusal("odd")] * len(jobs))
    found = scores.score({keys[1]: None}, 1, tmp_path, print)
    names = ["max_error_x", "settled_error_x", "heading_error", *claims.OTHERS]
    found[keys[0]] = Evaluation({name: np.ones(4) for name in names}, np.zeros(4, bool))
    row = scores.scored(home, ["sta"], found, "little")
    assert (row.elsewhere, row.refused) == ({}, {"still": "odd"})
    with pytest.raises(ValueError, match="sta is refused in field: odd"):
        scores.score({keys[0]: None}, 1, tmp_path, print)


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
