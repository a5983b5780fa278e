"""What importing the packages imports; import-linter checks the layers."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("packages", "heavy"),
    [
        ("usm_gym, usm_baselines, usm_agents", {"argparse", "matplotlib", "rich", "torch"}),
        ("usm_cli.program", {"matplotlib", "torch"}),
    ],
)
def test_importing_imports_nothing_heavy(packages: str, heavy: set[str]) -> None:
    code = f"import sys, {packages}; print(*sys.modules)"
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not heavy & set(answer.stdout.split())
