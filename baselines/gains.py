"""Files of gains, as `usm tune` writes them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from usm_gym.validation import Number, in_one_line

# Shipped gains: ID.json is registered as ID-tuned; those in FRONT were tuned with other weights on
# thrust variation, and show what a law can do at less or more of it.
TUNED = Path(__file__).with_name("tuned")
FRONT = TUNED / "front"


@dataclass(frozen=True)
class Budget:
    """What a tuning may cost, the same for every policy that is compared.

    Attributes:
        trials: How many sets of gains are tried.
        episodes: On how many scenarios.
    """

    trials: int
    episodes: int


@dataclass(frozen=True)
class GainsFile:
    """What a file of gains has to say to make a policy; more is for its readers.

    Attributes:
        policy: Id of the policy.
        gains: Its gains by name; those not named are the policy's own.
        budget: What the tuning cost.
        weight: Cost of thrust variation in the objective, mm per N/s.
    """

    policy: str
    gains: dict[str, Number]
    budget: Budget
    weight: Number


_ADAPTER = TypeAdapter(GainsFile)


def read_gains(path: str | Path) -> GainsFile:
    """Read a file of gains.

    Raises:
        ValueError: If it is none.
        OSError: If it cannot be read.
    """
    try:
        return _ADAPTER.validate_python(json.loads(Path(path).read_text(encoding="utf-8")))
    except ValueError as error:
        raise ValueError(f"{path} is no file of gains: {in_one_line(error)}") from error
