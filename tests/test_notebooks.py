"""The notebooks run from top to bottom, and are stored with what they found."""

import re
import runpy
from operator import itemgetter
from pathlib import Path

import nbformat
import pytest

NOTEBOOKS = Path(__file__).parent.parent / "notebooks"
run, code, digest = itemgetter("run", "code", "digest")(runpy.run_path(str(NOTEBOOKS / "run.py")))
# What the cell tagged "parameters" is to say instead, so that a run is short.
SHORT = {
    "first_steps": {"PICTURE": 1.0, "EPISODES": 2},
    "in_space": {"PICTURE": 1.0, "EPISODES": 2},
    "own_controller": {"BANDWIDTHS": (6.0, 10.0), "SAMPLED": 2, "EPISODES": 2},
    "train_residual": {"STEPS": 1, "EPISODES": 2},
    "write_under_water": {"EPISODES": 2},
}


def read(name):
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)


def test_all_notebooks_are_tested():
    assert {path.stem for path in NOTEBOOKS.glob("*.ipynb")} == set(SHORT)


@pytest.mark.parametrize("name", SHORT)
def test_its_outputs_are_of_the_code_beside_them(name):
    notebook = read(name)
    assert notebook.metadata["ran"] == digest(notebook)


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
    run(notebook, tmp_path)
    # Cells tagged "same" do not depend on the parameters, so that a short run prints the same. Of
    # all others only the kinds are compared: pictures differ by the version of matplotlib, and what
    # is learned and scored by the length of the run.
    for found, stored in zip(code(notebook), code(read(name)), strict=True):
        assert kinds(found) == kinds(stored), found.id
        if "same" in found.metadata.get("tags", ()):
            assert printed(found) == printed(stored), found.id


def kinds(cell):
    """What a cell shows, as media types and names of streams."""
    return [output.get("name") or list(output.data) for output in cell.outputs]


def printed(cell):
    """What a cell prints."""
    return "".join(output.text for output in cell.outputs if output.output_type == "stream")
