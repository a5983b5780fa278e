"""The tables of the study, as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from usm_baselines.benchmark.results import shifts_in

from usm_agents.study.claims import best_so_far, steps_to
from usm_agents.study.results import (
    Claim,
    Dissection,
    Estimated,
    ForceShares,
    HomeResult,
    Scored,
    Trained,
)
from usm_gym.support.text import degrees, figures, mm
from usm_gym.task.metrics import ANGLE_ERROR, MAX_ERROR, attitude_of, axes_of

NOTHING = ""


def scores(rows: Mapping[str, Scored]) -> str:
    """Scores at home; those over seeds, where there are some."""
    first = next(iter(rows.values())).home
    several = any(len(row.home.seed_errors[0].seeds) > 1 for row in rows.values())
    columns = [f"{axis}, mm" for axis in first.axes]
    columns += [f"middle half {axis}" for axis in first.axes]
    columns += ["seeds", *(f"seeds {axis}" for axis in first.axes)] if several else []
    columns += [f"{angle}, °" for angle in first.attitude]
    lines = _head("policy", [*columns, "variation, N/s", "thrust, N", "lost", "told"])
    for name, row in rows.items():
        errors, metrics = row.home.seed_errors, row.home.metrics
        cells = [_length(error.mean, error.ci95) for error in errors]
        cells += [_length(error.iqm, error.iqm_ci95) for error in errors]
        if several:
            seeds = [error.seeds for error in errors]
            cells += [str(len(seeds[0])), *(f"{mm(min(m))} to {mm(max(m))}" for m in seeds)]
        cells += [degrees(error.mean) for error in row.home.attitude.values()]
        cells += [figures(metrics[key].mean) for key in ("thrust_variation", "thrust_effort")]
        lines.append(_line([row.label(name), *cells, str(row.home.failures), row.told]))
    return _table(lines)


def against(claims: Mapping[str, Claim], home: HomeResult) -> str:
    """An agent against its rivals."""
    lines = _head("rival", _claimed(claims))
    for rival, claim in claims.items():
        lines.append(_line([home.rivals[rival].label(rival), *_claim(claim, claims)]))
    return _table(lines)


def against_ablated(claims: Mapping[str, Claim]) -> str:
    """Ablations over the ablated agent."""
    lines = _head("ablation over the agent", _claimed(claims))
    lines += [_line([name, *_claim(claim, claims)]) for name, claim in claims.items()]
    return _table(lines)


def shifts(home: HomeResult) -> str:
    """Errors after the shifts of scans."""
    known = shifts_in(row.home for row in home.competing.values())
    columns = [f"fifth over first, {axis}" for axis in home.axes]
    lines = _head("policy", [*known, *columns])
    for name, row in home.competing.items():
        cells = [_each(mm(e.mean) for e in row.home.by_shift[shift].values()) for shift in known]
        cells += [_estimated(row.adaptation[axis]) for axis in home.axes]
        lines.append(_line([row.label(name), *cells]))
    return _table(lines)


def elsewhere(home: HomeResult) -> str:
    """Errors at home and under the other conditions, and below why policies are refused there."""
    rows = home.competing
    kinds = dict.fromkeys(kind for row in rows.values() for kind in (*row.elsewhere, *row.refused))
    lines = _head("policy", [home.tier, *kinds])
    reasons = []
    for name, row in rows.items():
        cells = []
        for kind in (home.tier, *kinds):
            scores = row.home if kind == home.tier else row.elsewhere.get(kind)
            if scores is None:
                cells.append("refused")
                continue
            lost = f" ({scores.failures})" if scores.failures else ""
            cells.append(_each(mm(error.mean) for error in scores.errors.values()) + lost)
        lines.append(_line([row.label(name), *cells]))
        reasons += [f"{name} is refused in {kind}: {why}\n" for kind, why in row.refused.items()]
    return "\n".join([_table(lines), *reasons])


def transfer(home: HomeResult) -> str:
    """Agents over their bases under the other conditions."""
    kinds = dict.fromkeys(kind for claims in home.transfer.values() for kind in claims)
    lines = _head("agent", kinds)
    for name, claims in home.transfer.items():
        cells = []
        for kind in kinds:
            if kind not in claims:
                cells.append(NOTHING)
                continue
            ratios = claims[kind].ratios
            parts = [_estimated(ratios[MAX_ERROR + axis]) for axis in home.axes]
            if "thrust_variation" in ratios:
                parts.append(f"variation {figures(ratios['thrust_variation'].value)}")
            cells.append(_each(parts))
        lines.append(_line([f"{name} over {home.agents[name].rival}", *cells]))
    return _table(lines)


def soon(agents: Mapping[str, Trained]) -> str:
    """How soon every agent is as good as the others become."""
    lines = _head("agent", list(agents))
    for name, agent in agents.items():
        cells = [name]
        for other in agents.values():
            steps = steps_to(agent.curves, min(best_so_far(other.curves).values()))
            cells.append(NOTHING if steps is None else f"{steps / 1e6:.2f}")
        lines.append(_line(cells))
    return _table(lines)


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
    return _table(lines)


def _ratios(claims: Mapping[str, Claim]) -> dict[str, str]:
    """The metrics of which claims have ratios, with the heads of their columns."""
    known = dict.fromkeys(metric for claim in claims.values() for metric in claim.ratios)
    words = {MAX_ERROR + axis: f"error {axis}" for axis in axes_of(known)}
    words |= {angle + ANGLE_ERROR: angle for angle in attitude_of(known)}
    words |= {"thrust_variation": "variation", "objective": "objective"}
    return {metric: words[metric] for metric in known}


def _claimed(claims: Mapping[str, Claim]) -> list[str]:
    """The heads of the columns of claims."""
    axes = next(iter(claims.values())).improvements
    return [*_ratios(claims).values(), *(f"better in {axis}" for axis in axes), "better seeds"]


def _claim(claim: Claim, claims: Mapping[str, Claim]) -> list[str]:
    """The cells of one of some claims."""
    known = [claim.ratios.get(metric) for metric in _ratios(claims)]
    cells = [NOTHING if ratio is None else _estimated(ratio) for ratio in known]
    for share in claim.improvements.values():
        low, high = share.ci95
        cells.append(f"{share.value:.2f} [{low:.2f}, {high:.2f}]")
    return [*cells, str(claim.better_seeds)]


def _length(metres: float, interval: tuple[float, float]) -> str:
    low, high = interval
    return f"{mm(metres)} [{mm(low)}, {mm(high)}]"


def _estimated(number: Estimated) -> str:
    low, high = number.ci95
    return f"{figures(number.value)} [{figures(low)}, {figures(high)}]"


def _each(texts: Iterable[str]) -> str:
    return " / ".join(texts)


def _head(first: str, columns: Iterable[str]) -> list[str]:
    listed = list(columns)
    return [_line([first, *listed]), "|---|" + "---:|" * len(listed)]


def _line(cells: Iterable[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _table(lines: Sequence[str]) -> str:
    return "\n".join(lines) + "\n"
