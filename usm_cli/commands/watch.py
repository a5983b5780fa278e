"""`usm watch`: show policies in a window or a film."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rich.table import Table

from usm_cli.options import check_installed
from usm_cli.selection import (
    POLICIES,
    add_policies,
    add_scenarios,
    chosen_scenario,
    named_contenders,
)
from usm_cli.take import instants, take
from usm_cli.terminal import empty_table, output_console, progress_bar
from usm_gym.evaluation import score
from usm_gym.recording import Trajectory
from usm_gym.support.files import check_writable
from usm_gym.support.text import mm
from usm_gym.support.validation import UsageError, require
from usm_gym.task.metrics import MAX_ERROR, axes_of

DESCRIPTION = """\
Watch a policy in an episode, or two or three, one above the other, in the same scenario with the
same noise, in a window (Escape closes it) or in a film. The picture shows the robot and the shape
that it should have, if one is asked for, the jets of its thrusters, the current, the centre of
mass, the goal of what follows the path, and the error, magnified and over time. Needs the extra
`render`.
"""
EXAMPLES = f"""\
{POLICIES}
examples:
  usm watch                                     the super-twisting controller in a window
  usm watch --policies pd,sta                   two policies, one above the other
  usm watch --policies sta --output run.mp4     a film; run.gif for a page that shows no films
  usm watch --suite torpedo --scenario 7        another episode
  usm watch --seed 3 --speed 4                  a sampled episode at four times real time
"""


def add_to(subparsers: Any) -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "watch",
        help="show policies in a window or a film",
        description=DESCRIPTION,
        epilog=EXAMPLES,
    )
    add_policies(parser, default="sta")
    add_scenarios(parser, single=True)
    add = parser.add_argument
    add(
        "--speed",
        type=float,
        default=1.0,
        metavar="X",
        help="speed of the film, times real time (default: 1)",
    )
    add(
        "--names",
        metavar="A,B",
        help="what to call the policies on the picture, in their order (default: as --policies)",
    )
    add("--output", metavar="FILE", help="write a film, .mp4 or .gif, instead of showing it")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Simulate, then write or show, then print the scores."""
    check_installed("usm watch", "render", "pygame", "matplotlib", "imageio_ffmpeg")
    # These imports need the extra.
    from usm_cli import film
    from usm_gym.rendering.window import has_display

    speed, path = arguments.speed, arguments.output and Path(arguments.output)
    require(0.01 <= speed <= 1000, "--speed", speed, "0.01 to 1000")
    medium = "window"
    if path:
        medium = path.suffix
        require(medium in film.FPS, "--output", arguments.output, "a file .mp4 or .gif")
        check_writable(path)
    elif not has_display():
        raise UsageError("no display found; add --output run.mp4")
    contenders = named_contenders(arguments.policies or "sta")
    require(len(contenders) <= 3, "--policies", arguments.policies, "one to three names")
    names = shown_names(arguments.names, [contender.name for contender in contenders])
    scenario = chosen_scenario(arguments)
    fps = film.FPS[medium]
    shown = instants(scenario, fps, speed)
    with progress_bar() as bar:
        line = bar.add_task("simulate", total=len(contenders))
        takes = [
            take(contender, scenario, shown, lambda episodes: bar.advance(line, episodes))
            for contender in contenders
        ]
        made = film.Film(takes, names, len(shown), film.WIDTHS[medium][len(takes) > 1], speed)
        if path:
            line = bar.add_task("draw", total=made.length)
            film.write(made, path, fps, lambda frames: bar.advance(line, frames))
    if not path:
        film.play(made, fps)
    output_console().print(table({shot.name: shot.trajectory for shot in takes}))


def shown_names(given: str | None, ids: list[str]) -> list[str]:
    """What the policies are called on the picture: `--names`, or else their ids."""
    if given is None:
        return ids
    names = [name.strip() for name in given.split(",")]
    require(all(names) and len(names) == len(ids), "--names", given, f"{len(ids)} names")
    return names


def table(trajectories: dict[str, Trajectory]) -> Table:
    """The errors of the episode in mm."""
    scores = {name: score(trajectory) for name, trajectory in trajectories.items()}
    axes = axes_of(next(iter(scores.values())))
    rows = empty_table(
        "policy",
        numbers=(*axes, "lost"),
        title="largest position error after settling, mm, in this episode",
    )
    for name, row in scores.items():
        errors = [mm(row[MAX_ERROR + axis]) for axis in axes]
        rows.add_row(name, *errors, "yes" if row["failed"] else "no")
    return rows
