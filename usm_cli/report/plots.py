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


@dataclass(frozen=True)
class Band:
    """Errors at one point of a curve.

    Attributes:
        value: Its place on the axis.
        errors: Lower limit, mean and upper limit by axis, m; empty if there are none.
    """

    value: float
    errors: Mapping[str, tuple[float, float, float]]


def front(rows: Mapping[str, Scores], weights: Mapping[str, Sequence[FrontPoint]]) -> Plot:
    """Plot error against thrust variation, and mark the policies that no other beats in both.

    Args:
        rows: Rows of the policies.
        weights: Points of policies tuned with other weights, by id.
    """
    besides = f" A line joins other weights of {', '.join(weights)}." if weights else ""
    variations = {name: row.metrics["thrust_variation"].mean for name, row in rows.items()}
    shown = {name: row for name, row in rows.items() if competes(row) and variations[name] > 0}
    panels = []
    for axis in axes_in(rows.values()):
        points: list[dict[str, Any]] = [
            {"name": name, "x": variations[name], "y": row.errors[axis].mean * 1e3}
            for name, row in shown.items()
        ]
        lines = [
            {
                "name": f"{name}, other weights",
                "x": [point.thrust_variation for point in line],
                "y": [1e3 * point.errors[axis] for point in line],
            }
            for name, line in weights.items()
        ]
        panels.append(
            {
                "label": f"error in {axis}, mm",
                "points": [point | {"front": not beaten(point, points)} for point in points],
                "lines": lines,
            }
        )
    return Plot(
        "Error against thrust variation",
        "Chattering thrusters easily buy a small error. Filled points are policies that no other "
        f"beats in both; left and below is better.{besides}",
        {
            "kind": "points",
            "x": {"label": VARIATION, "log": True},
            "y": {"log": True},
            "panels": panels,
        },
    )


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
