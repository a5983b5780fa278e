"""The page of the reproduction has what the command has written."""

from pathlib import Path

from usm_baselines.paper.reproduction import ReproductionResult

import usm_gym
from usm_cli.commands.reproduce import lines

ROOT = Path(__file__).parents[2]


def test_the_table_of_the_page_is_that_of_its_figures():
    stored = ROOT / "results" / usm_gym.__version__ / "reproduction" / "table1.json"
    page = (ROOT / "docs" / "reproduction.md").read_text(encoding="utf-8")
    for row in lines(ReproductionResult.read(stored)):
        assert f"| {' | '.join(row)} |" in page
