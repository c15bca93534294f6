"""The notebooks run as they are, in a kernel of this environment, and end with a picture."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parents[1] / "examples" / "notebooks").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "clear its outputs before you commit it"
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    assert "image/png" in notebook.cells[-1].outputs[-1].data
