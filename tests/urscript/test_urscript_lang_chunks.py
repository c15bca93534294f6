from pathlib import Path

import pytest
from chunk_runner import load_chunks, matches, run_chunk, unknown_types
from reference_rows import ELSEWHERE, ROWS

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


def test_every_row_of_the_language_notes_is_shown_by_a_chunk():
    assert {row for chunk in CHUNKS for row in chunk.rows} == set(ROWS)


@pytest.mark.parametrize("place", sorted(set(ELSEWHERE.values())))
def test_other_rows_are_shown_elsewhere(place):
    assert (Path(__file__).parents[2] / place).exists()
