"""Adds gains, an episode and scores to every law on the page of the controllers."""

import re

import figures
import published
import usm_baselines
from usm_baselines.benchmark.leaderboard import PLANE, SPACE
from usm_baselines.gains import FOLDERS
from usm_baselines.registry import entry
from usm_baselines.space import declared

from usm_gym.support.text import figures as in_figures
from usm_gym.support.text import mm
from usm_gym.support.validation import require
from usm_gym.task.conditions import IN_SPACE
from usm_gym.task.head_sampling import nominal_head

# The suites whose scores are shown, by board.
SHOWN = {
    PLANE: {
        "operation": "field",
        "operation-ideal": "ideal",
        "operation-basin": "basin",
        "operation-sea": "sea",
    },
    SPACE: {
        "operation3d": "field, in space",
        "operation3d-basin": "basin, in space",
        "operation3d-sea": "sea, in space",
    },
}
# Where a page has `<!-- law: ID, ID -->`, for policies that share a class of gains.
PLACE = re.compile(r"<!-- law: (.+?) -->")


def filled(text):
    """A page with laws in their places."""
    laws = [ids.split(", ") for ids in PLACE.findall(text)]
    everyone = [id for ids in laws for id in in_the_plane(shipped(ids))]
    return PLACE.sub(lambda match: law(match[1].split(", "), everyone), text)


def law(ids, everyone):
    """Gains of a law; of one for the body also an episode and the scores."""
    if entry(ids[0]).moves_joints:
        return "\n\n".join(filter(None, [gains(ids, ids[:1]), chosen(ids)]))
    shown = in_the_plane(shipped(ids))
    others = [id for id in everyone if id not in shown]
    names = ", ".join(f"<code>{id}</code>" for id in shown)
    caption = (
        "Position error in the first episode of the operation suite, largest in every half second: "
        f"{names}; grey: the other laws of this page; dotted: when the joints start to move."
    )
    figure = f"<figure>{figures.errors(shown, others)}<figcaption>{caption}</figcaption></figure>"
    tables = [scores(board, shipped(ids)) for board in SHOWN]
    return "\n\n".join([gains(ids, shipped(ids)), figure, *filter(None, tables)])


def shipped(ids):
    """Policies, each followed by the forms of it that are tuned."""
    known = usm_baselines.ids()
    for id in ids:
        require(id in known, "law", id, ", ".join(known))
    gains = ("", *(f"-{suffix}" for suffix in FOLDERS))
    return [id + kind for id in ids for kind in gains if id + kind in known]


def in_the_plane(ids):
    """Those of policies whose gains are not for a robot in space."""
    return [id for id in ids if not entry(id).tuned_for.endswith(IN_SPACE)]


def gains(ids, names):
    """The declared gains of a law, and their values in policies."""
    values = {id: made(id)._asdict() for id in names}
    lines = [
        row("gain", "meaning", "unit", "tuned within", *(f"`{id}`" for id in names)),
        "|---|---|---|---|" + "---:|" * len(names),
    ]
    for name, gain in declared(type(made(ids[0]))).items():
        # Readings of one law may differ in units and ranges.
        ranges = [entry(id).space[name] for id in ids if name in entry(id).space]
        units = dict.fromkeys(bounds.unit for bounds in ranges) or [gain.unit]
        within = dict.fromkeys(f"{bounds.low:g} to {bounds.high:g}" for bounds in ranges)
        numbers = (f"{values[id][name]:.4g}" for id in names)
        lines.append(row(f"`{name}`", gain.meaning, "; ".join(units), "; ".join(within), *numbers))
    return "\n".join(lines)


def chosen(ids):
    """The tuned gains of laws for the head, a row for each; those of the body are in the files."""
    names = [id for id in shipped(ids) if id not in ids]
    if not names:
        return ""
    kept = list(declared(type(made(ids[0]))))
    head = [row("gains", *(f"`{name}`" for name in kept)), "|---|" + "---:|" * len(kept)]
    rows = [row(f"`{id}`", *(f"{gain:.3g}" for gain in made(id))) for id in names]
    return "\n".join(head + rows)


def made(id):
    """The gains of a policy."""
    scenario = nominal_head("head") if entry(id).moves_joints else figures.scenario()
    return usm_baselines.make(id, scenario.nominal).gains


def scores(board, ids):
    """The rows of policies in a leaderboard; empty if it has none of them."""
    result, suites = published.leaderboard(board), SHOWN[board]
    lines = []
    for id in ids:
        rows = [result.suites[suite].get(id) for suite in suites] if result else []
        scored = [score for score in rows if score is not None]
        if scored:
            variation = in_figures(scored[0].metrics["thrust_variation"].mean)
            lines.append(row(f"`{id}`", *map(errors, rows), variation))
    if not lines:
        return ""
    axes = f"{' / '.join(result.axes)}, mm"
    head = row(axes, *(f"`{conditions}`" for conditions in suites.values()), "variation, N/s")
    return "\n".join([head, "|---|" + "---:|" * (len(suites) + 1), *lines])


def errors(score):
    """Mean errors of a row of the leaderboard, if the policy is meant for the suite."""
    return "" if score is None else " / ".join(mm(error.mean) for error in score.errors.values())


def row(*cells):
    """A line of a table."""
    return f"| {' | '.join(cells)} |"
