"""What pyproject.toml and constraints.txt promise to those who install the package."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

from markdown_it import MarkdownIt
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [name.split(" :: ")[-1] for name in PROJECT["classifiers"] if "Python :: 3." in name]


def test_the_tested_versions_run_on_the_oldest_python():
    oldest = "3.11.0"
    assert oldest in SpecifierSet(PROJECT["requires-python"])
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    for line in lines:
        if line.startswith("#"):
            continue
        pin = Requirement(line)
        if pin.marker and not pin.marker.evaluate({"python_full_version": oldest}):
            continue
        try:
            needed = metadata(pin.name).get("Requires-Python")
        except PackageNotFoundError:
            continue
        assert needed is None or oldest in SpecifierSet(needed), (line, needed)


def test_the_pythons_named_are_those_of_numba():
    numba = metadata("numba").get_all("Classifier")
    assert all(f"Programming Language :: Python :: {python}" in numba for python in PYTHONS)
    assert all(f"{python}.0" in SpecifierSet(PROJECT["requires-python"]) for python in PYTHONS)


def test_what_an_index_shows_names_no_file_of_the_repository():
    text = PROJECT["readme"]["text"]
    inline = [child for token in MarkdownIt().parse(text) for child in token.children or ()]
    assert not [child for child in inline if child.type == "image"]
    links = [child.attrs["href"] for child in inline if child.type == "link_open"]
    assert links
    assert all(re.match("https://", link) for link in links)
