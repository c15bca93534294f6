"""The notebooks run as they are, in a kernel of this environment, and end with a picture.

One kernel serves all: its libraries are loaded once, its names are forgotten before each notebook.
"""

import json
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_cells_of_a_notebook_compile_and_have_no_outputs(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    for cell in (cell for cell in cells if cell["cell_type"] == "code"):
        compile("".join(line for line in cell["source"] if line[:1] not in "%!"), path.name, "exec")
        assert not cell["outputs"], "clear its outputs before you commit it"


@pytest.fixture(scope="module")
def kernel():
    from jupyter_client import AsyncKernelManager
    from nbclient.util import run_sync

    manager = AsyncKernelManager(kernel_name="python3")
    yield manager
    run_sync(manager.shutdown_kernel)(now=True)


@pytest.mark.nightly
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, kernel):
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
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
