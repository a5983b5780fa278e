"""Where a result comes from."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import usm_gym
from usm_gym.support.provenance import older_plant

COMMIT = "from usm_gym.support.provenance import provenance; print(provenance(0)['commit'])"


@pytest.fixture
def checkout(tmp_path):
    """A repository with a copy of the package in it, and its commit."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(Path(usm_gym.__file__).parent, tmp_path / "usm_gym", ignore=ignored)
    git = ("git", "-C", str(tmp_path), "-c", "user.name=me", "-c", "user.email=me@example.org")
    subprocess.run([*git, "init", "--quiet"], check=True)
    subprocess.run([*git, "add", "usm_gym"], check=True)
    subprocess.run([*git, "commit", "--quiet", "--message", "all"], check=True)
    short = [*git, "rev-parse", "--short=12", "HEAD"]
    return tmp_path, subprocess.run(
        short, capture_output=True, text=True, check=True
    ).stdout.strip()


def commit(folder):
    answer = subprocess.run(
        [sys.executable, "-c", COMMIT],
        capture_output=True,
        text=True,
        check=True,
        cwd=folder,
        env={"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "PATH": "/usr/bin:/bin"},
    )
    return answer.stdout.strip()


def test_the_commit_is_that_of_the_checkout_and_says_what_is_not_committed(checkout):
    folder, expected = checkout
    assert commit(folder) == expected
    with (folder / "usm_gym" / "robot.py").open("a") as file:
        file.write("# edited\n")
    assert commit(folder) == f"{expected}-dirty"


def test_a_package_installed_inside_another_repository_has_no_commit_of_it(checkout):
    folder, _ = checkout
    shutil.move(folder / "usm_gym", folder / "site-packages" / "usm_gym")
    assert commit(folder / "site-packages") == "None"


def test_a_version_has_an_older_plant_or_not():
    assert [older_plant(version) for version in ("0.1.0", "0.2.0", "0.10.0")] == [
        True,
        False,
        False,
    ]
    assert not older_plant(None)
