"""Runs notebooks and stores them with what they find: `python notebooks/run.py [NAME...]`."""

import base64
import hashlib
import io
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

FOLDER = Path(__file__).parent
# Of a picture; few make a small file.
PALETTE = 256


def run(notebook, folder):
    """Run a notebook in a folder, and keep of its outputs what does not differ by machine."""
    NotebookClient(
        notebook, timeout=3600, record_timing=False, resources={"metadata": {"path": folder}}
    ).execute()
    notebook.metadata.language_info = {"name": "python"}
    for cell in code(notebook):
        cell.outputs = [compact(output) for output in joined(cell.outputs)]
    notebook.metadata["ran"] = digest(notebook)


def joined(outputs):
    """The outputs but for warnings, what is printed in a row as one."""
    shown = []
    for output in outputs:
        if output.get("name") == "stderr":
            continue
        if shown and output.output_type == shown[-1].output_type == "stream":
            shown[-1].text += output.text
        else:
            shown.append(output)
    return shown


def compact(output):
    """An output without the names of Python's objects, its picture with few colours."""
    data = output.get("data", {})
    if len(data) > 1:
        del data["text/plain"]
    if "image/png" in data:
        drawn = Image.open(io.BytesIO(base64.b64decode(data["image/png"]))).convert("RGB")
        small = io.BytesIO()
        # Spread over all colours, and then moved, so that a small part keeps its own.
        few = drawn.quantize(PALETTE, Image.Quantize.MAXCOVERAGE, kmeans=3)
        few.save(small, "png", optimize=True)
        data["image/png"] = base64.b64encode(small.getvalue()).decode()
        output.metadata = {}
    return output


def digest(notebook):
    """A fingerprint of a notebook's code, which says what its outputs are of."""
    sources = "\n".join(cell.source for cell in code(notebook))
    return hashlib.sha256(sources.encode()).hexdigest()[:16]


def code(notebook):
    """The cells of a notebook that are run."""
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


if __name__ == "__main__":
    for name in sys.argv[1:] or sorted(path.stem for path in FOLDER.glob("*.ipynb")):
        path = FOLDER / f"{name}.ipynb"
        notebook = nbformat.read(path, as_version=4)
        with tempfile.TemporaryDirectory() as scratch:
            run(notebook, scratch)
        nbformat.write(notebook, path)
