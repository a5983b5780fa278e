"""Says where a result comes from: versions, commit, command."""

from __future__ import annotations

import platform
import shlex
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from packaging.version import Version

PACKAGES = ("usm-gym", "gymnasium", "numpy", "numba", "scipy", "stable-baselines3", "torch")
# The first version with today's plant. What an earlier one trained or scored belongs to its own.
PLANT_SINCE = Version("0.2.0")


def provenance(seeds: Any) -> dict[str, Any]:
    """Describe how a result was made.

    Args:
        seeds: The seeds on which it depends, or their origin.
    """
    packages = {name: known for name in PACKAGES if (known := _version(name)) is not None}
    return {
        "version": packages.get("usm-gym"),
        "commit": _commit(),
        "packages": {"python": platform.python_version(), **packages},
        "seeds": seeds,
        "command": _text(shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])),
    }


def older_plant(version: str | None) -> bool:
    """Whether a version of usm-gym is known to have another plant than this one.

    Raises:
        ValueError: If it is no version.
    """
    return version is not None and Version(version) < PLANT_SINCE


def _text(argument: str) -> str:
    """An argument as text: bytes that are not text, which a shell can pass, become escapes."""
    return argument.encode(errors="backslashreplace").decode()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _commit() -> str | None:
    """The commit of the checkout from which the package runs; None if there is no checkout."""
    package = sys.modules[__name__.partition(".")[0]]
    root = Path(str(package.__file__)).resolve().parents[1]
    if not (root / ".git").exists():
        return None
    try:
        answer = subprocess.run(
            ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12"],
            capture_output=True,
            text=True,
            timeout=10,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip()
