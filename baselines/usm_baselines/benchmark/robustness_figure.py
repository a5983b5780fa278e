"""The figure of robustness curves (needs the extra `render`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from usm_baselines.benchmark.robustness import RobustnessResult, ScoredPoint
from usm_gym.evaluation import FAILED
from usm_gym.statistics import interval
from usm_gym.task.metrics import MAX_ERROR


def draw(result: RobustnessResult) -> Any:
    """Draw the errors axis by axis against the quantity, with their intervals, by matplotlib.

    The errors are those of the robots that are not lost; the open points are without some. Where
    any robot is lost, one more panel has the share of the lost ones.
    """
    from matplotlib import pyplot as plt

    curves = result.scored
    losses = any(point.failures for points in curves.values() for point in points)
    columns = max(len(result.axes) + losses, 1)
    figure, (panels,) = plt.subplots(
        1, columns, figsize=(5 * columns, 4.5), squeeze=False, sharex=True, layout="constrained"
    )
    whose = " of the robots not lost" if losses else ""
    for panel in panels:
        panel.set_xlabel(result.label)
        panel.grid(alpha=0.3)
    for panel, axis in zip(panels, result.axes, strict=False):
        for number, (name, points) in enumerate(curves.items()):
            _draw_curve(panel, points, axis, color=f"C{number % 10}", label=name)
        panel.set(yscale="log", ylabel=f"error in {axis}{whose} [mm]")
    if losses:
        for number, (name, points) in enumerate(curves.items()):
            shares = [100 * point.failures / point.episodes for point in points]
            places = [point.value for point in points]
            panels[-1].plot(places, shares, ".-", color=f"C{number % 10}", label=name)
        panels[-1].set(ylabel="lost robots [%]", ylim=(-3, 103))
    if result.axes:
        panels[-1].legend(fontsize=8)
    return figure


def _draw_curve(
    panel: Any, points: Sequence[ScoredPoint], axis: str, color: str, label: str
) -> None:
    """Draw the errors of one policy in one axis."""
    kept = [(point, _kept(point, axis)) for point in points]
    kept = [(point, errors) for point, errors in kept if errors.size]
    places = [point.value for point, _ in kept]
    panel.plot(places, [errors.mean() for _, errors in kept], "-", color=color, label=label)
    for point, errors in kept:
        face = "white" if point.failures else color
        panel.plot(point.value, errors.mean(), "o", markersize=4, color=color, markerfacecolor=face)
    if kept:
        low, high = np.transpose([interval(np.mean, errors) for _, errors in kept])
        panel.fill_between(places, low, high, color=color, alpha=0.2, linewidth=0)


def _kept(point: ScoredPoint, axis: str) -> NDArray[np.float64]:
    """The errors of the robots that are not lost, mm."""
    lost = np.array(point.per_episode.get(FAILED, (False,) * point.episodes), bool)
    errors = np.array(point.per_episode[MAX_ERROR + axis], float)
    return np.asarray(1e3 * errors[~lost])
