"""The study of learned agents as Markdown, tier by tier."""

from __future__ import annotations

from usm_baselines.benchmark.results import shifts_in

from usm_agents.study import tables
from usm_agents.study.plans import ABLATED
from usm_agents.study.results import HomeResult, StudyResult
from usm_gym.support.provenance import older_plant

LEGEND = """\
Largest position error after settling, mm, over {episodes} unseen scenarios and all seeds: mean, and
mean of the middle half of the episodes, each with its 95 % interval, for which seeds and scenarios
are resampled; means of the best and of the worst seed; largest error of the attitude, thrust
variation, effort; episodes lost. The checkpoints of all agents were chosen on the validation
scenarios of their trainings, and the gains of their rivals on those of `usm tune`; neither has met
the scenarios here.
"""
EARLIER = """\
**This study is of the plant of {version}, whose step has been mended since.** Its figures are not
to be compared with those of later versions, for which the agents are trained anew.
"""
TOLD = """\
What a policy is told besides the measured position and the reference is in the column "told". One
that is given true state is no competitor, and only shows what could be reached.
"""
AGAINST = """\
An agent over a rival in the same scenarios, with 95 % intervals as above: ratios of the means of
the largest position errors, of the errors of the attitude, of thrust variation, and of the
objective that orders the board, where less than 1 is better; where an interval holds 1, the data do
not decide. "Better in" is the probability that
the agent has the smaller error in an episode; "better seeds" says how many have smaller means in
{all} axes. A smaller error at a larger thrust variation or attitude error is no victory: the fair
rival is the one that spends as much.
"""
SHIFTS = """\
Largest error from a shift of the joint references to the next, mm, mean {axes}: an episode here is
a scan of many shifts, during which a policy may learn. "Fifth over first" is the ratio of these
means with its interval. Shifts need not be equally hard: it is to be held against that of policies
that do not adapt.
"""
ELSEWHERE = """\
Mean errors {axes}, mm, over {half} scenarios under other conditions than those of the training;
lost episodes in brackets. All policies are made from the nominal knowledge of these conditions.
"""
TRANSFER = """\
An agent over its base under these conditions: ratios of the means {axes} with their intervals, and
of thrust variation. In `exact` the nominal model is right, so that there is nothing to learn of it.
"""
DISSECTED = """\
Standard deviations of the force that the base commands alone, and with the agent; of the residual;
and of the force that was needed, which is the oracle's in the same episode. The residual is split
by least squares into a share of what the base commands in excess of it, taken back, and a share of
the needed force; "late" is by how much the whole force follows the needed one, up to 200 ms.
{axes}.
"""
SOON = """\
Steps, in millions, after which the best agents so far are as good as the best ones of another
training: by the objective on held-out scenarios, which adds to {sum} the prices of thrust variation
and of the errors of the attitude; the median over the seeds.
"""
ABLATIONS = """\
Each is `{ablated}` but for one thing. `thrusters` is to be held against `scale-6`.
"""


def markdown(study: StudyResult) -> str:
    """All tables."""
    parts = ["# Study of learned agents\n"]
    version = study.provenance.version
    if older_plant(version):
        parts += [EARLIER.format(version=version)]
    parts += [LEGEND.format(episodes=study.episodes), TOLD]
    for name, home in study.homes.items():
        parts += section(name, home, study.episodes // 2)
    parts += ["## Commands\n", commands(study)]
    return "\n".join(parts)


def section(name: str, home: HomeResult, half: int) -> list[str]:
    """The tables of a home."""
    words = {
        "axes": " / ".join(home.axes),
        "sum": " + ".join(home.axes),
        "all": "both" if len(home.axes) == 2 else "all",
        "half": half,
        "ablated": ABLATED,
    }
    parts = [f"## {name}\n"]
    if home.agents:
        parts += ["### Agents\n", tables.scores(home.agents)]
    parts += ["### Their rivals\n", tables.scores(home.rivals)]
    parts += [f"![Error against thrust variation]({name}-front.svg)\n"]
    parts += [f"![Share of episodes up to an error]({name}-profiles.svg)\n"]
    if home.agents:
        parts += ["### Agents against their rivals\n", AGAINST.format(**words)]
        for agent in home.agents:
            parts += [f"#### {agent}\n", tables.against(home.against[agent], home)]
    if shifts_in(row.home for row in home.competing.values()):
        parts += ["### Shift by shift\n", SHIFTS.format(**words), tables.shifts(home)]
        parts += [f"![Error by shift]({name}-shifts.svg)\n"]
    parts += ["### Elsewhere\n", ELSEWHERE.format(**words), tables.elsewhere(home)]
    if home.agents:
        parts += [TRANSFER.format(**words), tables.transfer(home)]
    if home.dissected:
        parts += ["### What the agents do to their bases\n", DISSECTED.format(**words)]
        parts += [tables.taken(home.dissected), f"![Spectra of the forces]({name}-spectra.svg)\n"]
    if len(home.agents) > 1:
        parts += ["### How soon\n", SOON.format(**words), tables.soon(home.agents)]
    if home.ablations:
        parts += ["### Ablations\n", ABLATIONS.format(**words), tables.scores(home.ablations)]
        if ABLATED in home.agents:
            parts += [tables.against_ablated({n: home.against[n][ABLATED] for n in home.ablations})]
    parts += ["### Learning curves\n", f"![Error against steps]({name}-curves.svg)\n"]
    return parts


def commands(study: StudyResult) -> str:
    """How to repeat the trainings, as their seed 0."""
    rows = [row for home in study.homes.values() for row in home.trained.values()]
    return "\n".join(f"    {row.command}" for row in rows) + "\n"
