r"""The robot's side of interpreter mode's line protocol (port 30020), without I/O.

    PC -> robot   statements\n                 one or more statements of URScript in one line
    robot -> PC   ack: <id>: <statements>\n    they were compiled and are executed in their turn
    robot -> PC   discard: <reason>: <statements>\n
    PC -> robot   statelastexecuted\n          a word alone on its line is answered at once
    robot -> PC   state: <number>: statelastexecuted\n

Source: script manual 5.11, chapter Interpreter mode. The manual has no texts of reasons. Those here are what
public clients look for in the answers of a UR (`Program is in an invalid state`, `Too many interpreted
messages`, `Compile error`, `Syntax error`); `CLEANED_UP` is that of another maker's box with the same mode.
The number in the answers to `abort` and `skipbuffer` has no meaning; clients read one.
"""

from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import Final

from protocol.errors import LocalProtocolError, RemoteProtocolError

__all__ = [
    "CLEANED_UP",
    "INVALID_STATE",
    "MAX_ID",
    "MAX_LINE",
    "TOO_MANY",
    "InterpreterConnection",
    "Statements",
    "Word",
    "acknowledge",
    "discard",
    "state",
]

MAX_LINE: Final = 1 << 15
"""Longest line in bytes. No document gives a limit; the longest lines of clients have some thousand."""

MAX_ID: Final = 2**31 - 1
"""After it ids begin at 1 again; where they do is chosen."""

INVALID_STATE: Final = "Program is in an invalid state"
"""Reason of a discard: no program runs."""

TOO_MANY: Final = "Too many interpreted messages"
"""Reason of a discard: too much was interpreted since the last `clear_interpreter()`, or waits for it."""

CLEANED_UP: Final = "Cleaned up before interpretation"
"""Reason of a discard: interpreter mode began with an empty queue, or `skipbuffer` came first."""

_BLANKS: Final = " \t\r\n\f\v"


class Word(Enum):
    """A word that acts at once; it stands alone on its line."""

    ABORT = "abort"
    SKIP_BUFFER = "skipbuffer"
    LAST_EXECUTED = "statelastexecuted"
    LAST_INTERPRETED = "statelastinterpreted"
    LAST_CLEARED = "statelastcleared"
    UNEXECUTED = "stateunexecuted"


@dataclass(frozen=True, slots=True)
class Statements:
    """A line that is no word: statements, one character a byte."""

    text: str


_WORDS: Final = {word.value: word for word in Word}


class InterpreterConnection:
    """What one client has sent, as the robot sees it. Blank lines get no answer."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._lines: deque[str] = deque()

    def receive_data(self, data: bytes) -> None:
        """Take what the socket gave; after a RemoteProtocolError, a line beyond `MAX_LINE`, close it."""
        *lines, rest = data.split(b"\n")
        for line in lines:
            self._append(line)
            text = self._buffer.decode("latin-1").strip(_BLANKS)
            self._buffer.clear()
            if text:
                self._lines.append(text)
        self._append(rest)

    def _append(self, part: bytes) -> None:
        self._buffer += part
        if len(self._buffer) > MAX_LINE:
            raise RemoteProtocolError(f"a line for the interpreter has more than {MAX_LINE} bytes")

    def next_event(self) -> Word | Statements | None:
        """The next complete line, or None when more bytes are needed."""
        if not self._lines:
            return None
        line = self._lines.popleft()
        return _WORDS.get(line) or Statements(line)


def acknowledge(number: int, text: str) -> bytes:
    """The answer to statements that were compiled, and to words that act."""
    return _line(f"ack: {number}: {text}")


def discard(reason: str, text: str) -> bytes:
    """The answer to statements that are not executed."""
    return _line(f"discard: {reason}: {text}")


def state(number: int, word: Word) -> bytes:
    """The answer to a word that asks."""
    return _line(f"state: {number}: {word.value}")


def _line(text: str) -> bytes:
    if "\n" in text:
        raise LocalProtocolError(f"an answer of the interpreter cannot hold a line break: {text!r}")
    return text.encode("latin-1", "replace") + b"\n"
