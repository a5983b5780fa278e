"""Files of gains, as `usm tune` writes them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter

from usm_gym.support.files import read_json
from usm_gym.support.validation import Count, Number, explaining
from usm_gym.task.conditions import Conditions, preset_of

# Of any law, in its own unit.
Gain = Annotated[Number, Field(ge=-1e12, le=1e12)]

# Shipped gains: ID.json in the folder of a suffix is registered as ID-SUFFIX. Those in FRONT were
# tuned with other weights on thrust variation, and show what a law can do at less or more of it.
TUNED = Path(__file__).with_name("tuned")
FRONT = TUNED / "front"
FOLDERS = {
    "tuned": "",
    "basin": "basin",
    "sea": "sea",
    "eely": "eely",
    "eely-basin": "eely/basin",
    "eely-sea": "eely/sea",
}


@dataclass(frozen=True)
class Budget:
    """What a tuning may cost, the same for every policy that is compared.

    Attributes:
        trials: How many sets of gains are tried, 1 to 1e6.
        episodes: On how many scenarios, 1 to 1e6.
    """

    trials: Annotated[Count, Field(le=1_000_000)]
    episodes: Annotated[Count, Field(le=1_000_000)]


@dataclass(frozen=True)
class GainsFile:
    """What a file of gains has to say to make a policy; more is for its readers.

    Attributes:
        policy: Id of the policy.
        gains: Its gains by name, -1e12 to 1e12; those not named are the policy's own.
        budget: What the tuning cost.
        weight: Cost of thrust variation in the objective, 0 to 1000 mm per N/s.
        conditions: Those of the scenarios; None if it does not say.
    """

    policy: str
    gains: dict[str, Gain]
    budget: Budget
    weight: Annotated[Number, Field(ge=0, le=1000)]
    conditions: Conditions | None = None

    @property
    def tuned_for(self) -> str:
        """The preset that the conditions are; empty if they are none."""
        return preset_of(self.conditions)


_ADAPTER = TypeAdapter(GainsFile)


def read_gains(path: str | Path) -> GainsFile:
    """Read a file of gains.

    Raises:
        ValueError: If it is none.
        OSError: If it cannot be read.
    """
    with explaining(f"{path} is no file of gains"):
        return _ADAPTER.validate_python(read_json(path))
