"""Turns every kind of result into a chapter."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from usm_agents.study.results import HomeResult, StudyResult
from usm_baselines.benchmark.leaderboard import LeaderboardResult
from usm_baselines.benchmark.results import CompetitorScores, EvaluationResult, Scores
from usm_baselines.benchmark.robustness import RobustnessResult
from usm_baselines.contender import Contender, contender
from usm_baselines.paper.reproduction import (
    PARTS,
    ReproductionResult,
    cases,
    run_case,
    side_by_side,
)
from usm_baselines.registry import ids

from usm_cli.report import plots
from usm_cli.report.blocks import Chapter, Facts, Plot, Replay, Tables
from usm_cli.report.replay import differing, recorded, replayed
from usm_cli.report.tables import (
    by_objective,
    competes,
    conditions_table,
    curve_table,
    paper_table,
    score_table,
    verdict_table,
)
from usm_cli.report.words import CONDITIONS, PAPERS, about_scores, in_words, motion, verdict
from usm_gym.manipulator import Manipulator
from usm_gym.robots import AnyRobot
from usm_gym.suites import unseen
from usm_gym.support.files import read_json
from usm_gym.support.results import Provenance, Result
from usm_gym.support.text import counted, figures, listed
from usm_gym.support.validation import require
from usm_gym.task.conditions import IN_SPACE
from usm_gym.task.metrics import MAX_ERROR
from usm_gym.task.modes import AnyScenario, presets_of
from usm_gym.task.stored_scenario import OtherScenario
from usm_gym.world import world_of

Progress = Callable[[int, int], object]
Scenarios = Sequence[AnyScenario | OtherScenario]


@dataclass(frozen=True)
class Choice:
    """What to replay.

    Attributes:
        policies: The policies; None means those of the result.
        scenario: The index of one of the result's scenarios.
        workers: Number of processes.
    """

    policies: Sequence[Contender] | None = None
    scenario: int = 0
    workers: int = 1


def read(path: Path) -> Result:
    """Read a result from its file.

    Raises:
        UsageError: If it is not a result, or its kind has no chapter.
        OSError: If it cannot be read.
    """
    document = read_json(path)
    kind = document.get("kind") if isinstance(document, dict) else None
    known = {result.kind: result for result in CHAPTERS}
    require(isinstance(kind, str) and kind in known, f"kind of {path}", kind, ", ".join(known))
    return known[str(kind)].parsed(document, path)


def chapter(result: Result, choice: Choice, progress: Progress) -> Chapter:
    """Make the chapter of a result.

    Args:
        result: The result.
        choice: What to replay.
        progress: Called with the number of computed episodes and of all episodes.

    Raises:
        UsageError: If the choice cannot be replayed.
    """
    return CHAPTERS[type(result)](result, choice, progress)


def evaluation(result: EvaluationResult, choice: Choice, progress: Progress) -> Chapter:
    """Several policies on one list of scenarios."""
    name, scenarios = result.suite or "sampled", result.scenarios
    rows = by_objective(result.results)
    table = {name: score_table(rows, result.refused)}
    return Chapter(
        title=f"Evaluation: {name}",
        lead=f"{len(rows)} policies on {counted(len(scenarios), 'episode')}.",
        blocks=[
            *(advice({name: rows}) if result.axes else []),
            *front(rows, result.axes),
            replay(scenarios, rows, result.axes, choice, progress),
            Tables("Scores", about_scores(rows), "suite", table),
            *conditions("suite", name, scenarios),
            provenance(result.provenance),
        ],
        policies=list(rows),
        verdict=verdict(rows),
        motion=motion(rows),
        robots=robots({name: scenarios}),
    )


def leaderboard(result: LeaderboardResult, choice: Choice, progress: Progress) -> Chapter:
    """Every policy on every suite."""
    scenarios, main, rows = result.board.suites(), result.board.main, result.main
    tables = {
        name: score_table(rows, result.refused.get(name, {}))
        for name, rows in result.suites.items()
    }
    known = {name: scenarios[name] for name in result.suites if name in scenarios}
    return Chapter(
        title=f"Leaderboard of usm-gym {result.version}",
        lead=f"{len(rows)} policies on {len(tables)} suites; {main}, with "
        f"{len(scenarios[main])} episodes, is the main one.",
        blocks=[
            *advice(result.tiers),
            plots.front(result.tiers, result.front),
            replay(scenarios[main], rows, result.axes, choice, progress),
            Tables("Scores", about_scores(rows), "suite", tables),
            Tables("Conditions", CONDITIONS, "suites", {"all": conditions_table(known)}),
            provenance(result.provenance),
        ],
        policies=list(dict.fromkeys(id for rows in result.suites.values() for id in rows)),
        verdict=verdict(rows),
        motion=motion(rows),
        robots=robots(known),
    )


def robustness(result: RobustnessResult, choice: Choice, progress: Progress) -> Chapter:
    """Error against one quantity."""
    scenarios, label = result.scenarios, result.label
    return Chapter(
        title=f"Robustness: {result.quantity}",
        lead=f"How the errors of {len(result.results)} policies grow with one quantity, with all "
        f"else equal, over {len(scenarios)} episodes at every value: {label}.",
        blocks=[
            *([plots.robustness(result)] if result.axes else []),
            Tables(
                "Errors",
                "Largest position error after settling, mm: mean with its 95 % interval, by "
                f"{label}.",
                "quantity",
                {label: curve_table(result)},
            ),
            replay(scenarios, dict.fromkeys(result.results), result.axes, choice, progress),
            *conditions(
                "suite",
                "scenarios",
                scenarios,
                " These are the conditions before anything is varied.",
            ),
            provenance(result.provenance),
        ],
        policies=list(result.results),
        robots=robots({result.quantity: scenarios}),
    )


def reproduction(result: ReproductionResult, choice: Choice, progress: Progress) -> Chapter:
    """The paper's Table 1, and its operation mode as a replay at the paper's step."""
    rows, paper, step = result.rows, result.paper, result.step
    own = "no policies: a reproduction has its own laws"
    require(choice.policies is None, "--policies", "given", own)
    require(choice.scenario == 0, "--scenario", choice.scenario, "0: a reproduction has one")
    chosen = {case.row: case for case in cases(step) if case.mode == "operation"}
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
        for axis in result.axes
    ]
    return Chapter(
        title="Reproduction of Table 1",
        lead=f"The paper's laws as printed, at a step of {step:g} s, thrusters unlimited.",
        blocks=[
            Tables(
                "Table 1",
                "Largest absolute position error after settling; settled leaves out the 7 s after "
                "each change of the joint references. The ratio of ours to the paper's is between "
                f"{figures(min(ratios))} and {figures(max(ratios))}.",
                "table",
                {"Table 1": paper_table(result)},
            ),
            Replay(
                "Operation mode, replayed",
                "The joints jump at the dashed lines.",
                recorded(scenario, records),
                ("sta", "pd"),
            ),
            provenance(result.provenance),
        ],
        policies=list(rows),
        robots=robots({"Table 1": [scenario]}),
    )


def study(result: StudyResult, choice: Choice, progress: Progress) -> Chapter:
    """Trained agents beside the classical policies, tier by tier; the first one is replayed."""
    homes = result.homes.items()
    top, first = next(iter(homes))
    rows = by_objective({name: row.home for name, row in first.competitors.items()})
    episodes = {name: sampled(home, result) for name, home in homes}
    tables = [pair for name, home in homes for pair in sets(name, home).items()]
    return Chapter(
        title="Study of learned agents",
        lead=f"Agents of {len(homes)} tiers with several seeds, and what their parts contribute.",
        blocks=[
            replay(episodes[top], rows, first.axes, choice, progress),
            Tables(
                "Scores",
                f"{about_scores(rows)} All seeds together; intervals resample seeds and scenarios.",
                "where",
                {title: score_table(scores, {}) for title, scores in tables},
            ),
            *(plot for name, home in homes for plot in drawn(name, home)),
            provenance(result.provenance),
        ],
        policies=list(dict.fromkeys(policy for _, home in homes for policy in home.rows)),
        verdict=verdict(rows),
        motion=motion(rows),
        robots=robots(episodes),
    )


def sampled(home: HomeResult, result: StudyResult) -> list[AnyScenario]:
    """The scenarios on which the policies of a home are scored."""
    conditions = presets_of(home.mode)[home.tier.removesuffix(IN_SPACE)]
    return unseen(home.mode, conditions, result.seed, result.episodes)


def sets(name: str, home: HomeResult) -> dict[str, dict[str, Scores]]:
    """The scores of a home's policies by the name of the table: at home, and elsewhere."""
    tables: dict[str, dict[str, Scores]] = {}
    for policy, row in home.rows.items():
        places = {name: row.home, **{f"{name} to {to}": it for to, it in row.elsewhere.items()}}
        for title, scores in places.items():
            tables.setdefault(title, {})[row.label(policy)] = scores
    return tables


def drawn(name: str, home: HomeResult) -> list[Plot]:
    """The plots of a home."""
    found = [plots.learning(rows, home.axes) for rows in (home.agents, home.ablations) if rows]
    rows = {policy: row.home for policy, row in home.competitors.items()}
    found.append(plots.front({name: rows}, {}))
    return [replace(plot, title=f"{plot.title}: {name}") for plot in found]


CHAPTERS: dict[type[Result], Callable[[Any, Choice, Progress], Chapter]] = {
    EvaluationResult: evaluation,
    LeaderboardResult: leaderboard,
    RobustnessResult: robustness,
    ReproductionResult: reproduction,
    StudyResult: study,
}


def advice(tiers: Mapping[str, Mapping[str, CompetitorScores]]) -> list[Tables]:
    """Which policy to take, by tier; nothing where there is no choice."""
    tables = {name: verdict_table(rows) for name, rows in tiers.items() if len(rows) > 1}
    lead = "What each is the best of. Rows share a rank (=) until the data tell one from the first."
    return [Tables("Which controller to take", lead, "tier", tables)] if tables else []


def conditions(label: str, name: str, scenarios: Scenarios, besides: str = "") -> list[Tables]:
    """The conditions of a result, if its scenarios are of a robot of this package."""
    known = [scenario for scenario in scenarios if not isinstance(scenario, OtherScenario)]
    if len(known) < len(scenarios):
        return []
    table = {name: conditions_table({name: known})}
    return [Tables("Conditions", CONDITIONS + besides, label, table)]


def robots(lists: Mapping[str, Scenarios]) -> dict[str, AnyRobot | Manipulator]:
    """The robot of every list of scenarios, which share it, if it is one of this package."""
    first = {name: scenarios[0] for name, scenarios in lists.items()}
    known = {name: it for name, it in first.items() if not isinstance(it, OtherScenario)}
    return {name: scenario.body for name, scenario in known.items()}


def front(rows: Mapping[str, Scores], axes: Sequence[str]) -> list[Plot]:
    """Error against thrust variation, if there are scores."""
    return [plots.front({"": rows}, {})] if axes else []


def replay(
    scenarios: Scenarios,
    rows: Mapping[str, Scores | None],
    axes: Sequence[str],
    choice: Choice,
    progress: Progress,
) -> Replay | Facts:
    """Replay an episode of the policies of a result, or say why that is impossible.

    Args:
        scenarios: The scenarios of the result.
        rows: The policies, with the scores that they have on these scenarios.
        axes: The axes of the result.
        choice: What is replayed.
        progress: As of `chapter`.
    """
    index = choice.scenario
    require(index < len(scenarios), "--scenario", index, f"0 to {len(scenarios) - 1}")
    title = f"Episode {index}, replayed"
    scenario, done = scenarios[index], 0
    if isinstance(scenario, OtherScenario) or not in_axes(scenario, axes):
        known = "a replay draws robots of this package"
        return Facts("Replay", {"none": f"{known}, and this result is in {listed(axes)}"})
    contenders, missing = able(rows, choice)

    def advance() -> None:
        nonlocal done
        done += 1
        progress(done, len(contenders))

    episodes = replayed(contenders, scenario, choice.workers, advance)
    missing |= episodes.missing
    shown = list(episodes.data["episodes"])
    if not shown:
        return Facts(title, missing)
    notes = [f"{name} is not replayed: {why}" for name, why in missing.items()]
    changed = differing(episodes.max_error, episode_errors(rows, shown, index))
    if changed:
        notes.append(
            f"Not as in the result, because something has changed since: {', '.join(changed)}."
        )
    able_to_win = (name for name in shown if (row := rows.get(name)) is None or competes(row))
    best = next(able_to_win, shown[0])
    others = [name for name in shown if name != best]
    beside = PAPERS if PAPERS in others else others[0] if others else ""
    return Replay(title, in_words(scenario), episodes.data, (best, beside), notes)


def in_axes(scenario: AnyScenario, axes: Sequence[str]) -> bool:
    """Whether the errors of a result are in the axes of its scenario, if it has any."""
    return not axes or tuple(axes) == world_of(scenario.body).axes


def episode_errors(
    rows: Mapping[str, Scores | None], names: Sequence[str], index: int
) -> dict[str, tuple[float, ...]]:
    """The largest errors of an episode in each axis, m, of the policies with scores."""
    known = {name: row for name in names if (row := rows.get(name)) and index < row.episodes}
    return {
        name: tuple(row.per_episode[MAX_ERROR + axis][index] for axis in row.axes)
        for name, row in known.items()
    }


def able(
    rows: Mapping[str, Scores | None], choice: Choice
) -> tuple[list[Contender], dict[str, str]]:
    """The policies to replay, and the reasons why others are not replayed.

    A file of results cannot make the page open or run anything: only its names of registered
    policies count, unless the user gives a name as well.
    """
    if choice.policies is not None:
        return list(choice.policies), {}
    known = [name for name in rows if name in ids()]
    why = "only registered policies are replayed unasked; name others with --policies"
    return [contender(name) for name in known], {name: why for name in rows if name not in known}


def provenance(source: Provenance) -> Facts:
    """The provenance of a result."""
    packages = ", ".join(f"{name} {version}" for name, version in source.packages.items())
    seeds = "; ".join(f"{name}: {_listed(value)}" for name, value in source.seeds.items())
    version = f"usm-gym {source.version}, commit {source.commit or 'unknown'}"
    facts = {"command": source.command, "version": version, "packages": packages, "seeds": seeds}
    return Facts("Where this comes from", facts)


def _listed(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
