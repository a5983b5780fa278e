"""The plots of a page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from usm_cli.report.blocks import Plot
from usm_cli.report.tables import Row

VARIATION = "thrust variation, N/s"


def front(rows: Mapping[str, Row], weights: Mapping[str, Sequence[Row]]) -> Plot:
    """Error against thrust variation, and which policies no other beats in both.

    Args:
        rows: Rows of the policies.
        weights: Points of policies that are tuned with other weights, by their id.
    """
    besides = f" A line joins other weights of {', '.join(weights)}." if weights else ""
    panels = []
    for axis in "xy":
        points = [
            {"name": name, "x": row["thrust_variation"]["mean"], "y": row[error]["mean"] * 1e3}
            for name, row in rows.items()
            if row["competitor"] and row["thrust_variation"]["mean"] > 0
            for error in (f"max_error_{axis}",)
        ]
        lines = [
            {
                "name": f"{name}, other weights",
                "x": [point["thrust_variation"] for point in listed],
                "y": [1e3 * point[f"max_error_{axis}"] for point in listed],
            }
            for name, listed in weights.items()
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
        "A small error is easily bought with thrusters that chatter. Filled are the policies that "
        f"no other beats in both; left and below is better.{besides}",
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
        each["x"] <= here[0] and each["y"] <= here[1] and (each["x"], each["y"]) != here
        for each in points
    )


def robustness(curves: Mapping[str, Sequence[Row]], label: str) -> Plot:
    """Error against a quantity, with intervals."""
    return error_curves(
        "Error curves",
        "Largest position error after settling, mean over the episodes; shaded is its 95 % "
        "interval.",
        curves,
        label,
    )


def learning(rows: Mapping[str, Row]) -> Plot:
    """Error against the steps of a training, from the best seed to the worst."""
    curves: dict[str, list[Row]] = {}
    for name, row in rows.items():
        curves[name] = []
        for points in zip(*row["curves"].values(), strict=False):
            point: dict[str, Any] = {"value": points[0]["steps"] / 1e6}
            for axis in ("max_error_x", "max_error_y"):
                errors = [each[axis] for each in points]
                mean = sum(errors) / len(errors)
                point[axis] = {"mean": mean, "ci95": (min(errors), max(errors))}
            curves[name].append(point)
    return error_curves(
        "Learning curves",
        "Largest position error after settling on held-out scenarios; mean over the seeds, shaded "
        "from the best to the worst.",
        curves,
        "million steps",
    )


def error_curves(title: str, text: str, curves: Mapping[str, Sequence[Row]], label: str) -> Plot:
    """Errors in x and y against something."""
    panels = []
    for axis in "xy":
        series = []
        for name, points in curves.items():
            known = [point.get(f"max_error_{axis}") for point in points]
            low, mean, high = (
                [None if each is None else 1e3 * value(each) for each in known]
                for value in (
                    lambda score: score["ci95"][0],
                    lambda score: score["mean"],
                    lambda score: score["ci95"][1],
                )
            )
            values = [point["value"] for point in points]
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
