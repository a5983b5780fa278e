"""What each kind of result shows."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from usm_baselines.benchmark.leaderboard import MAIN, suites
from usm_baselines.contender import Contender, contender
from usm_baselines.paper.reproduction import cases, run_case, side_by_side
from usm_baselines.registry import entry, ids

from usm_cli.report import plots
from usm_cli.report.blocks import Chapter, Facts, Replay, Tables
from usm_cli.report.replay import differing, recorded, replayed
from usm_cli.report.tables import (
    ERRORS,
    PARTS,
    Row,
    conditions_table,
    curve_table,
    paper_table,
    score_table,
)
from usm_cli.report.words import PAPERS, in_words, motion, total, verdict
from usm_gym.suites import unseen
from usm_gym.support.files import read_json
from usm_gym.support.text import figures
from usm_gym.support.validation import in_one_line, require
from usm_gym.task.conditions import FIELD
from usm_gym.task.scenario import Scenario

Document = Mapping[str, Any]
Progress = Callable[[int, int], object]

SCORES = (
    "Largest position error after settling: mean over the episodes with its 95 % interval, mean of "
    "the middle half of the episodes, worst episode. Thrust is the mean force of a thruster, "
    "variation how much it changes in a second: chattering. A lost robot counts 0.5 m or more."
)
CONDITIONS = (
    "What the simulation does to a controller. Current and coefficients are drawn anew for each "
    "episode, and no controller is told; all meet the same episodes and the same noise."
)


@dataclass(frozen=True)
class Choice:
    """What is replayed, and on what.

    Attributes:
        policies: The policies; None means those of the result.
        scenario: Which of the result's scenarios, from 0 on.
        workers: Number of processes.
    """

    policies: Sequence[Contender] | None = None
    scenario: int = 0
    workers: int = 1


def read(path: Path) -> Document:
    """A result from its file.

    Raises:
        ValueError: If it is none, or of no kind that has a chapter.
        OSError: If it cannot be read.
    """
    document = read_json(path)
    kind = document.get("kind") if isinstance(document, dict) else None
    require(isinstance(kind, str) and kind in KINDS, f"kind of {path}", kind, ", ".join(KINDS))
    found: Document = document
    return found


def chapter(path: Path, choice: Choice, progress: Progress) -> Chapter:
    """What there is to show of a result.

    Args:
        path: Its file.
        choice: What is replayed.
        progress: Called with the number of episodes that are computed, and that there are.

    Raises:
        ValueError: If the file holds no result, or nothing can be replayed as chosen.
        OSError: If it cannot be read.
    """
    document = read(path)
    kind = document["kind"]
    try:
        return KINDS[kind](document, choice, progress)
    except (KeyError, TypeError, AttributeError, IndexError) as error:
        fault = f"{type(error).__name__}: {in_one_line(error)}"
        raise ValueError(f"{path} is no complete {kind}: {fault}") from error


def evaluation(result: Document, choice: Choice, progress: Progress) -> Chapter:
    """Several policies on one list of scenarios."""
    name = result["suite"] or "sampled"
    scenarios = [Scenario.from_dict(each) for each in result["scenarios"]]
    rows = dict(sorted(result["results"].items(), key=lambda pair: total(pair[1])))
    return Chapter(
        title=f"Evaluation: {name}",
        lead=f"{len(rows)} policies on {len(scenarios)} episodes.",
        motion=motion(rows),
        verdict=verdict(rows, len(scenarios)),
        blocks=[
            replay(scenarios, rows, choice, progress),
            Tables("Scores", SCORES, "suite", {name: score_table(rows, result["refused"])}),
            plots.front(rows, {}),
            Tables("Conditions", CONDITIONS, "suite", {name: conditions_table({name: scenarios})}),
            names(),
            provenance(result["provenance"]),
        ],
    )


def leaderboard(result: Document, choice: Choice, progress: Progress) -> Chapter:
    """Every policy on every suite."""
    scenarios = suites()
    rows = result["suites"][MAIN]
    episodes = len(scenarios[MAIN])
    tables = {
        name: score_table(each, result["refused"].get(name, {}))
        for name, each in result["suites"].items()
    }
    known = {name: scenarios[name] for name in result["suites"]}
    return Chapter(
        title=f"Leaderboard of usm-gym {result['version']}",
        lead=f"{len(rows)} policies on {len(tables)} suites; {MAIN}, with {episodes} episodes, "
        "is the main one.",
        motion=motion(rows),
        verdict=verdict(rows, episodes),
        blocks=[
            replay(scenarios[MAIN], rows, choice, progress),
            Tables("Scores", SCORES, "suite", tables),
            plots.front(rows, result["front"]),
            Tables("Conditions", CONDITIONS, "suites", {"all": conditions_table(known)}),
            names(),
            provenance(result["provenance"]),
        ],
    )


def robustness(result: Document, choice: Choice, progress: Progress) -> Chapter:
    """Error against one quantity."""
    scenarios = [Scenario.from_dict(each) for each in result["scenarios"]]
    curves, label = result["results"], result["label"]
    return Chapter(
        title=f"Robustness: {result['quantity']}",
        lead=f"How the errors of {len(curves)} policies grow with one quantity, all else being "
        f"equal, over {len(scenarios)} episodes at each value: {label}.",
        motion="",
        verdict="",
        blocks=[
            plots.robustness(curves, label),
            Tables(
                "Errors",
                "Largest position error after settling, mm: mean with its 95 % interval, by "
                f"{label}.",
                "quantity",
                {label: curve_table(curves)},
            ),
            replay(scenarios, {name: {} for name in curves}, choice, progress),
            Tables(
                "Conditions",
                f"{CONDITIONS} These are the conditions before anything is varied.",
                "suite",
                {"scenarios": conditions_table({"scenarios": scenarios})},
            ),
            names(),
            provenance(result["provenance"]),
        ],
    )


def reproduction(result: Document, choice: Choice, progress: Progress) -> Chapter:
    """The paper's Table 1, and its operation mode as a replay at the paper's step."""
    rows, paper, step = result["rows"], result["paper"], result["step"]
    require(choice.policies is None, "--policies", "given", "none: a reproduction has its own laws")
    require(choice.scenario == 0, "--scenario", choice.scenario, "0: a reproduction has one")
    chosen = {each.row: each for each in cases(step) if each.mode == "operation"}
    records = {}
    for name, record in side_by_side(run_case, chosen, os.cpu_count() or 1):
        records[name] = record
        progress(len(records), len(chosen))
    records = {name: records[name] for name in chosen}
    scenario = next(iter(chosen.values())).scenario
    ratios = [
        rows[name][part][axis] / paper[name][part][axis]
        for name in paper
        for part in PARTS
        for axis in "xy"
    ]
    return Chapter(
        title="Reproduction of Table 1",
        lead=f"The paper's laws as printed, at a step of {step:g} s, thrusters unlimited.",
        motion="",
        verdict="",
        blocks=[
            Tables(
                "Table 1",
                "Absolute maximum of the position error after settling; settled leaves out the 7 s "
                "after each change of the joint references. Ours over the paper's lies between "
                f"{figures(min(ratios))} and {figures(max(ratios))}.",
                "table",
                {"Table 1": paper_table(rows, paper)},
            ),
            Replay(
                "Operation mode, replayed",
                "The joints jump at the dashed lines.",
                recorded(scenario, records),
                ("sta", "pd"),
            ),
            provenance(result["provenance"]),
        ],
    )


def study(result: Document, choice: Choice, progress: Progress) -> Chapter:
    """Trained agents beside the classical policies."""
    kinds = {"agents": True, "ablations": False}
    trained = {
        title: {name: row for name, row in result["rows"].items() if row["agent"] is agent}
        for title, agent in kinds.items()
    }
    everyone = {**trained["agents"], **result["rivals"], **trained["ablations"]}
    scores = {
        (row["mode"], kind, name): {**each, "competitor": True}
        for name, row in everyone.items()
        for kind, each in row["scores"].items()
    }
    tables = {
        f"{mode}, {kind}": score_table(
            {name: row for (m, k, name), row in scores.items() if (m, k) == (mode, kind)}, {}
        )
        for mode, kind in dict.fromkeys((mode, kind) for mode, kind, _ in scores)
    }
    home = {
        name: row
        for (mode, kind, name), row in scores.items()
        if (mode, kind) == ("operation", result["home"]) and name not in trained["ablations"]
    }
    home = dict(sorted(home.items(), key=lambda pair: total(pair[1])))
    episodes = unseen("operation", FIELD, result["seed"], result["episodes"])
    return Chapter(
        title="Study of residual agents",
        lead=f"{len(trained['agents'])} agents under several seeds, and what they owe to what.",
        motion=motion(home),
        verdict=verdict(home, len(episodes)),
        blocks=[
            replay(episodes, home, choice, progress),
            Tables("Scores", f"{SCORES} All seeds together.", "where", tables),
            *(plots.learning(rows) for rows in trained.values() if rows),
            plots.front(home, {}),
            names(),
            provenance(result["provenance"]),
        ],
    )


KINDS: dict[str, Callable[[Document, Choice, Progress], Chapter]] = {
    "evaluation": evaluation,
    "leaderboard": leaderboard,
    "robustness": robustness,
    "reproduction": reproduction,
    "study": study,
}


def replay(
    scenarios: Sequence[Scenario], rows: Mapping[str, Row], choice: Choice, progress: Progress
) -> Replay | Facts:
    """An episode of the policies of a result, or why there is none to be seen."""
    index = choice.scenario
    require(index < len(scenarios), "--scenario", index, f"0 to {len(scenarios) - 1}")
    contenders, missing = able(rows, choice)
    scenario, done = scenarios[index], 0

    def advance() -> None:
        nonlocal done
        done += 1
        progress(done, len(contenders))

    episodes = replayed(contenders, scenario, choice.workers, advance)
    missing |= episodes.missing
    title = f"Episode {index}, replayed"
    shown = list(episodes.data["episodes"])
    if not shown:
        return Facts(title, missing)
    scores = {
        name: tuple(rows[name]["per_episode"][each][index] for each in ERRORS)
        for name in shown
        if "per_episode" in rows.get(name, {})
    }
    notes = [f"{name} is not replayed: {why}" for name, why in missing.items()]
    changed = differing(episodes.max_error, scores)
    if changed:
        notes.append(
            f"Not as in the result, for something has changed since: {', '.join(changed)}."
        )
    best = next((name for name in shown if rows.get(name, {}).get("competitor", True)), shown[0])
    others = [name for name in shown if name != best]
    beside = PAPERS if PAPERS in others else others[0] if others else ""
    return Replay(title, in_words(scenario), episodes.data, (best, beside), notes)


def able(rows: Mapping[str, Row], choice: Choice) -> tuple[list[Contender], dict[str, str]]:
    """The policies to be replayed, and why others are not.

    A file of results is given nothing to open or to run: of the names in it only those of
    registered policies mean anything, unless the user gives the name, too.
    """
    if choice.policies is not None:
        return list(choice.policies), {}
    known = [name for name in rows if name in ids()]
    why = "only registered policies are replayed unasked; name others with --policies"
    return [contender(name) for name in known], {name: why for name in rows if name not in known}


def names() -> Facts:
    """What the names of the policies mean."""
    found = {id: entry(id).summary for id in ids() if not id.endswith("-tuned")}
    found["…-tuned"] = "the same law with gains that usm tune has found on sampled scenarios"
    return Facts("What the names mean", found)


def provenance(found: Row) -> Facts:
    """Where a result comes from."""
    packages = ", ".join(f"{name} {version}" for name, version in found["packages"].items())
    seeds = "; ".join(f"{name}: {_listed(value)}" for name, value in found["seeds"].items())
    return Facts(
        "Where this comes from",
        {
            "command": found["command"],
            "version": f"usm-gym {found['version']}, commit {found['commit'] or 'unknown'}",
            "packages": packages,
            "seeds": seeds,
        },
    )


def _listed(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
