"""Scores of agents and their rivals on scenarios that no training has seen."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from usm_baselines.benchmark.scoring import Job, Refusal, score_all
from usm_baselines.contender import Contender, contender

from usm_agents.artifact.folder import agent_contender, told_with
from usm_agents.learning.plan import TEST_EPISODES, TEST_SEED
from usm_agents.study.claims import adaptation, against, over_seeds
from usm_agents.study.dissection import dissected
from usm_agents.study.plans import ABLATED, AGENTS, Home, home_of, rival_name, rivals_of
from usm_agents.study.results import Claim, HomeResult, Scored, StudyResult, Trained
from usm_agents.study.trainings import StudyTraining, require_alike
from usm_gym.evaluation import Evaluation
from usm_gym.suites import unseen
from usm_gym.support.results import Provenance
from usm_gym.support.validation import UsageError
from usm_gym.task.nominal import shared_nominal


class Key(NamedTuple):
    """What is scored.

    Attributes:
        home: The agents' home.
        policy: The folder's name of a training, or the name of a rival.
        where: Name of the set of scenarios.
    """

    home: Home
    policy: str
    where: str


Rivals = Mapping[Home, Mapping[str, Contender]]
Outcomes = Mapping[Key, Evaluation | Refusal]


def rivals(chosen: Sequence[StudyTraining]) -> dict[Home, dict[str, Contender]]:
    """The rivals of agents, home by home, by the name that tables show.

    Raises:
        ValueError: If there is no policy of a name.
        OSError: If a file of gains cannot be read.
    """
    names = dict.fromkeys(training.name for training in chosen)
    homes = dict.fromkeys(map(home_of, names))
    return {
        home: {name: contender(rival) for name, rival in rivals_of(home, names).items()}
        for home in homes
    }


def jobs(
    chosen: Sequence[StudyTraining], rivals: Rivals, episodes: int = TEST_EPISODES
) -> dict[Key, Job]:
    """What is scored: all policies at home, agents and rivals also elsewhere.

    Raises:
        ValueError: If the trainings of an agent differ in more than their seed.
    """
    require_alike(chosen)
    planned: dict[Key, Job] = {}
    for home, others in rivals.items():
        local = [training for training in chosen if home_of(training.name) == home]
        trained = {each.folder.name: agent_contender(str(each.folder)) for each in local}
        agents = {each.folder.name for each in local if each.name in AGENTS}
        for where, conditions in home.sets.items():
            count = episodes if where == home.tier else episodes // 2
            scenarios = unseen(home.mode, conditions, TEST_SEED, count)
            nominal = shared_nominal(scenarios)
            for name, policy in {**trained, **others}.items():
                if where == home.tier or name in agents or name in others:
                    planned[Key(home, name, where)] = Job(policy, tuple(scenarios), nominal)
    return planned


def score(
    planned: Mapping[Key, Job], workers: int, cache: Path, progress: Callable[[float], object]
) -> dict[Key, Evaluation | Refusal]:
    """Score policies.

    Raises:
        UsageError: If a policy is refused at home.
    """
    outcomes = dict(
        zip(planned, score_all(list(planned.values()), workers, cache, progress), strict=True)
    )
    for key, outcome in outcomes.items():
        if isinstance(outcome, Refusal) and key.where == key.home.tier:
            raise UsageError(f"{key.policy} is refused in {key.where}: {outcome.reason}")
    return outcomes


def study(
    chosen: Sequence[StudyTraining],
    rivals: Rivals,
    outcomes: Outcomes,
    episodes: int,
    provenance: Provenance,
) -> StudyResult:
    """All homes, each with a row per agent and ablation over its seeds, and one per rival."""
    return StudyResult(
        study="residual",
        seed=TEST_SEED,
        episodes=episodes,
        homes={
            home.name: at_home(
                home,
                [training for training in chosen if home_of(training.name) == home],
                rivals[home],
                outcomes,
            )
            for home in rivals
        },
        provenance=provenance,
    )


def at_home(
    home: Home,
    chosen: Sequence[StudyTraining],
    rivals: Mapping[str, Contender],
    outcomes: Outcomes,
) -> HomeResult:
    """The rows of a home and what follows from them."""
    rows: dict[str, Trained] = {}
    for name in dict.fromkeys(training.name for training in chosen):
        its = [training for training in chosen if training.name == name]
        plan = its[0].plan
        told = told_with(plan.base.partition("@")[0])
        row = scored(home, [each.folder.name for each in its], outcomes, told)
        rows[name] = Trained(
            **vars(row),
            base=plan.base,
            rival=rival_name(plan.base),
            command=plan.command(name),
            curves={str(training.plan.seed): training.curve for training in its},
        )
    others = {
        name: scored(home, [name], outcomes, rival.told, rival.privileged)
        for name, rival in rivals.items()
    }
    agents = {name: row for name, row in rows.items() if name in AGENTS}
    ablations = {name: row for name, row in rows.items() if name not in AGENTS}
    return HomeResult(
        tier=home.tier,
        mode=home.mode,
        agents=agents,
        ablations=ablations,
        rivals=others,
        against=claims(agents, ablations, others),
        transfer={name: transferred(row, others[row.rival]) for name, row in agents.items()},
        dissected=dissected(home, chosen),
    )


def scored(
    home: Home, policies: Sequence[str], outcomes: Outcomes, told: str, privileged: bool = False
) -> Scored:
    """One row of the scores of all seeds of a policy."""
    found: dict[str, list[Evaluation]] = {}
    refused: dict[str, str] = {}
    for where in home.sets:
        for policy in policies:
            outcome = outcomes.get(Key(home, policy, where))
            if isinstance(outcome, Refusal):
                refused[where] = outcome.reason
            elif outcome is not None:
                found.setdefault(where, []).append(outcome)
    here = over_seeds(found.pop(home.tier), by_shift=True)
    return Scored(
        told=told,
        privileged=privileged,
        home=here,
        elsewhere={where: over_seeds(parts) for where, parts in found.items()},
        refused=refused,
        adaptation=adaptation(here),
    )


def claims(
    agents: Mapping[str, Trained], ablations: Mapping[str, Trained], rivals: Mapping[str, Scored]
) -> dict[str, dict[str, Claim]]:
    """What agents are to every rival at home, and ablations to the ablated agent if it is there."""
    ablated = {ABLATED: agents[ABLATED]} if ABLATED in agents else {}
    return {
        name: {other: against(row.home, rows[other].home) for other in rows}
        for trained, rows in ((agents, rivals), (ablations, ablated))
        for name, row in trained.items()
    }


def transferred(agent: Trained, base: Scored) -> dict[str, Claim]:
    """What an agent is to its base elsewhere, wherever neither is refused."""
    return {
        where: against(scores, base.elsewhere[where])
        for where, scores in agent.elsewhere.items()
        if where in base.elsewhere
    }
