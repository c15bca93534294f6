from pathlib import Path

import pytest
from chunk_runner import load_chunks, matches, run_chunk, unknown_types

FILES = sorted(Path(__file__).parent.glob("chunks/*.script"))
CHUNKS = load_chunks(*FILES)


@pytest.mark.parametrize("chunk", CHUNKS, ids=str)
def test_chunk(chunk):
    run_chunk(chunk)


@pytest.mark.parametrize("chunk", CHUNKS, ids=str)
def test_chunk_without_static_types(chunk):
    with unknown_types():
        run_chunk(chunk)


def test_a_wrong_expectation_is_noticed():
    assert matches("a ... b", "a long b")
    assert not matches("a ... b", "a long c")
    assert not matches("division", "division by zero")
