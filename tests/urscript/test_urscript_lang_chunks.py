from pathlib import Path

import pytest
from chunk_runner import load_chunks, run_chunk

FILES = sorted(Path(__file__).parent.glob("chunks/lang_*.script"))
CHUNKS = load_chunks(*FILES)


@pytest.mark.parametrize("chunk", CHUNKS, ids=str)
def test_chunk(chunk):
    run_chunk(chunk)


def test_corpus_is_there():
    assert len(CHUNKS) >= 80
