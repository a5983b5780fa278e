"""Puts the verdict and the measured speed in their places, and the report beside them."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from usm_baselines.benchmark.leaderboard import BOARDS, LeaderboardResult
from usm_baselines.benchmark.leaderboard_page import verdict

import usm_gym
from usm_cli.commands.bench import MEANINGS, findings
from usm_cli.commands.leaderboard import decision_times
from usm_cli.program import main
from usm_cli.speed import SpeedResult
from usm_gym.support.text import figures

FOLDER = Path(__file__).parents[2] / "results" / usm_gym.__version__
# Where pages have the verdict of a board.
VERDICTS = {board: f"<!-- verdict: {board.main} -->" for board in BOARDS}
SPEED, FINDINGS = "<!-- bench.json -->", "<!-- bench.json: findings -->"
# Whose episodes the report replays; others would make it large.
REPLAYED = "estimator-lqg-joints,adaptive,sta"


def report():
    """The leaderboard as the page that `usm report` makes."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "report.html"
        result = str(FOLDER / "leaderboard.json")
        main(["report", result, "--policies", REPLAYED, "--output", str(path)])
        return path.read_bytes()


def filled(text):
    """A page with what its marks stand for."""
    for board, mark in VERDICTS.items():
        if mark in text:
            result, figure = leaderboard(board), Path("results", board.folder, "verdict.svg")
            known = decision_times(FOLDER / board.folder, board)
            shown = verdict(result, figure.as_posix(), known) if result else ""
            text = text.replace(mark, shown)
    if SPEED in text:
        path = FOLDER / "bench.json"
        said = findings(SpeedResult.read(path).spread) if path.exists() else []
        text = text.replace(FINDINGS, "\n\n".join(said)).replace(SPEED, speed(path))
    return text


@cache
def leaderboard(board):
    """A leaderboard of this version; None if there is none yet."""
    path = FOLDER / board.folder / "leaderboard.json"
    return LeaderboardResult.read(path) if path.exists() else None


def speed(path):
    """The figures of `usm bench` as a table, with the command and the machine."""
    if not path.exists():
        return "No measurement has been published with this version."
    result = SpeedResult.read(path)
    lines = ["| what | median | smallest | largest |", "|---|---:|---:|---:|"]
    for name, meaning in MEANINGS.items():
        if name in result.spread:
            spread = result.spread[name]
            numbers = " | ".join(map(figures, (spread.median, spread.low, spread.high)))
            lines.append(f"| {meaning} | {numbers} |")
    machine, source = result.machine, result.provenance
    where = f"{machine.processor}, {machine.cores} cores, {machine.system}"
    by = f"By `{source.command}`, commit {source.commit}, on {where}."
    plane = decisions("a decision for one robot in the plane", result.decisions)
    space = decisions("a decision for one robot in space", result.spatial_decisions)
    return "\n".join([by, "", *lines, *plane, *space])


def decisions(title, measured):
    """How long policies take for a decision, as the lines of a table."""
    order = sorted(measured.items(), key=lambda pair: pair[1].median)
    rows = [f"| `{id}` | {figures(spread.median)} |" for id, spread in order]
    return ["", f"| {title} | median, us |", "|---|---:|", *rows]
