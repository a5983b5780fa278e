"""Runs episodes and draws their figures whenever the site is built."""

import io
from functools import cache

import matplotlib
import numpy as np
from usm_baselines.contender import contender

import usm_gym
from usm_gym.evaluation import rollout

matplotlib.use("Agg")
from matplotlib import pyplot as plt

EPISODE = 0  # of the operation suite
WINDOW = 0.5  # s
# Of Okabe and Ito, on white and on black alike.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")


def errors(ids, others):
    """The position error of policies over time, the others in grey behind them, as SVG on one line.

    Lettering takes the colour of the page's text.
    """
    with plt.rc_context({"svg.fonttype": "none", "svg.hashsalt": ids[0], "font.size": 9}):
        figure, axes = plt.subplots(figsize=(5.2, 2.7), layout="constrained")
        for id in others:
            axes.plot(*envelope(id), color="#888888", alpha=0.3, linewidth=0.8)
        for id, colour in zip(ids, COLOURS, strict=False):
            axes.plot(*envelope(id), color=colour, label=id, linewidth=1.5)
        for shift in scenario().shifts:
            axes.axvline(shift, color="#888888", linestyle=":", linewidth=1)
        axes.set(xlim=(0, 40), ylim=(1e-4, 1e3), yscale="log")
        axes.set(xlabel="time [s]", ylabel="position error [mm]")
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.17), ncols=3, frameon=False)
        drawn = io.StringIO()
        figure.savefig(drawn, format="svg", transparent=True, metadata={"Date": None})
        plt.close(figure)
    svg = drawn.getvalue()
    svg = svg[svg.index("<svg") :].replace("#000000", "currentColor")
    return svg.replace("\n", " ")  # an empty line would end the block of HTML


@cache
def envelope(id):
    """Times, s, and the largest distance from the reference in the window that ends there, mm."""
    policy = contender(id).make(scenario().nominal)
    trajectory = rollout(policy, [scenario()])[0]
    distance = 1e3 * np.linalg.norm(trajectory.error, axis=1)
    samples = round(WINDOW / (trajectory.time[1] - trajectory.time[0]))
    ends = np.arange(samples, len(distance) + 1, samples)
    return trajectory.time[ends - 1], [distance[end - samples : end].max() for end in ends]


def scenario():
    """The episode of all figures."""
    return usm_gym.suite("operation")[EPISODE]
