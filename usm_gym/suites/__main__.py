"""Write a frozen suite; refuses to write one that exists."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from usm_gym.suites import NAMES
from usm_gym.support.files import write_text
from usm_gym.support.seeding import SUITE, stream
from usm_gym.support.validation import require
from usm_gym.task.modes import AnyMode, AnyScenario, presets_of, sample_of
from usm_gym.task.sampling import named
from usm_gym.task.scenario import MODES

SEED = 20261122
# Mode, conditions, number of scenarios, and the key of their streams; 2 has been a suite's before.
RECIPES: dict[str, tuple[AnyMode, str, int, int]] = {
    "operation": ("operation", "field", 50, 0),
    "operation-ideal": ("operation", "ideal", 20, 1),
    "operation-basin": ("operation", "basin", 50, 4),
    "operation-sea": ("operation", "sea", 50, 5),
    "torpedo": ("torpedo", "field", 50, 3),
    "torpedo-sea": ("torpedo", "sea", 50, 6),
    "operation3d": ("operation3d", "field", 50, 7),
    "operation3d-basin": ("operation3d", "basin", 50, 8),
    "operation3d-sea": ("operation3d", "sea", 50, 9),
    "operation3d-neutral": ("operation3d", "field", 50, 10),
    "torpedo3d": ("torpedo3d", "field", 50, 11),
    "head": ("head", "field", 50, 12),
    "head-basin": ("head", "basin", 50, 13),
    "head3d": ("head3d", "field", 50, 14),
    "head3d-basin": ("head3d", "basin", 50, 15),
}
# Suites of other robots than the paper's and Eely.
ROBOTS = {"operation3d-neutral": "eely-neutral"}


def scenarios(name: str) -> list[AnyScenario]:
    """Draw the scenarios of a suite."""
    if name == "table1":
        return [named("table1", mode) for mode in MODES]
    mode, conditions, count, key = RECIPES[name]
    preset, robot = presets_of(mode)[conditions], ROBOTS.get(name)
    return [sample_of(mode, preset, stream(SEED, SUITE, key, i), robot) for i in range(count)]


def main(name: str, folder: Path = Path(__file__).parent) -> None:
    """Write the suite of a name into a folder, by default beside this file."""
    require(name in NAMES, "suite", name, ", ".join(NAMES))
    path = folder / f"{name}.json"
    require(not path.exists(), "suite", name, "one that is not frozen yet")
    lines = ",\n".join("  " + json.dumps(scenario.to_dict()) for scenario in scenarios(name))
    head = json.dumps({"suite": name, "seed": SEED, "command": f"python -m usm_gym.suites {name}"})
    write_text(path, f'{head[:-1]}, "scenarios": [\n{lines}\n]}}\n')


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(f"usage: python -m usm_gym.suites {{{','.join(NAMES)}}}")
    main(sys.argv[1])
