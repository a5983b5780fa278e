"""The plots of a page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from usm_agents.study.results import Trained
from usm_baselines.benchmark.leaderboard import FrontPoint
from usm_baselines.benchmark.results import Scores, axes_in
from usm_baselines.benchmark.robustness import RobustnessResult, ScoredPoint

from usm_cli.report.blocks import Plot
from usm_cli.report.tables import competes

VARIATION = "thrust variation, N/s"
# Errors over so many times the best one are not drawn.
REACH = 100.0


@dataclass(frozen=True)
class Band:
    """Errors at one point of a curve.

    Attributes:
        value: Its place on the axis.
        errors: Lower limit, mean and upper limit by axis, m; empty if there are none.
    """

    value: float
    errors: Mapping[str, tuple[float, float, float]]


def front(
    tiers: Mapping[str, Mapping[str, Scores]], weights: Mapping[str, Sequence[FrontPoint]]
) -> Plot:
    """Plot error against thrust variation, and mark the policies that no other beats in both.

    Args:
        tiers: Rows of the policies by the name of the panel.
        weights: Points of policies tuned with other weights, by id, for the first panel.
    """
    besides = f" The thin line joins other weights of {', '.join(weights)}." if weights else ""
    panels: list[dict[str, Any]] = []
    missing = 0
    for name, rows in tiers.items():
        points: list[dict[str, Any]] = [
            {"name": id, "x": variation, "y": 1e3 * row.combined[0]}
            for id, row in rows.items()
            if competes(row)
            and not row.failures
            and (variation := row.metrics["thrust_variation"].mean) > 0
        ]
        seen = within_reach(points)
        missing += len(points) - len(seen)
        lines = [
            {
                "name": f"{id}, other weights",
                "x": [point.thrust_variation for point in line],
                "y": [1e3 * sum(point.errors.values()) for point in line],
            }
            for id, line in (weights if not panels else {}).items()
        ]
        error = f"error {' + '.join(axes_in(rows.values()))}, mm"
        panels.append(
            {
                "label": f"{name}: {error}" if len(tiers) > 1 else error,
                "points": [point | {"front": not beaten(point, points)} for point in seen],
                "lines": lines,
            }
        )
    far = (
        f" {missing} with errors over {REACH:g} times the best one are not drawn."
        if missing
        else ""
    )
    return Plot(
        "What precision costs",
        "Largest error after settling against how much the thrust changes in a second; left and "
        f"below is better. Filled points are policies that no other beats in both.{besides}{far}",
        {
            "kind": "points",
            "x": {"label": VARIATION, "log": True},
            "y": {"log": True},
            "panels": [panel for panel in panels if panel["points"]],
        },
    )


def within_reach(points: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The points that can be read on one scale with the best."""
    best = min((point["y"] for point in points), default=0.0)
    return [point for point in points if point["y"] <= REACH * best]


def beaten(point: Mapping[str, Any], points: Sequence[Mapping[str, Any]]) -> bool:
    """Whether another point is better in one coordinate and no worse in the other."""
    here = point["x"], point["y"]
    return any(
        other["x"] <= here[0] and other["y"] <= here[1] and (other["x"], other["y"]) != here
        for other in points
    )


def robustness(result: RobustnessResult) -> Plot:
    """Plot error against a quantity, with intervals."""
    curves = {
        name: [
            Band(
                point.value,
                {axis: (e.ci95[0], e.mean, e.ci95[1]) for axis, e in point.errors.items()}
                if isinstance(point, ScoredPoint)
                else {},
            )
            for point in points
        ]
        for name, points in result.results.items()
    }
    return error_curves(
        "Error curves",
        "Largest position error after settling, mean over the episodes; the shade is its 95 % "
        "interval.",
        curves,
        result.axes,
        result.label,
    )


def learning(rows: Mapping[str, Trained], axes: Sequence[str]) -> Plot:
    """Plot error against the steps of a training, from the best seed to the worst."""
    curves: dict[str, list[Band]] = {}
    for name, row in rows.items():
        curves[name] = []
        for points in zip(*row.curves.values(), strict=False):
            errors = {axis: [point.errors[axis] for point in points] for axis in axes}
            bands = {axis: (min(e), sum(e) / len(e), max(e)) for axis, e in errors.items()}
            curves[name].append(Band(points[0].steps / 1e6, bands))
    return error_curves(
        "Learning curves",
        "Largest position error after settling on held-out scenarios; mean over the seeds, shaded "
        "from the best to the worst.",
        curves,
        axes,
        "million steps",
    )


def error_curves(
    title: str,
    text: str,
    curves: Mapping[str, Sequence[Band]],
    axes: Iterable[str],
    label: str,
) -> Plot:
    """Plot the errors in each axis against a quantity."""
    panels = []
    for axis in axes:
        series = []
        for name, bands in curves.items():
            known = [band.errors.get(axis) for band in bands]
            low, mean, high = (
                [None if limits is None else 1e3 * limits[k] for limits in known] for k in range(3)
            )
            values = [band.value for band in bands]
            series.append({"name": name, "x": values, "y": mean, "low": low, "high": high})
        panels.append({"label": f"error in {axis}, mm", "series": series})
    return Plot(
        title,
        text,
        {
            "kind": "curves",
            "x": {"label": label, "log": False},
            "y": {"log": True},
            "panels": panels,
        },
    )
