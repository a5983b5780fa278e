"""Describes scores, scenarios and policies in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from statistics import median

from usm_baselines.benchmark.results import CompetitorScores, Scores, attitude_in, prices
from usm_baselines.registry import base_of, entry, ids

from usm_cli.report.tables import competes
from usm_cli.score_table import combined_error, conclusion
from usm_gym.support.text import counted, figures, listed
from usm_gym.task.head_scenario import HeadEpisode
from usm_gym.task.modes import AnyScenario
from usm_gym.task.scenario import Scenario
from usm_gym.task.spatial_scenario import SpatialScenario

# The paper's controller, with which the best one is compared.
PAPERS = "sta"
CONDITIONS = (
    "What the simulation does to a controller. Every episode has another current and other "
    "coefficients, which no controller knows; all meet the same episodes and the same noise."
)
# Ends of the names of policies that are forms of others, as the glossary explains them.
FORMS = {
    "lag": "the same law, told the lag of the thrusters",
    "navigator": "the same law on the navigator's estimates",
    "tuned": "the same law with gains from usm tune, for field",
    "basin": "the same law with gains for basin",
    "sea": "the same law with gains for sea",
    "eely": "the same law with gains for the robot in space",
}


def about_scores(rows: Mapping[str, Scores]) -> str:
    """Say what a table of scores has."""
    return (
        "Largest position error after settling, mean over the episodes; rms is the root mean "
        "square, variation how much the thrust changes in a second. The objective orders the rows: "
        f"the error plus {prices(attitude_in(rows.values()))}. Rows share a rank (=) until the "
        "data tell one from the first of them. A lost robot counts 0.5 m or more."
    )


def motion(rows: Mapping[str, Scores]) -> str:
    """Say that most of the error comes from the joints, if it does."""
    known = [row for row in rows.values() if competes(row) and row.failures == 0]
    if not known:
        return ""

    def middle(metric: str) -> float:
        return 1e3 * median(sum(e.mean for e in row.by_axis(metric).values()) for row in known)

    then, otherwise = middle("max_error"), middle("settled_error")
    if otherwise > then / 2:
        return ""
    axes = " + ".join(known[0].axes)
    return (
        f"Most of the error comes right after a bend: {figures(then)} mm then, "
        f"{figures(otherwise)} mm otherwise ({axes}, median of "
        f"{counted(len(known), 'controller')})."
    )


def verdict(rows: Mapping[str, Scores]) -> str:
    """Say who wins, and where the paper's law is; rows: best first."""
    known = {name: row for name, row in rows.items() if competes(row)}
    if not known:
        return ""
    ranked = {name: row for name, row in known.items() if isinstance(row, CompetitorScores)}
    best = next(iter(known))
    said = (
        conclusion(ranked)
        if ranked
        else f"{best} is ahead with an error of {combined_error(known[best])} mm."
    )
    if PAPERS in rows and best != PAPERS:
        said += f" The paper's {PAPERS} comes to {combined_error(rows[PAPERS])} mm."
    return said


def in_words(scenario: AnyScenario) -> str:
    """Describe a scenario in a sentence or two."""
    water, conditions = scenario.water, scenario.conditions
    parts = [f"{scenario.mode} mode, {scenario.duration:g} s"]
    if isinstance(scenario, HeadEpisode):
        parts.append(figure(scenario))
    else:
        parts[0] += f", at {100 * scenario.path.speed:.1f} cm/s"
        if scenario.shifts:
            parts.append(bends(scenario))
    current = sum(speed**2 for speed in water.current) ** 0.5
    parts.append(f"current {100 * current:.1f} cm/s")
    low, high = min(water.coefficients), max(water.coefficients)
    parts.append(f"true coefficients {low:.2f} to {high:.2f} of the nominal ones")
    parts.append(f"position noise {1e3 * conditions.position_noise:g} mm")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."


def figure(scenario: HeadEpisode) -> str:
    """Say what the head traces."""
    positions = scenario.reference_positions()[-scenario.steps // 2 :]
    sizes = [f"{100 * size:.0f}" for size in positions.max(axis=0) - positions.min(axis=0)]
    return f"the head traces a figure of {' × '.join(sizes)} cm"


def bends(scenario: Scenario | SpatialScenario) -> str:
    """Say how the joints move, and when."""
    if isinstance(scenario, SpatialScenario):
        scan = scenario.scan
        looks = [direction(*angles) for angles in zip(scan.pans, scan.tilts, strict=True)]
        return f"the head looks {listed(_at(looks, scan.times))}"
    inspection = scenario.inspection
    angles = [f"{math.degrees(angle):+.0f}°" for angle in inspection.deflections]
    turned = listed(_at(angles, inspection.times)).replace("-", "−")
    return f"the last {inspection.bending_joints} joints bend by {turned}"


def _at(words: Iterable[str], times: Iterable[float]) -> list[str]:
    return [f"{word} at {time:.1f} s" for word, time in zip(words, times, strict=True)]


def direction(pan: float, tilt: float) -> str:
    """Say where a head looks that is turned to the left and up by angles, rad."""
    left, up = round(math.degrees(pan)), round(math.degrees(tilt))
    parts = [f"{abs(left)}° to the {'left' if left > 0 else 'right'}"] if left else []
    parts += [f"{abs(up)}° {'up' if up > 0 else 'down'}"] if up else []
    return " and ".join(parts) or "ahead"


def glossary(policies: Iterable[str]) -> dict[str, str]:
    """The meanings of the names of registered policies, a law once, and of the ends of names."""
    present = set(policies)
    shown = [id for id in ids() if id in present]
    meanings = {base_of(id): entry(base_of(id)).summary for id in shown}
    ends = {part for id in shown for part in id.removeprefix(base_of(id)).split("-")}
    return meanings | {f"…-{form}": text for form, text in FORMS.items() if form in ends}
