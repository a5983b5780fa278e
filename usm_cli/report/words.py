"""Describes scores and scenarios in sentences."""

from __future__ import annotations

from collections.abc import Mapping

from usm_baselines.benchmark.results import Scores

from usm_cli.report.tables import competes
from usm_gym.statistics import FEWEST_EPISODES
from usm_gym.support.text import listed, mm
from usm_gym.task.metrics import RECOVERY
from usm_gym.task.scenario import Scenario

# The paper's controller, with which the best one is compared.
PAPERS = "sta"


def in_axes(row: Scores, metric: str) -> str:
    """Write the mean of a metric in each axis."""
    errors = row.by_axis(metric).items()
    return listed([f"{mm(error.mean)} mm in {axis}" for axis, error in errors])


def competitors(rows: Mapping[str, Scores]) -> dict[str, Scores]:
    """The rows of policies that know no more than a vehicle does and lost no robot."""
    return {name: row for name, row in rows.items() if competes(row) and row.failures == 0}


def motion(rows: Mapping[str, Scores]) -> str:
    """Describe what joint motion does to the controller that it harms most."""

    def total(row: Scores, metric: str) -> float:
        return sum(error.mean for error in row.by_axis(metric).values())

    def harm(row: Scores) -> float:
        return total(row, "max_error") / total(row, "settled_error")

    known = {
        name: row for name, row in competitors(rows).items() if total(row, "settled_error") > 0
    }
    if not known:
        return ""
    name, row = max(known.items(), key=lambda pair: harm(pair[1]))
    return (
        f"With {name} the error reaches {in_axes(row, 'max_error')}, but only "
        f"{in_axes(row, 'settled_error')} outside the {RECOVERY:g} s after each motion of the "
        "joints."
    )


def verdict(rows: Mapping[str, Scores], episodes: int) -> str:
    """Compare the best controller with the paper's."""
    known = competitors(rows)
    if not known:
        return ""
    best = min(known, key=lambda name: known[name].objective)
    said = (
        f"The best, {best}, keeps it to {in_axes(known[best], 'max_error')}, the mean of "
        f"{episodes} episodes{'' if episodes >= FEWEST_EPISODES else ', too few for a conclusion'}."
    )
    if PAPERS in rows and best != PAPERS:
        said += f" The paper's {PAPERS} comes to {in_axes(rows[PAPERS], 'max_error')}."
    return said


def in_words(scenario: Scenario) -> str:
    """Describe a scenario in a sentence or two."""
    path, water, conditions = scenario.path, scenario.water, scenario.conditions
    parts = [f"{scenario.mode} mode, {scenario.duration:g} s, at {100 * path.speed:.1f} cm/s"]
    if scenario.shifts:
        bends = zip(scenario.inspection.deflections, scenario.shifts, strict=True)
        listed = ", ".join(f"{angle:+.2f} rad at {time:.1f} s" for angle, time in bends)
        listed = listed.replace("-", "−")
        parts.append(f"the last {scenario.inspection.bending_joints} joints bend by {listed}")
    current = sum(speed**2 for speed in water.current) ** 0.5
    parts.append(f"current {100 * current:.1f} cm/s")
    low, high = min(water.coefficients), max(water.coefficients)
    parts.append(f"true coefficients {low:.2f} to {high:.2f} of the nominal ones")
    parts.append(f"position noise {1e3 * conditions.position_noise:g} mm")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."
