"""What the page of the controllers shows of each law: gains, an episode, scores."""

import inspect
import re
from functools import cache
from pathlib import Path

import figures
import griffe
import usm_baselines
from mkdocs.exceptions import PluginError
from usm_baselines.benchmark.leaderboard import LeaderboardResult

import usm_gym
from usm_gym.support.text import figures as in_figures
from usm_gym.support.text import mm
from usm_gym.task.nominal import nominal_of

LEADERBOARD = Path(__file__).parents[2] / "results" / usm_gym.__version__ / "leaderboard.json"
SHOWN = {"operation": "field", "operation-ideal": "ideal", "operation-rough": "rough"}
# Where a page has `<!-- law: ID, ID -->`, for policies that share a class of gains.
PLACE = re.compile(r"<!-- law: (.+?) -->")


def on_page_markdown(markdown, **_):
    """Put laws in their places."""
    laws = [ids.split(", ") for ids in PLACE.findall(markdown)]
    everyone = [id for ids in laws for id in shipped(ids)]
    return PLACE.sub(lambda place: law(place[1].split(", "), everyone), markdown)


def law(ids, everyone):
    """Gains, an episode and the scores of a law."""
    shown = shipped(ids)
    others = [id for id in everyone if id not in shown]
    names = ", ".join(f"<code>{id}</code>" for id in shown)
    caption = (
        "Position error in the first episode of the operation suite, largest in each half second: "
        f"{names}; grey: the other laws of this page; dotted: when the joints start to move."
    )
    figure = f"<figure>{figures.errors(shown, others)}<figcaption>{caption}</figcaption></figure>"
    return "\n\n".join([gains(ids), figure, scores(shown)])


def shipped(ids):
    """Policies, each followed by its tuned form if there is one."""
    known = usm_baselines.ids()
    for id in ids:
        if id not in known:
            raise PluginError(f"law is {id}; allowed: {', '.join(known)}")
    return [name for id in ids for name in (id, f"{id}-tuned") if name in known]


def gains(ids):
    """What the docstring of a law's gains says of each, and its value in each policy."""
    names = shipped(ids)
    values = {id: made(id)._asdict() for id in names}
    lines = [
        row("gain", "meaning", *(f"`{id}`" for id in names)),
        "|---|---|" + "---:|" * len(names),
    ]
    for name, meaning in meanings(type(made(ids[0]))).items():
        lines.append(row(f"`{name}`", meaning, *(f"{values[id][name]:.4g}" for id in names)))
    return "\n".join(lines)


def made(id):
    """The gains of a policy."""
    return usm_baselines.make(id, nominal_of(usm_gym.Robot(), figures.scenario())).gains


def meanings(kind):
    """What the docstring of a class of gains says of each."""
    sections = griffe.Docstring(inspect.getdoc(kind), parser="google").parse()
    (attributes,) = (part.value for part in sections if part.kind.value == "attributes")
    return {each.name: " ".join(each.description.split()) for each in attributes}


def scores(ids):
    """The rows of policies in the leaderboard."""
    board = leaderboard()
    lines = [
        row(
            f"{' / '.join(board.axes)}, mm",
            *(f"`{conditions}`" for conditions in SHOWN.values()),
            "variation, N/s",
        ),
        "|---|" + "---:|" * (len(SHOWN) + 1),
    ]
    for id in ids:
        rows = [board.suites[suite][id] for suite in SHOWN]
        cells = [" / ".join(mm(error.mean) for error in each.errors.values()) for each in rows]
        variation = rows[0].metrics["thrust_variation"].mean
        lines.append(row(f"`{id}`", *cells, in_figures(variation)))
    return "\n".join(lines)


@cache
def leaderboard():
    """The leaderboard of this version."""
    return LeaderboardResult.read(LEADERBOARD)


def row(*cells):
    """A line of a table."""
    return f"| {' | '.join(cells)} |"
