r"""The robot's side of the dashboard server's line protocol, without I/O.

    robot -> PC   greeting\n                 once, on accept
    PC -> robot   command [argument]\n
    robot -> PC   reply\n                    exactly one line for every line, in order

Call `greet` on accept, then `receive_data`, then `next_event` until it returns None, and `reply` once for
each event. Send the bytes that a method returns. After a LocalProtocolError nothing has changed; after a
RemoteProtocolError close the connection.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from protocol.dashboard.commands import GREETING, DashboardCommand, match_command, unknown_command_reply
from protocol.errors import LocalProtocolError, RemoteProtocolError

__all__ = ["MAX_LINE", "CommandReceived", "DashboardConnection", "DashboardEvent", "UnknownCommand"]

MAX_LINE = 1 << 16
"""Longest line in bytes. No document gives a limit; clients send much shorter lines."""


@dataclass(frozen=True, slots=True)
class CommandReceived:
    """A command that this software knows, with its argument ("" without one)."""

    command: DashboardCommand
    argument: str


@dataclass(frozen=True, slots=True)
class UnknownCommand:
    """A line that this software does not know; `answer` is the robot's reply."""

    line: str
    answer: str


DashboardEvent = CommandReceived | UnknownCommand


class DashboardConnection:
    """One connection, as the robot sees it, with the commands that the robot's software knows, by name."""

    def __init__(self, commands: Mapping[str, DashboardCommand]) -> None:
        self._commands = commands
        self._buffer = bytearray()
        self._lines: deque[str] = deque()
        self._unanswered: deque[str] = deque()
        self._closed = False

    @property
    def is_closed(self) -> bool:
        """True after `quit` has been answered: the robot closes the socket, nothing more is read."""
        return self._closed

    def receive_data(self, data: bytes) -> None:
        """Take what the socket gave; after a RemoteProtocolError, a line beyond `MAX_LINE`, close it."""
        if self._closed:
            return
        self._buffer += data
        *lines, self._buffer = self._buffer.split(b"\n")
        if any(len(line) > MAX_LINE for line in (*lines, self._buffer)):
            raise RemoteProtocolError(f"a dashboard line has more than {MAX_LINE} bytes")
        self._lines.extend(line.decode("latin-1").strip() for line in lines)

    def next_event(self) -> DashboardEvent | None:
        """The next complete line as an event, or None when more bytes are needed."""
        if self._closed or not self._lines:
            return None
        line = self._lines.popleft()
        self._unanswered.append(line)
        matched = match_command(line, self._commands)
        return CommandReceived(*matched) if matched else UnknownCommand(line, unknown_command_reply(line))

    def greet(self) -> bytes:
        """The robot's first line, to be sent on accept."""
        return _line(GREETING)

    def reply(self, text: str) -> bytes:
        """Answer the oldest command that has no answer yet."""
        if not self._unanswered:
            raise LocalProtocolError(f"{text!r} answers nothing: one reply for each command")
        data = _line(text)
        self._closed = self._unanswered.popleft() == "quit"
        return data


def _line(text: str) -> bytes:
    if "\n" in text or "\r" in text:
        raise LocalProtocolError(f"a dashboard line cannot hold a line break: {text!r}")
    data = text.encode("latin-1", "replace") + b"\n"
    if len(data) > MAX_LINE:
        raise LocalProtocolError(f"a dashboard line of {len(data)} bytes is longer than {MAX_LINE}")
    return data
