"""What pyproject.toml and constraints.txt promise to those who install the package."""

import re
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

import numpy as np
import pytest
from markdown_it import MarkdownIt
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PYTHONS = [name.split(" :: ")[-1] for name in PROJECT["classifiers"] if "Python :: 3." in name]
PACKAGES = {
    "usm_gym": ROOT / "usm_gym",
    "usm_baselines": ROOT / "baselines" / "usm_baselines",
    "usm_agents": ROOT / "agents" / "usm_agents",
    "usm_cli": ROOT / "usm_cli",
}
OTHERS = ("agents", "baselines")
# What must work in an environment, by the distribution that owns it.
USES = {
    "usm-gym": (
        "import sys, usm_agents, usm_baselines, usm_gym, usm_cli.main; "
        "assert usm_gym.__file__.startswith(sys.prefix); usm_gym.suite('table1'); "
        "sys.argv[1:] = ['policies']; usm_cli.main.main()"
    ),
    "others": "; ".join(f"import {name}; assert {name}.OWNER == 'others'" for name in OTHERS),
}


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


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    pytest.importorskip("hatchling", reason="the extra `dev` is not installed")
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
    subprocess.run(build, cwd=ROOT, check=True)
    (built,) = folder.glob("*.whl")
    return built


@pytest.mark.slow
def test_the_wheel_holds_the_four_packages_whole_and_nothing_else(wheel):
    expected = {
        f"{name}/{path.relative_to(folder).as_posix()}"
        for name, folder in PACKAGES.items()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert held == expected
    assert {Path(name).suffix for name in held} > {".html", ".js", ".json", ".safetensors"}


@pytest.fixture
def stub(tmp_path):
    """A distribution that owns the packages `agents` and `baselines`, as others do."""
    path = tmp_path / "others-1-py3-none-any.whl"
    files = {f"{name}/__init__.py": "OWNER = 'others'\n" for name in OTHERS} | {
        "others-1.dist-info/METADATA": "Metadata-Version: 2.1\nName: others\nVersion: 1\n",
        "others-1.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\n",
    }
    record = "others-1.dist-info/RECORD"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
        archive.writestr(record, "".join(f"{name},,\n" for name in [*files, record]))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("order", [("usm-gym", "others"), ("others", "usm-gym")])
def test_it_lives_beside_those_who_own_agents_and_baselines(order, wheel, stub, tmp_path):
    """Whichever comes first, both work; the first is removed, and the second works still."""
    home = tmp_path / "environment"
    venv.create(home)
    paths = sysconfig.get_paths("venv", vars={"base": str(home), "platbase": str(home)})
    python = Path(paths["scripts"], Path(sys.executable).name)
    # Dependencies come from here; what is installed here as editable is not found that way.
    here = Path(np.__file__).parents[1]
    Path(paths["purelib"], "dependencies.pth").write_text(f"{here}\n")

    def pip(*arguments):
        command = [sys.executable, "-m", "pip", "--python", home, *arguments]
        subprocess.run(command, check=True)

    def works(name):
        subprocess.run([python, "-I", "-c", USES[name]], cwd=tmp_path, check=True)

    for name in order:
        files = {"usm-gym": wheel, "others": stub}
        pip("install", "--no-index", "--no-deps", "--no-compile", files[name])
    for name in order:
        works(name)
    pip("uninstall", "--yes", order[0])
    works(order[1])
