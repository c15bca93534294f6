"""What PolyScope's log tab would show of the box: programs, errors, safety, text messages, clients.

The log is filled from the controller's events and the ports' notices; it is bounded, and its times are robot
time. Texts: `Starting program: <name>` and `Runtime error (<line>:<column>): ...` as seen in logs of
real controllers; the others are ours.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

from protocol.primary.messages import ReportLevel
from protocol.ur_types import RobotMode, SafetyMode
from ur_emulator.machine.controller import events

if TYPE_CHECKING:
    from ur_emulator.machine.models.robot_generation import RobotGeneration

# Most entries, the oldest are removed; longest text of an entry in characters.
MAX_ENTRIES = 5000
MAX_TEXT = 1000


@dataclass(frozen=True, slots=True)
class LogEntry:
    """One line of the log.

    Attributes:
        tick: controller cycle in which it was written, at `time` seconds since controller start.
        source: part of the box: Program, Controller, Safety, Client, Dashboard.
        text: without line breaks at its end; as a client or a program has sent it.
        code: `C<code>A<argument>` of an error code, "" for everything else.
    """

    tick: int
    time: float
    level: ReportLevel
    source: str
    text: str
    code: str = ""

    def __str__(self) -> str:
        code = f"{self.code} " if self.code else ""
        return printable(f"{self.time:.3f} {self.level.name} {self.source}: {code}{self.text}")


def printable(text: str) -> str:
    """Return a text with all characters escaped that a terminal obeys instead of printing them."""
    return text if text.isprintable() else "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class BoxLog:
    """The last entries; followers are called with new ones. `count` includes those that were removed."""

    def __init__(self, generation: RobotGeneration) -> None:
        """Begin an empty log; the generation of the robot decides how long a cycle is."""
        self.count = 0
        self._generation = generation
        self._entries: deque[LogEntry] = deque(maxlen=MAX_ENTRIES)
        self._followers: list[Callable[[LogEntry], None]] = []

    @property
    def entries(self) -> tuple[LogEntry, ...]:
        """The last entries, the oldest first; from any thread: to Python the copying is one step."""
        return tuple(self._entries)

    def since(self, count: int) -> list[LogEntry]:
        """Return what is kept of all entries but the first `count`; in the loop's thread."""
        new = max(0, self.count - count)
        return list(islice(self._entries, max(0, len(self._entries) - new), None))

    def follow(self, follower: Callable[[LogEntry], None]) -> None:
        """Call `follower` with every entry from now on; it must not block and must not raise."""
        self._followers.append(follower)

    def note(self, event: events.Event, tick: int) -> None:
        """Write down an event of the controller."""
        level, source, text, code = _describe(event)
        self.write(tick, source, text, level, code)

    def write(
        self, tick: int, source: str, text: str, level: ReportLevel = ReportLevel.INFO, code: str = ""
    ) -> None:
        """Write an entry; what is too long is cut."""
        if len(text) > MAX_TEXT:
            text = text[: MAX_TEXT - 3] + "..."
        entry = LogEntry(tick, self._generation.seconds(tick), level, source, text.rstrip("\r\n"), code)
        self._entries.append(entry)
        self.count += 1
        for follower in self._followers:
            follower(entry)


_Line = tuple[ReportLevel, str, str, str]


def _line(source: str, text: str, level: ReportLevel = ReportLevel.INFO, code: str = "") -> _Line:
    return level, source, text, code


def _describe(event: events.Event) -> _Line:
    """Return level, source, text and code of the entry for an event."""
    match event:
        case events.ProgramStarted(name):
            return _line("Program", f"Starting program: {name}")
        case events.ProgramStopped(name):
            return _line("Program", f"Program stopped: {name}")
        case events.ProgramPaused(name):
            return _line("Program", f"Program paused: {name}")
        case events.ProgramResumed(name):
            return _line("Program", f"Program resumed: {name}")
        case events.TextPrinted(text):
            return _line("Program", text)
        case events.ScriptFailed(_, _, text, secondary, log_text):
            prefix = "Secondary program: " if secondary else ""
            return _line("Program", prefix + (log_text or text), ReportLevel.FAULT)
        case events.ErrorReported(code, argument, level, text):
            # Warnings of ours that have no number go without one.
            return _line("Controller", text, level, f"C{code}A{argument}" if code else "")
        case events.SafetyModeChanged(safety_mode):
            mode = SafetyMode(safety_mode)
            level = ReportLevel.INFO if mode is SafetyMode.NORMAL else ReportLevel.WARNING
            return _line("Safety", f"Safety mode: {mode.name}", level)
        case events.RobotModeChanged(robot_mode):
            return _line("Controller", f"Robot mode: {RobotMode(robot_mode).name}")
        case events.LogAdded(source, text):
            return _line(source, text)
        case events.ValueRequested(_, kind, text):
            return _line("Program", f"Waiting for a value ({kind.name.lower()}): {text}")
        case events.PopupShown(title, text, warning, error):
            level = ReportLevel.FAULT if error else ReportLevel.WARNING if warning else ReportLevel.INFO
            return _line("Program", f"Popup: {title}: {text}", level)
