"""Writes the pages of the site, complete, for the program that makes HTML of them.

`python docs/prepare` fills `build/docs`; `python docs/prepare tasks.md` renews one page there.
"""

import json
import sys
from pathlib import Path

import formulas
import laws
import published

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "build" / "docs"
# What of `docs` is part of the site.
KINDS = (".md", ".svg", ".gif", ".css", ".js")


def prepare(folder, names=()):
    """Write pages, pictures, style and script into a folder, or only those that are named."""
    found = sources()
    made = {name: content(found[name]) for name in names or found}
    if not names:
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


def content(path):
    """What the site shows of a file."""
    if path.suffix not in (".md", ".ipynb"):
        return path.read_bytes()
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        text = notebook(path.relative_to(ROOT).as_posix(), text)
    return formulas.drawn(laws.filled(published.filled(text))).encode()


def notebook(name, text):
    """A notebook as a page."""
    cells = json.loads(text)["cells"]
    texts = [
        "".join(cell["source"])
        if cell["cell_type"] == "markdown"
        else f"```python\n{''.join(cell['source'])}\n```"
        for cell in cells
    ]
    return "\n\n".join([texts[0], f"From `{name}`, to be run cell by cell.", *texts[1:]])


if __name__ == "__main__":
    prepare(FOLDER, sys.argv[1:])
