"""The study of residual agents as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import degrees

from usm_agents.study.results import Claim, Dissection, ForceShares, Rival, StudyResult, Trained
from usm_agents.study.scores import best_so_far, steps_to
from usm_gym.support.provenance import older_plant
from usm_gym.support.text import figures, mm
from usm_gym.task.metrics import ANGLE_ERROR, attitude_of

LEGEND = """\
Largest position error after settling, mm, over unseen scenarios and all seeds: mean, and mean of
the middle half of the episodes, each with its 95 % interval, for which seeds and scenarios are
resampled; means of the best and of the worst seed; thrust variation, N/s, and effort, N; episodes
lost.
"""
EARLIER = """\
**This study is of the plant of {version}, whose step has been mended since.** Its figures are not
to be compared with those of later versions, for which the agents are trained anew.
"""
ABLATIONS = """\
A row of one seed is one training. Its interval is that of the scenarios alone, and a difference
from another row may be one between seeds.
"""

AGAINST = """\
Ratio of the means in {axes} over all seeds, with its 95 % interval, for which seeds and scenarios
are resampled; where it holds 1, the data do not decide. Then in what share of scenarios the agent,
as its seed 0, is better in {all} axes; and how many of its seeds are better in {all} means.
"""
SOON = """\
Steps after which the best agents so far are as good as the best ones of another training: by the
objective on held-out scenarios, which adds to {sum} the prices of thrust variation and, where the
curves have them, of heading errors; the median over the seeds. Trainings are validated every
quarter of a million steps.
"""
ELSEWHERE = """\
Mean errors {axes}, mm, under other conditions than those of the training: without noise, lag and
error of the model; rougher water; joints still; coefficients off by up to 40 %. Lost episodes in
brackets.
"""
DISSECTED = """\
Standard deviations of the force that the base commands alone, and with the agent; of the residual;
and of the force that was needed, which is the oracle's in the same episode. The residual is split
by least squares into a share of what the base commands in excess of it, taken back, and a share of
the needed force; "late" is by how much the whole force follows the needed one. {axes}.
"""


def markdown(study: StudyResult) -> str:
    """All tables."""
    agents = study.agents
    words = {
        "axes": " / ".join(study.axes),
        "sum": " + ".join(study.axes),
        "all": "both" if len(study.axes) == 2 else "all",
    }
    parts = ["# Study of residual agents\n"]
    version = study.provenance.version
    if older_plant(version):
        parts += [EARLIER.format(version=version)]
    parts += [LEGEND]
    if agents:
        parts += ["## Agents\n", table(agents, study.home)]
        parts += ["## Classical policies\n", table(study.rivals, study.home)]
        parts += ["![Error against thrust variation](front.png)\n"]
        parts += ["## Agents against classical policies\n", AGAINST.format(**words)]
        parts += [against(rows) for rows in by_mode(agents, study.against)]
        parts += ["## How soon\n", SOON.format(**words), soon(agents)]
        parts += ["## Elsewhere\n", ELSEWHERE.format(**words)]
        parts += [elsewhere({**agents, **study.rivals}, study.home)]
        parts += ["## What the agents do to their bases\n", DISSECTED.format(**words)]
        parts += [taken(study.dissected), "![Spectra of the forces](spectra.png)\n"]
    if study.ablations:
        parts += ["## Ablations\n", ABLATIONS, table(study.ablations, study.home)]
    parts += ["## Learning curves\n", "![Error against steps](curves.png)\n"]
    parts += ["## Commands\n", commands(study)]
    return "\n".join(parts)


def table(rows: Mapping[str, Trained | Rival], home: str) -> str:
    """Scores at home; those over seeds, where there are some."""
    scores = {name: row.scores[home] for name, row in rows.items()}
    first = next(iter(scores.values()))
    several = any(len(row.seed_errors[0].seeds) > 1 for row in scores.values())
    columns = [f"{axis}, mm" for axis in first.axes]
    columns += [f"middle half {axis}" for axis in first.axes]
    columns += ["seeds", *(f"seeds {axis}" for axis in first.axes)] if several else []
    angles = attitude_of(first.metrics)
    columns += [f"{angle}, °" for angle in angles]
    lines = _head("policy", [*columns, "variation, N/s", "thrust, N", "lost"])
    for name, row in scores.items():
        errors = row.seed_errors
        cells = [_length(error.mean, error.ci95) for error in errors]
        cells += [_length(error.iqm, error.iqm_ci95) for error in errors]
        if several:
            seeds = [error.seeds for error in errors]
            cells += [str(len(seeds[0])), *(f"{mm(min(m))} to {mm(max(m))}" for m in seeds)]
        cells += [figures(degrees(row.metrics[angle + ANGLE_ERROR].mean)) for angle in angles]
        cells += [figures(row.metrics[key].mean) for key in ("thrust_variation", "thrust_effort")]
        lines.append(_line([name, *cells, str(row.failures)]))
    return "\n".join(lines) + "\n"


def by_mode(
    agents: Mapping[str, Trained], claims: Mapping[str, Mapping[str, Claim]]
) -> list[dict[str, Mapping[str, Claim]]]:
    """The claims of the agents, mode by mode."""
    modes = dict.fromkeys(agent.mode for agent in agents.values())
    return [
        {name: claims[name] for name, agent in agents.items() if agent.mode == mode}
        for mode in modes
    ]


def against(claims: Mapping[str, Mapping[str, Claim]]) -> str:
    """The agents of a mode against the classical policies."""
    lines = _head("rival", list(claims))
    for rival in next(iter(claims.values())):
        cells = [rival]
        for row in claims.values():
            claim = row[rival]
            ratios = " / ".join(
                f"{figures(ratio)} [{figures(low)}, {figures(high)}]"
                for ratio, (low, high) in zip(claim.ratio, claim.ratio_ci95, strict=True)
            )
            cells.append(f"{ratios}; {claim.better_in_both:.0%}; {claim.better_seeds}")
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def soon(agents: Mapping[str, Trained]) -> str:
    """How soon every agent is as good as the others become."""
    lines = _head("agent", list(agents))
    for name, agent in agents.items():
        cells = [name]
        for other in agents.values():
            best = min(best_so_far(other.curves).values())
            steps = steps_to(agent.curves, best) if other.mode == agent.mode else None
            cells.append("" if steps is None else f"{steps / 1e6:.2f} M")
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def elsewhere(rows: Mapping[str, Trained | Rival], home: str) -> str:
    """Scores under the other conditions."""
    kinds = [home, *(kind for kind in next(iter(rows.values())).scores if kind != home)]
    lines = _head("policy", kinds)
    for name, row in rows.items():
        cells = [name]
        for kind in kinds:
            scores = row.scores[kind]
            lost = f" ({scores.failures})" if scores.failures else ""
            cells.append(" / ".join(mm(error.mean) for error in scores.errors.values()) + lost)
        lines.append(_line(cells))
    return "\n".join(lines) + "\n"


def taken(dissected: Mapping[str, Dissection]) -> str:
    """What the residuals are made of."""
    forces = ("base alone", "base", "residual", "needed")
    heads = [f"{force}, N" for force in forces]
    lines = _head("agent", [*heads, "excess taken back", "needed added", "explained", "late, ms"])
    for name, dissection in dissected.items():
        axes: Sequence[ForceShares] = list(dissection.axes.values())
        cells = [_each(figures(axis.deviation[force]) for axis in axes) for force in forces]
        cells.append(_each(f"{axis.excess_taken_back:.2f}" for axis in axes))
        cells.append(_each(f"{axis.needed_added:.2f}" for axis in axes))
        cells.append(_each(f"{axis.explained:.2f}" for axis in axes))
        cells.append(_each(f"{1e3 * axis.lateness:.0f}" for axis in axes))
        lines.append(_line([name, *cells]))
    return "\n".join(lines) + "\n"


def commands(study: StudyResult) -> str:
    """How to repeat the trainings, as their seed 0."""
    return "\n".join(f"    {row.command}" for row in study.rows.values()) + "\n"


def _length(metres: float, interval: tuple[float, float]) -> str:
    low, high = interval
    return f"{mm(metres)} [{mm(low)}, {mm(high)}]"


def _each(texts: Iterable[str]) -> str:
    return " / ".join(texts)


def _head(first: str, columns: Sequence[str]) -> list[str]:
    return [_line([first, *columns]), "|---|" + "---:|" * len(columns)]


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"
