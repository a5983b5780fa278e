"""What scores and scenarios say, in sentences."""

from __future__ import annotations

from collections.abc import Mapping

from usm_cli.report.tables import ERRORS, Row
from usm_gym.statistics import FEWEST_EPISODES
from usm_gym.support.text import mm
from usm_gym.task.metrics import RECOVERY
from usm_gym.task.scenario import Scenario

# The paper's controller, beside which the best one is shown.
PAPERS = "sta"


def total(row: Row) -> float:
    """What rows are ordered by: the mean errors in x and y, m."""
    return sum(float(row[name]["mean"]) for name in ERRORS)


def pair(row: Row, score: str) -> str:
    """Mean errors in x and y in words."""
    x, y = (mm(row[f"{score}_{axis}"]["mean"]) for axis in "xy")
    return f"{x} mm in x and {y} mm in y"


def competitors(rows: Mapping[str, Row]) -> dict[str, Row]:
    """The rows of those that are told no more than a vehicle knows and lost no robot."""
    return {name: row for name, row in rows.items() if row["competitor"] and row["failures"] == 0}


def motion(rows: Mapping[str, Row]) -> str:
    """What the joint motion does to the controller that it harms most."""
    known = competitors(rows)
    if not known:
        return ""

    def calm(row: Row) -> float:
        return sum(float(row[f"settled_error_{axis}"]["mean"]) for axis in "xy")

    name, row = max(known.items(), key=lambda pair: total(pair[1]) / calm(pair[1]))
    return (
        f"With {name} the error reaches {pair(row, 'max_error')}, but only "
        f"{pair(row, 'settled_error')} outside the {RECOVERY:g} s after each motion of the joints."
    )


def verdict(rows: Mapping[str, Row], episodes: int) -> str:
    """Which controller copes best, beside the paper's."""
    known = competitors(rows)
    if not known:
        return ""
    best = min(known, key=lambda name: total(known[name]))
    said = (
        f"The best, {best}, keeps it to {pair(known[best], 'max_error')}, mean of {episodes} "
        f"episodes{'' if episodes >= FEWEST_EPISODES else ', too few for a conclusion'}."
    )
    if PAPERS in rows and best != PAPERS:
        said += f" The paper's {PAPERS} comes to {pair(rows[PAPERS], 'max_error')}."
    return said


def in_words(scenario: Scenario) -> str:
    """A scenario in a sentence or two."""
    path, water, conditions = scenario.path, scenario.water, scenario.conditions
    parts = [f"{scenario.mode} mode, {scenario.duration:g} s, at {100 * path.speed:.1f} cm/s"]
    if scenario.shifts:
        bends = zip(scenario.inspection.deflections, scenario.shifts, strict=True)
        listed = ", ".join(f"{angle:+.2f} rad at {time:.1f} s" for angle, time in bends)
        listed = listed.replace("-", "−")
        parts.append(f"the last {scenario.inspection.bending_joints} joints bend by {listed}")
    current = (sum(each**2 for each in water.current)) ** 0.5
    parts.append(f"current {100 * current:.1f} cm/s")
    low, high = min(water.coefficients), max(water.coefficients)
    parts.append(f"true coefficients {low:.2f} to {high:.2f} of the nominal ones")
    parts.append(f"position noise {1e3 * conditions.position_noise:g} mm")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."
