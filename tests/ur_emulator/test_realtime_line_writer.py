"""Lines for somebody who does not read them: nobody waits, and what is lost is told."""

import os
from dataclasses import replace

import pytest
from box_support import TIMEOUT
from hypothesis import given
from hypothesis import strategies as st

from protocol.primary.messages import ReportLevel
from ur_emulator.host.box_log import LogEntry, printable
from ur_emulator.host.runtime import line_writer
from ur_emulator.host.runtime.line_writer import LineWriter

_LOST = ["lines", "of", "the", "log", "were", "lost:", "they", "were", "not", "read", "in", "time"]


@pytest.fixture
def pipe():
    """The end to read from, and a stream."""
    near, far = os.pipe()
    with open(near, encoding="latin-1") as end, open(far, "w", encoding="latin-1") as stream:
        yield end, stream


def writer_to(stream):
    return LineWriter(stream, "the log")


def test_lines_come_in_order_and_the_last_one_before_the_end(pipe):
    end, stream = pipe
    writer = writer_to(stream)
    lines = [f"line {k} \xe9" for k in range(500)]
    for line in lines:
        writer.write(line)
    writer.close()
    writer._thread.join(TIMEOUT)
    stream.close()
    assert end.read().splitlines() == lines


def test_no_thread_waits_for_a_reader_and_the_reader_gets_how_much_was_lost(pipe, monkeypatch):
    monkeypatch.setattr(line_writer, "BUDGETS", replace(line_writer.BUDGETS, log_lines=50))
    end, stream = pipe
    writer = writer_to(stream)
    n = 1_000
    for k in range(n):
        writer.write(f"{k} " + "x" * 10_000)
    writer.close()
    assert writer._thread.is_alive()  # it waits for the reader, and nobody waits for it
    k, n_lost = 0, 0
    while k < n:
        words = end.readline().split()
        if words[1:] == _LOST:
            n_lost += int(words[0])
            k += int(words[0])
        else:
            assert words[0] == str(k)
            k += 1
    assert n_lost
    writer._thread.join(TIMEOUT)
    assert not writer._thread.is_alive()


def test_a_reader_that_goes_ends_it(pipe):
    end, stream = pipe
    writer = writer_to(stream)
    end.close()
    writer.write("a")
    writer._thread.join(TIMEOUT)
    assert not writer._thread.is_alive()
    for each in (writer, writer_to(None)):  # also in a process without the stream
        each.write("b")
        each.close()


def test_a_descriptor_that_somebody_made_non_blocking_is_waited_for(pipe):
    end, stream = pipe
    os.set_blocking(stream.fileno(), False)
    writer = writer_to(stream)
    lines = ["x" * 1000 + str(k) for k in range(200)]
    for line in lines:
        writer.write(line)
    assert [end.readline().rstrip("\n") for _ in lines] == lines
    writer.close()


@given(st.text())
def test_what_is_printed_has_nothing_that_a_terminal_obeys(text):
    line = str(LogEntry(1, 0.008, ReportLevel.INFO, "Client", text))
    assert line.isprintable()
    if text.isprintable():
        assert line == f"0.008 INFO Client: {text}"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[2J", r"\x1b[2J"),
        ("a\rb\nc\td", r"a\rb\nc\td"),
        ("\a\x7f\x9b", r"\x07\x7f\x9b"),
        ("\u202etxt", r"\u202etxt"),
        ("é 日本", "é 日本"),
    ],
)
def test_control_characters_are_escaped(text, shown):
    assert printable(text) == shown
