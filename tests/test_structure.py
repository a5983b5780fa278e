"""What importing the packages imports, and where tests stand; import-linter checks the layers."""

import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
ROOTS = [TESTS.parent / name for name in ("", "baselines", "agents")]
FOLDERS = sorted({file.parent.relative_to(TESTS) for file in TESTS.glob("*/**/test_*.py")})


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


@pytest.mark.parametrize("folder", FOLDERS, ids=str)
def test_a_folder_of_tests_has_the_name_of_what_it_tests(folder: Path) -> None:
    assert any((root / folder / "__init__.py").exists() for root in ROOTS)
