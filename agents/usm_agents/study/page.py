"""The study of residual agents as Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from usm_agents.study.plans import HOME, TRANSFER
from usm_agents.study.scores import Document, best_so_far, steps_to
from usm_gym.support.text import figures, mm

LEGEND = """\
Largest position error after settling, mm, over unseen scenarios and all seeds: mean, and mean of
the middle half of the episodes, each with its 95 % interval (episodes are resampled within each
seed); means of the best and of the worst seed; thrust variation, N/s, and effort, N; episodes lost.
"""


def markdown(found: Document) -> str:
    """All tables."""
    agents = {name: each for name, each in found["rows"].items() if each["agent"]}
    others = {name: each for name, each in found["rows"].items() if not each["agent"]}
    parts = ["# Study of residual agents\n", LEGEND]
    if agents:
        parts += ["## Agents\n", table(agents), "## Classical policies\n", table(found["rivals"])]
        parts += ["![Error against thrust variation](front.png)\n"]
        parts += ["## Agents against classical policies\n", AGAINST]
        parts += [against(rows) for rows in by_mode(agents, found["against"])]
        parts += ["## How soon\n", SOON, soon(agents)]
        parts += ["## Elsewhere\n", ELSEWHERE, elsewhere({**agents, **found["rivals"]})]
        parts += ["## What the agents do to their bases\n", DISSECTED, taken(found["dissected"])]
        parts += ["![Spectra of the forces](spectra.png)\n"]
    if others:
        parts += ["## Ablations\n", table(others)]
    parts += ["## Learning curves\n", "![Error against steps](curves.png)\n"]
    parts += ["## Commands\n", commands(found)]
    return "\n".join(parts)


AGAINST = """\
Ratio of the means in x / y over all seeds, with its 95 % interval; in what share of scenarios the
agent, as its seed 0, is better in both axes; and how many of its seeds are better in both means.
"""
SOON = """\
Steps after which the best agents so far are as good as the best ones of another training, by the
validated error x + y, the median over the seeds; trainings are validated every quarter of a million
steps.
"""
ELSEWHERE = """\
Mean errors x / y, mm, under other conditions than those of the training: without noise, lag and
error of the model; rougher water; joints still; coefficients off by up to 40 %. Lost episodes in
brackets.
"""
DISSECTED = """\
Standard deviations of the force that the base commands alone, and with the agent; of the residual;
and of the force that was needed, which is the oracle's in the same episode. The residual is split
by least squares into a share of what the base commands in excess of it, taken back, and a share of
the needed force; "late" is by how much the whole force follows the needed one. x / y.
"""


def table(rows: Mapping[str, Any]) -> str:
    """Scores at home; those over seeds, where there are some."""
    axes = [f"max_error_{axis}" for axis in "xy"]
    scores = {name: each["scores"][HOME] for name, each in rows.items()}
    several = any(len(each[axes[0]]["seeds"]) > 1 for each in scores.values())
    columns = ["x, mm", "y, mm", "middle half x", "middle half y"]
    columns += ["seeds", "seeds x", "seeds y"] if several else []
    columns += ["variation, N/s", "thrust, N", "lost"]
    lines = [_line(("policy", *columns)), "|---|" + "---:|" * len(columns)]
    for name, each in scores.items():
        cells = [name]
        for kind, limits in (("mean", "ci95"), ("iqm", "iqm_ci95")):
            for axis in axes:
                low, high = each[axis][limits]
                cells.append(f"{mm(each[axis][kind])} [{mm(low)}, {mm(high)}]")
        if several:
            seeds = [each[axis]["seeds"] for axis in axes]
            cells += [str(len(seeds[0])), *(f"{mm(min(m))} to {mm(max(m))}" for m in seeds)]
        cells += [figures(each[key]["mean"]) for key in ("thrust_variation", "thrust_effort")]
        lines.append(_line([*cells, str(each["failures"])]))
    return "\n".join(lines) + "\n"


def by_mode(agents: Mapping[str, Any], found: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The claims of the agents of each mode."""
    modes = dict.fromkeys(each["mode"] for each in agents.values())
    return [
        {name: found[name] for name, each in agents.items() if each["mode"] == mode}
        for mode in modes
    ]


def against(found: Mapping[str, Any]) -> str:
    """Each agent of a mode against each classical policy."""
    lines = [_line(("rival", *found)), "|---|" + "---:|" * len(found)]
    for rival in next(iter(found.values())):
        cells = [rival]
        for row in found.values():
            each = row[rival]
            x, y = (
                f"{figures(ratio)} [{figures(low)}, {figures(high)}]"
                for ratio, (low, high) in zip(each["ratio"], each["ratio_ci95"], strict=True)
            )
            cells.append(f"{x} / {y}; {each['better_in_both']:.0%}; {each['better_seeds']}")
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def soon(agents: Mapping[str, Any]) -> str:
    """How soon each agent is as good as each other one becomes."""
    lines = [_line(("agent", *agents)), "|---|" + "---:|" * len(agents)]
    for name, each in agents.items():
        cells = [name]
        for other in agents.values():
            error = min(best_so_far(other["curves"]).values())
            comparable = other["mode"] == each["mode"]
            steps = steps_to(each["curves"], error) if comparable else None
            cells.append("" if steps is None else f"{steps / 1e6:.2f} M")
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def elsewhere(rows: Mapping[str, Any]) -> str:
    """Scores under the other conditions."""
    lines = [_line(("policy", HOME, *TRANSFER)), "|---|" + "---:|" * (1 + len(TRANSFER))]
    for name, each in rows.items():
        cells = [name]
        for kind in (HOME, *TRANSFER):
            scores = each["scores"][kind]
            lost = f" ({scores['failures']})" if scores["failures"] else ""
            x, y = (mm(scores[f"max_error_{axis}"]["mean"]) for axis in "xy")
            cells.append(f"{x} / {y}{lost}")
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def taken(found: Mapping[str, Any]) -> str:
    """What each residual is made of."""
    forces = ("base alone, N", "base, N", "residual, N", "needed, N")
    shares = ("excess taken back", "needed added", "explained")
    head = ("agent", *forces, *shares, "late, ms")
    lines = [_line(head), "|---|" + "---:|" * (len(head) - 1)]
    for name, each in found.items():
        axes = [each["x"], each["y"]]
        cells = [
            " / ".join(figures(axis["deviation"][force]) for axis in axes)
            for force in ("base alone", "base", "residual", "needed")
        ]
        cells += [
            " / ".join(f"{axis[key]:.2f}" for axis in axes)
            for key in ("excess_taken_back", "needed_added", "explained")
        ]
        late = " / ".join(f"{1e3 * axis['lateness']:.0f}" for axis in axes)
        lines.append(_line([name, *cells, late]))
    return "\n".join(lines) + "\n"


def commands(found: Document) -> str:
    """How each training is repeated, as its seed 0."""
    return "\n".join(f"    {each['command']}" for each in found["rows"].values()) + "\n"


def _line(cells: Any) -> str:
    return "| " + " | ".join(cells) + " |"
