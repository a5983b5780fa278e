"""What the packages import with them; the layers themselves are checked by import-linter."""

import subprocess
import sys

HEAVY = {"argparse", "matplotlib", "rich", "torch"}


def test_importing_the_packages_imports_nothing_heavy() -> None:
    listed = "import sys, usm_gym, usm_baselines, usm_agents; print(*sys.modules)"
    answer = subprocess.run(
        [sys.executable, "-c", listed], capture_output=True, text=True, check=True
    )
    assert not HEAVY & set(answer.stdout.split())
