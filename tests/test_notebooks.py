"""The notebooks run as they are, in a kernel of this environment, and end with a picture."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parents[1] / "examples" / "notebooks").glob("*.ipynb"))
FEWER = {"repeat_the_paper": ('numbers = ("4_1", "4_2", "5_1", "5_2", "5_3")', 'numbers = ("4_1",)')}
"""What a notebook says of its ten movements, and what shows the same with two of them."""


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "clear its outputs before you commit it"
    if path.stem in FEWER:
        ten, two = FEWER[path.stem]
        (cell,) = [cell for cell in notebook.cells if ten in cell.source]
        cell.source = cell.source.replace(ten, two)
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    assert "image/png" in notebook.cells[-1].outputs[-1].data
