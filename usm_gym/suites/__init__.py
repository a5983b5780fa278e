"""The frozen suites: lists of scenarios that every published score refers to.

Each was written once by `python -m usm_gym.suites NAME`, which never overwrites one. Agents and
gains are never tuned on them.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files

from usm_gym.support.seeding import EVALUATION, stream
from usm_gym.support.validation import require
from usm_gym.task.conditions import Conditions
from usm_gym.task.sampling import sample
from usm_gym.task.scenario import Mode, Scenario

NAMES = (
    "operation",
    "operation-ideal",
    "operation-basin",
    "operation-sea",
    "torpedo",
    "torpedo-sea",
    "table1",
)


def suite(name: str) -> list[Scenario]:
    """The scenarios of a frozen suite.

    Raises:
        ValueError: If there is none of that name.
    """
    require(name in NAMES, "suite", name, ", ".join(NAMES))
    return list(_read(name))


def unseen(mode: Mode, conditions: Conditions, seed: int, episodes: int) -> list[Scenario]:
    """Scenarios sampled under a seed, which no training and no tuning ever meets."""
    return [sample(mode, conditions, stream(seed, EVALUATION, i)) for i in range(episodes)]


@cache
def _read(name: str) -> tuple[Scenario, ...]:
    text = files(__package__).joinpath(f"{name}.json").read_text(encoding="utf-8")
    return tuple(Scenario.from_dict(data) for data in json.loads(text)["scenarios"])
