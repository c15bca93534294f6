"""Port 30020: the lines of clients and the answers of the robot, however the bytes are cut."""

import re

import pytest
from codec_ways import events_of
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.interpreter import (
    CLEANED_UP,
    INVALID_STATE,
    MAX_LINE,
    TOO_MANY,
    InterpreterConnection,
    Statements,
    Word,
    acknowledge,
    discard,
    state,
)

# What the maker's example helper reads of an answer.
HELPER = re.compile(r"(\w+):\W+(\d+)?")
BLANKS = " \t\r\n\f\v"
LINES = st.one_of(
    st.sampled_from([word.value for word in Word]),
    st.text(st.characters(min_codepoint=0, max_codepoint=255, exclude_characters="\n"), max_size=40),
)


def events(data, cuts):
    """What the robot reads of bytes that come in pieces."""
    feed = events_of(InterpreterConnection())
    pieces = (data[start:end] for start, end in zip([0, *cuts], [*cuts, len(data)], strict=True))
    return [event for piece in pieces for event in feed(piece)]


def meaning(line):
    text = line.strip(BLANKS)
    words = [word for word in Word if word.value == text]
    return words[0] if words else Statements(text)


@given(st.lists(LINES, max_size=12), st.sampled_from(["\n", "\r\n"]), st.data())
def test_lines_are_the_same_whole_byte_by_byte_in_any_pieces_and_without_their_end(lines, end, data):
    sent = "".join(line + end for line in lines).encode("latin-1")
    expected = [meaning(line) for line in lines if line.strip(BLANKS)]
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=6)))
    assert events(sent, []) == expected
    assert events(sent, range(1, len(sent))) == expected
    assert events(sent, cuts) == expected
    assert events(sent + b"an unfinished line", cuts) == expected


@pytest.mark.parametrize("step", [7, 1000, MAX_LINE + 1])
def test_a_line_has_a_longest_length(step):
    InterpreterConnection().receive_data(b"x" * MAX_LINE + b"\n" + b"y" * MAX_LINE)
    connection = InterpreterConnection()
    for _ in range(MAX_LINE // step):
        connection.receive_data(b"x" * step)
    with pytest.raises(RemoteProtocolError, match=f"more than {MAX_LINE} bytes"):
        connection.receive_data(b"x" * step)


@given(
    LINES.filter(lambda line: line.strip(BLANKS) == line != ""),
    st.integers(0, 2**31 - 1),
    st.sampled_from(Word),
)
def test_answers_are_what_the_helper_of_the_maker_reads(text, number, word):
    for answer, kind, found, rest in (
        (acknowledge(number, text), "ack", str(number), text),
        (state(number, word), "state", str(number), word.value),
        (discard(INVALID_STATE, text), "discard", None, text),
    ):
        line = answer.decode("latin-1")
        assert line.endswith(f": {rest}\n")
        assert line.count("\n") == 1
        assert HELPER.match(line).groups() == (kind, found)


@pytest.mark.parametrize(
    "reason", [INVALID_STATE, TOO_MANY, CLEANED_UP, "Compile error: name 'x' is not defined"]
)
def test_a_reason_stands_between_the_first_colons(reason):
    assert discard(reason, "x = 1").decode().split(":")[1].strip() == reason.split(":")[0]


def test_an_answer_is_one_line():
    with pytest.raises(LocalProtocolError, match="line break"):
        acknowledge(1, "two\nlines")
