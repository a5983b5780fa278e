"""Adds pages, results, notebooks and speed from the rest of the repository to the site."""

from pathlib import Path

import notebook_page
from mkdocs.structure.files import File

import usm_gym
from usm_cli.commands.bench import MEANINGS, findings
from usm_cli.speed import SpeedResult
from usm_gym.support.text import figures

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "results" / usm_gym.__version__
SPEED, FINDINGS = "<!-- bench.json -->", "<!-- bench.json: findings -->"


def on_files(files, config):
    """Add what lies outside `docs`."""
    outside = {name: ROOT / name for name in ("CONTRIBUTING.md", "CHANGELOG.md")}
    for kind in ("md", "png", "svg"):
        for path in sorted(RESULTS.rglob(f"*.{kind}")):
            outside[f"results/{path.relative_to(RESULTS).as_posix()}"] = path
    for place, path in outside.items():
        files.append(File.generated(config, place, abs_src_path=str(path)))
    for path in sorted((ROOT / "notebooks").glob("*.ipynb")):
        for name, content in notebook_page.files(path, f"notebooks/{path.name}").items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    return files


def on_page_markdown(markdown, **_):
    """Put the measured speed in its place."""
    if SPEED not in markdown:
        return markdown
    path = RESULTS / "bench.json"
    said = findings(SpeedResult.read(path).spread) if path.exists() else []
    return markdown.replace(FINDINGS, "\n\n".join(said)).replace(SPEED, speed(path))


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
    decisions = ["", "| a decision for one robot | median, us |", "|---|---:|"]
    for id, spread in sorted(result.decisions.items(), key=lambda pair: pair[1].median):
        decisions.append(f"| `{id}` | {figures(spread.median)} |")
    return "\n".join([by, "", *lines, *decisions])
