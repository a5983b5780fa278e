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
from usm_gym.task.modes import AnyMode, AnyScenario, read_scenario, sample_of

NAMES = (
    "operation",
    "operation-ideal",
    "operation-basin",
    "operation-sea",
    "torpedo",
    "torpedo-sea",
    "table1",
    "operation3d",
    "operation3d-basin",
    "operation3d-sea",
    "operation3d-neutral",
    "torpedo3d",
    "head",
    "head-basin",
    "head3d",
    "head3d-basin",
)


def suite(name: str) -> list[AnyScenario]:
    """The scenarios of a frozen suite.

    Raises:
        ValueError: If there is none of that name.
    """
    require(name in NAMES, "suite", name, ", ".join(NAMES))
    return list(_read(name))


def unseen(mode: AnyMode, conditions: Conditions, seed: int, episodes: int) -> list[AnyScenario]:
    """Scenarios sampled under a seed, which no training and no tuning ever meets."""
    return [sample_of(mode, conditions, stream(seed, EVALUATION, i)) for i in range(episodes)]


@cache
def _read(name: str) -> tuple[AnyScenario, ...]:
    text = files(__package__).joinpath(f"{name}.json").read_text(encoding="utf-8")
    return tuple(read_scenario(data) for data in json.loads(text)["scenarios"])
