"""Writes the pages of the site, complete, for the program that makes HTML of them.

`python docs/prepare` fills `build/docs`; `python docs/prepare tasks.md` renews one page there.
"""

import sys
from pathlib import Path

import formulas
import laws
import notebook_page
import published

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "build" / "docs"
# What of `docs` is part of the site.
KINDS = (".md", ".svg", ".gif", ".css", ".js")
# Pages whose tables need the whole width, and what gives it to them.
WIDE = (
    "results/leaderboard.md",
    "results/study/study.md",
    "results/space/leaderboard.md",
    "results/space/study/study.md",
    "results/head/leaderboard.md",
    "results/head/study/study.md",
    "results/head3d/leaderboard.md",
    "results/head3d/study/study.md",
)
WHOLE = "---\nhide: [navigation, toc]\n---\n\n"


def prepare(folder, names=()):
    """Write pages, pictures and style into a folder, or only those that are named."""
    found = sources()
    made = {}
    for name in names or found:
        made |= content(name, found[name])
    if not names:
        made["results/report.html"] = published.report()
        for path in folder.rglob("*"):
            if path.is_file() and path.relative_to(folder).as_posix() not in made:
                path.unlink()
    for name, written in made.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(written)


def sources():
    """The file of every page, picture and style, by its place on the site."""
    found = {path.name: path for path in (ROOT / "docs").iterdir() if path.suffix in KINDS}
    found |= {name: ROOT / name for name in ("CONTRIBUTING.md", "CHANGELOG.md")}
    for kind in ("md", "png", "svg"):
        for path in published.FOLDER.rglob(f"*.{kind}"):
            found[f"results/{path.relative_to(published.FOLDER).as_posix()}"] = path
    for path in (ROOT / "notebooks").glob("*.ipynb"):
        found[f"notebooks/{path.stem}.md"] = path
    return found


def content(name, path):
    """What the site shows of a file, by place: of a notebook a page and its pictures."""
    if path.suffix == ".ipynb":
        text, pictures = notebook_page.parts(path, path.relative_to(ROOT).as_posix())
        beside = {f"{Path(name).parent.as_posix()}/{each}": data for each, data in pictures.items()}
        return {name: filled(text)} | beside
    if path.suffix != ".md":
        return {name: path.read_bytes()}
    return {name: filled((WHOLE if name in WIDE else "") + path.read_text("utf-8"))}


def filled(text):
    """A page with what its marks and formulas stand for."""
    return formulas.drawn(laws.filled(published.filled(text))).encode()


if __name__ == "__main__":
    prepare(FOLDER, sys.argv[1:])
