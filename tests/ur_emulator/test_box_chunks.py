"""The conformance corpus of the box: every builtin that needs a robot, and every error text of the box."""

from pathlib import Path

import pytest
from chunk_bench import run_box_chunk
from chunk_marks import load_box_chunks

FILES = sorted(Path(__file__).parent.glob("chunks/*.script"))
CHUNKS = load_box_chunks(*FILES)


@pytest.mark.parametrize("chunk", CHUNKS, ids=str)
def test_box_chunk(chunk):
    run_box_chunk(chunk)
