"""Options for policies and scenarios, which `usm evaluate`, `compare` and others share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from joblib import cpu_count
from usm_agents.policies import named
from usm_baselines.benchmark.scoring import (
    TIME_LIMIT,
    Job,
    Refusal,
    score_all,
)
from usm_baselines.contender import Contender
from usm_baselines.tiers import TIERS, competitors, short_list

from usm_cli.options import add_computing, add_mode, computing, count, parse_conditions
from usm_cli.terminal import progress_bar
from usm_gym.evaluation import BATCH, Evaluation
from usm_gym.suites import NAMES, suite, unseen
from usm_gym.support.files import read_json
from usm_gym.support.validation import explaining, require
from usm_gym.task.conditions import PRESETS
from usm_gym.task.modes import AnyMode, AnyScenario, presets_of, read_scenario
from usm_gym.task.nominal import shared_nominal

# Stands for all competitors among the names of policies.
ALL = "all"
POLICIES = """\
A policy is an id (see usm policies), ID@gains.json with gains from `usm tune`, the folder of an
agent from `usm train`, or my_module:MyController, your own class or function with the predict
method of Stable-Baselines3 (docs/own_controller.md).
"""
DEFAULT = "a short list; `all` stands for all competitors meant for the conditions"
# A process takes as long to start as it takes to score some three policies on fifty episodes.
EPISODES_PER_PROCESS = 150


def add_policies(parser: argparse.ArgumentParser, default: str = DEFAULT) -> None:
    """Add the option that names policies."""
    parser.add_argument(
        "--policies", metavar="A,B", help=f"names, separated by commas (default: {default})"
    )


def add_scenarios(parser: argparse.ArgumentParser, single: bool = False) -> None:
    """Add the options that choose scenarios, or a single one."""
    add = parser.add_argument
    add(
        "--suite",
        metavar="NAME",
        help=f"frozen suite ({', '.join(NAMES)}; default: operation, or that of the conditions) or "
        "a file of scenarios",
    )
    add("--seed", type=int, metavar="S", help="sample scenarios with this seed instead")
    if single:
        add("--scenario", type=int, metavar="I", help="which scenario, from 0 (default: 0)")
        parser.set_defaults(episodes=None)
    else:
        add("--episodes", type=int, metavar="N", help="number of sampled scenarios (default: 50)")
    add_mode(parser, default=None)
    add(
        "--conditions",
        metavar="C",
        help=f"{', '.join(PRESETS)}, or a JSON object of fields that differ from field; replaces "
        "the conditions of a suite (default: those of the suite, or field)",
    )


def add_scoring(parser: argparse.ArgumentParser) -> None:
    """Add the options for scoring."""
    add_computing(parser, "one per core, if there is enough to do")
    parser.add_argument(
        "--time-limit",
        type=float,
        default=TIME_LIMIT,
        metavar="S",
        help=f"how long a controller of your own may think in a batch of up to {BATCH} episodes, "
        f"s (default: {TIME_LIMIT:g})",
    )


def chosen_contenders(names: str | None, scenario: AnyScenario) -> list[Contender]:
    """Get the policies that `--policies` names, or the short list for scenarios like one."""
    meant = scenario.conditions, scenario.mode
    if names is None:
        return [named(id) for id in short_list(*meant)]
    listed = [[name] if name != ALL else competitors(*meant) for name in split(names)]
    return [named(name) for name in dict.fromkeys(chain.from_iterable(listed))]


def named_contenders(names: str) -> list[Contender]:
    """Get policies by their names, separated by commas."""
    return [named(name) for name in dict.fromkeys(split(names))]


def split(names: str) -> list[str]:
    """Split the names of policies at the commas."""
    chosen = [name.strip() for name in names.split(",") if name.strip()]
    require(len(chosen) > 0, "--policies", names, "one name or more")
    return chosen


def sampled(arguments: argparse.Namespace) -> bool:
    """Whether scenarios are to be sampled."""
    return any(value is not None for value in (arguments.seed, arguments.episodes, arguments.mode))


def suite_name(arguments: argparse.Namespace) -> str | None:
    """The name of the chosen suite; None if scenarios are sampled.

    The conditions of a tier have a suite of their own, as their joint motion is another.
    """
    tier = arguments.conditions
    default = f"operation-{tier}" if tier in TIERS else "operation"
    return None if sampled(arguments) else arguments.suite or default


def seeds(arguments: argparse.Namespace) -> dict[str, Any]:
    """The origin of the scenarios, for the provenance."""
    name = suite_name(arguments)
    return {"seed": arguments.seed or 0} if name is None else {"suite": name}


def chosen_scenarios(arguments: argparse.Namespace) -> list[AnyScenario]:
    """Get the scenarios that the options choose."""
    given, name = arguments.conditions, suite_name(arguments)
    if name is not None:
        scenarios = read_suite(name)
        if given is None:
            return scenarios
        return [each.under(parse_conditions(given, each.mode)) for each in scenarios]
    require(
        arguments.suite is None,
        "--suite",
        arguments.suite,
        "no suite together with --seed, --episodes or --mode",
    )
    episodes = count(arguments, "episodes", 50)
    seed = count(arguments, "seed", 0, least=0)
    mode: AnyMode = arguments.mode or "operation"
    conditions = presets_of(mode)["field"] if given is None else parse_conditions(given, mode)
    return unseen(mode, conditions, seed, episodes)


def chosen_scenario(arguments: argparse.Namespace) -> AnyScenario:
    """Get the one scenario that the options choose."""
    index = count(arguments, "scenario", 0, least=0)
    if sampled(arguments):
        arguments.episodes = index + 1
    scenarios = chosen_scenarios(arguments)
    require(index < len(scenarios), "--scenario", index, f"0 to {len(scenarios) - 1}")
    return scenarios[index]


def read_suite(name: str) -> list[AnyScenario]:
    """Read the scenarios of a frozen suite, or of a JSON file with a list of them."""
    if not name.endswith(".json"):
        return suite(name)
    with explaining(f"{name} is no file of scenarios"):
        document = read_json(name)
        listed: Any = document.get("scenarios") if isinstance(document, dict) else None
        require(isinstance(listed, list) and listed, "scenarios", listed, "a list of one or more")
    scenarios = []
    for index, data in enumerate(listed):
        with explaining(f"{name}, scenario {index}"):
            scenarios.append(read_scenario(data))
    return scenarios


def jobs(
    contenders: Iterable[Contender], scenarios: Sequence[AnyScenario], time_limit: float
) -> list[Job]:
    """Make one job per policy, all with the same scenarios.

    Raises:
        ValueError: If a policy cannot be made from the nominal knowledge of the scenarios.
    """
    nominal = shared_nominal(scenarios)
    listed = []
    for contender in contenders:
        contender.make(nominal)
        listed.append(Job(contender, tuple(scenarios), nominal, time_limit))
    return listed


def scored(
    chosen: Sequence[Job], arguments: argparse.Namespace, cache: Path | None = None
) -> list[Evaluation | Refusal]:
    """Run jobs with the workers of the options, and show a progress bar."""
    total = sum(len(job.scenarios) for job in chosen)
    enough = max(1, min(cpu_count(), total // EPISODES_PER_PROCESS))
    with computing(arguments, enough) as workers, progress_bar() as bar:
        line = bar.add_task("episodes", total=total)
        return score_all(chosen, workers, cache, lambda episodes: bar.advance(line, episodes))


def by_name(
    chosen: Sequence[Job], outcomes: Sequence[Evaluation | Refusal]
) -> tuple[dict[str, Evaluation], dict[str, str]]:
    """The scores of jobs by policy, and the reasons of the policies without scores."""
    scores: dict[str, Evaluation] = {}
    refused: dict[str, str] = {}
    for job, outcome in zip(chosen, outcomes, strict=True):
        if isinstance(outcome, Refusal):
            refused[job.contender.name] = outcome.reason
        else:
            scores[job.contender.name] = outcome
    return scores, refused


def leave_if_refused(refused: Mapping[str, str]) -> None:
    """Print the refused policies, one per line, and exit with status 1 if there are any."""
    for name, reason in refused.items():
        print(f"usm: {name} is refused: {reason}", file=sys.stderr)
    if refused:
        sys.exit(1)
