"""The notebooks run from top to bottom, and are stored without what they found."""

import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).parent.parent / "notebooks"
# What the cell tagged "parameters" is to say instead, so that a run is short.
SHORT = {
    "first_steps": {"PICTURE": 1.0, "EPISODES": 2},
    "own_controller": {"BANDWIDTHS": (6.0, 10.0), "SAMPLED": 2, "EPISODES": 2},
    "train_residual": {"STEPS": 1, "EPISODES": 2},
}


def read(name):
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)


def test_all_notebooks_are_tested():
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == set(SHORT)


@pytest.mark.parametrize("name", SHORT)
def test_it_is_stored_without_outputs(name):
    for cell in read(name).cells:
        if cell.cell_type == "code":
            assert not cell.outputs
            assert cell.execution_count is None


@pytest.mark.slow
@pytest.mark.parametrize("name", SHORT)
def test_it_runs(name, tmp_path):
    notebook = read(name)
    (cell,) = (each for each in notebook.cells if "parameters" in each.metadata.get("tags", ()))
    for parameter, value in SHORT[name].items():
        cell.source, found = re.subn(
            rf"^{parameter} = .*", f"{parameter} = {value!r}", cell.source, flags=re.MULTILINE
        )
        assert found == 1, f"{parameter} is no parameter of {name}"
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": tmp_path}}).execute()
