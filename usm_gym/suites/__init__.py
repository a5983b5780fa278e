"""The frozen suites: lists of scenarios that every published score refers to.

Each was written once by `python -m usm_gym.suites NAME`, which never overwrites one. Agents and
gains are never tuned on them.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files

from usm_gym.scenario import Scenario
from usm_gym.validation import require

NAMES = ("operation", "operation-ideal", "operation-rough", "torpedo", "table1")


def suite(name: str) -> list[Scenario]:
    """The scenarios of a frozen suite.

    Raises:
        ValueError: If there is none of that name.
    """
    require(name in NAMES, "suite", name, ", ".join(NAMES))
    return list(_read(name))


@cache
def _read(name: str) -> tuple[Scenario, ...]:
    text = files(__package__).joinpath(f"{name}.json").read_text(encoding="utf-8")
    return tuple(Scenario.from_dict(data) for data in json.loads(text)["scenarios"])
