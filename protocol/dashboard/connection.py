r"""The dashboard server's line protocol without I/O, for either end.

    robot -> PC   greeting\n                 once, on accept
    PC -> robot   command [argument]\n
    robot -> PC   reply\n                    exactly one line for every line, in order

The robot's side: `greet`, then `receive_data`, `next_event` until it gives None, one `reply` for each event.
The PC's side: `receive_data` until a `Greeting` comes, then `command` and wait for the `Reply`.
Bytes that a method returns are to be sent. After a LocalProtocolError nothing has changed; after a
RemoteProtocolError the connection is to be closed.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from protocol.dashboard.commands import (
    GREETING,
    DashboardCommand,
    find,
    match_command,
    unknown_command_reply,
)
from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.ur_types import SoftwareVersion

__all__ = [
    "MAX_LINE",
    "MAX_WAITING",
    "CommandReceived",
    "DashboardConnection",
    "DashboardEvent",
    "Greeting",
    "Reply",
    "Role",
    "UnknownCommand",
]

MAX_LINE = 1 << 16
"""Longest line in bytes at either end; no document names a limit, no client comes near this one."""

MAX_WAITING = 1 << 20
"""Bytes of lines that may wait for their answer; nobody asks so much while one command takes its time."""

_NEWEST_CB3 = SoftwareVersion(3, 15)


class Role(Enum):
    """Which end we are."""

    ROBOT = "robot"
    PC = "pc"


@dataclass(frozen=True, slots=True)
class CommandReceived:
    """A command that this software knows, with its argument ("" without one)."""

    command: DashboardCommand
    argument: str


@dataclass(frozen=True, slots=True)
class UnknownCommand:
    """A line that is no command of this software; `answer` is what the robot replies."""

    line: str
    answer: str


@dataclass(frozen=True, slots=True)
class Greeting:
    """The robot's first line."""

    text: str


@dataclass(frozen=True, slots=True)
class Reply:
    """The answer to the oldest command that had none yet."""

    command: str
    text: str


DashboardEvent: TypeAlias = CommandReceived | UnknownCommand | Greeting | Reply


class DashboardConnection:
    """One connection, as the robot or as the PC sees it.

    Args:
        our_role: which end we are.
        version: software of the robot; decides which commands the robot's side knows.
    """

    def __init__(self, our_role: Role, version: SoftwareVersion = _NEWEST_CB3) -> None:
        self._role = our_role
        self._version = version
        self._buffer = bytearray()
        self._lines: deque[str] = deque()
        self._waiting = 0
        self._greeted = False
        self._unanswered: deque[str] = deque()
        self._closed = False

    @property
    def is_closed(self) -> bool:
        """True after `quit` has been answered: the robot closes the socket, nothing more is read."""
        return self._closed

    def receive_data(self, data: bytes) -> None:
        """Take what the socket gave.

        Raises:
            RemoteProtocolError: a line beyond `MAX_LINE`, lines beyond `MAX_WAITING`; close the connection.
        """
        if self._closed:
            return
        self._buffer += data
        *lines, self._buffer = self._buffer.split(b"\n")
        if any(len(line) > MAX_LINE for line in (*lines, self._buffer)):
            raise RemoteProtocolError(f"a dashboard line has more than {MAX_LINE} bytes")
        self._waiting += sum(map(len, lines)) + len(lines)
        if self._waiting > MAX_WAITING:
            raise RemoteProtocolError(f"more than {MAX_WAITING} bytes of dashboard lines wait for an answer")
        self._lines.extend(line.decode("latin-1").strip() for line in lines)

    def next_event(self) -> DashboardEvent | None:
        """The next complete line as an event, or None when more bytes are needed.

        Raises:
            RemoteProtocolError: at the PC, a line that answers nothing.
        """
        if self._closed or not self._lines:
            return None
        line = self._lines.popleft()
        self._waiting = max(0, self._waiting - len(line) - 1) if self._lines else 0
        if self._role is Role.PC:
            return self._read_robot(line)
        self._unanswered.append(line)
        matched = match_command(line, self._version)
        return CommandReceived(*matched) if matched else UnknownCommand(line, unknown_command_reply(line))

    def _read_robot(self, line: str) -> Greeting | Reply:
        if not self._greeted:
            self._greeted = True
            return Greeting(line)
        if not self._unanswered:
            raise RemoteProtocolError(f"the dashboard server said {line!r} although nothing was asked")
        command = self._unanswered.popleft()
        self._closed = command == "quit"
        return Reply(command, line)

    # --- robot's side ---

    def greet(self) -> bytes:
        """The robot's first line, to be sent on accept."""
        self._must_be(Role.ROBOT, "greet")
        if self._greeted:
            raise LocalProtocolError("the greeting is sent once, on accept")
        self._greeted = True
        return _line(GREETING)

    def reply(self, text: str) -> bytes:
        """Answer the oldest command that has no answer yet."""
        self._must_be(Role.ROBOT, "reply")
        if not self._unanswered:
            raise LocalProtocolError(f"{text!r} answers nothing: one reply for each command")
        data = _line(text)
        self._closed = self._unanswered.popleft() == "quit"
        return data

    # --- PC's side ---

    def command(self, name: str, argument: str = "") -> bytes:
        """Ask for a command of the table, with its argument if it takes one."""
        self._must_be(Role.PC, "command")
        if self._closed:
            raise LocalProtocolError("the dashboard connection has been quit: open a new one")
        row = find(name)
        if argument and not row.argument:
            raise LocalProtocolError(f"{name!r} takes no argument, {argument!r} was given")
        line = f"{name} {argument}".rstrip()
        data = _line(line)
        self._unanswered.append(line)
        return data

    def _must_be(self, role: Role, method: str) -> None:
        if self._role is not role:
            raise LocalProtocolError(
                f"{method} is for the {role.value}'s end, this is the {self._role.value}'s"
            )


def _line(text: str) -> bytes:
    if "\n" in text or "\r" in text:
        raise LocalProtocolError(f"a dashboard line cannot hold a line break: {text!r}")
    data = text.encode("latin-1", "replace") + b"\n"
    if len(data) > MAX_LINE:
        raise LocalProtocolError(f"a dashboard line of {len(data)} bytes is longer than {MAX_LINE}")
    return data
