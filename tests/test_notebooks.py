"""The notebooks run as they are, in a kernel of this environment, and end with a picture.

One kernel serves all: its libraries are loaded once, its names are forgotten before each notebook.
"""

from pathlib import Path

import nbformat
import pytest
from jupyter_client import AsyncKernelManager
from nbclient import NotebookClient
from nbclient.util import run_sync

NOTEBOOKS = sorted((Path(__file__).parents[1] / "examples" / "notebooks").glob("*.ipynb"))
FEWER = {"repeat_the_paper": ('numbers = ("4_1", "4_2", "5_1", "5_2", "5_3")', 'numbers = ("4_1",)')}
"""What a notebook says of its ten movements, and what shows the same with two of them."""
HELD = {
    "my_own_controller": """
from pc_client.analysis.measures import snr_db, speed
for signals in mine.values():
    moving = signals.t <= plan.movement.duration
    t, p = signals.t[moving], signals.tcp_pose[moving, :3]
    wanted = snr_db(speed(t, plan.movement.sample(t).p), speed(t, p))
    assert judge(signals).endswith(f"{wanted:.1f} dB")
"""
}
"""What must hold at the end of a notebook: the Eq. 10 that it spells out is that of the reports."""


@pytest.fixture(scope="module")
def kernel():
    manager = AsyncKernelManager(kernel_name="python3")
    yield manager
    run_sync(manager.shutdown_kernel)(now=True)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, kernel):
    notebook = nbformat.read(path, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "clear its outputs before you commit it"
    if path.stem in FEWER:
        ten, two = FEWER[path.stem]
        (cell,) = [cell for cell in notebook.cells if ten in cell.source]
        cell.source = cell.source.replace(ten, two)
    notebook.cells.insert(0, nbformat.v4.new_code_cell("%reset -f"))
    notebook.cells.insert(-1, nbformat.v4.new_code_cell(HELD.get(path.stem, "")))
    client = NotebookClient(notebook, timeout=300, km=kernel)
    try:
        client.execute()
    finally:
        client.kc.stop_channels()
    assert "image/png" in notebook.cells[-1].outputs[-1].data
