"""Commands that are killed and given again leave what undisturbed ones leave."""

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("optuna", reason="the extra `tune` is not installed")

KILLS = Path(__file__).parents[1] / "support" / "kills.py"


@pytest.mark.posix
@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [["--every", "train"], ["--kills", "1", "leaderboard", "study"]],
    ids=["at every write", "at random"],
)
def test_a_killed_command_ends_as_if_it_had_not_been(arguments):
    answer = subprocess.run(
        [sys.executable, KILLS, *arguments], capture_output=True, text=True, check=False
    )
    assert answer.returncode == 0, answer.stdout + answer.stderr
