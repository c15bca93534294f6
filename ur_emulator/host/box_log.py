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


class LogBook:
    """The last entries; followers are called with new ones. `count` includes those that were removed."""

    def __init__(self) -> None:
        self.count = 0
        self._entries: deque[LogEntry] = deque(maxlen=MAX_ENTRIES)
        self._followers: list[Callable[[LogEntry], None]] = []

    @property
    def entries(self) -> tuple[LogEntry, ...]:
        """The last entries, the oldest first; from any thread: to Python the copying is one step."""
        return tuple(self._entries)

    def since(self, count: int) -> list[LogEntry]:
        """Return what is kept of all entries but the first `count`; in the thread that adds."""
        new = max(0, self.count - count)
        return list(islice(self._entries, max(0, len(self._entries) - new), None))

    def follow(self, follower: Callable[[LogEntry], None]) -> None:
        """Call `follower` with every entry from now on; it must not block and must not raise."""
        self._followers.append(follower)

    def add(self, entry: LogEntry) -> None:
        """Take an entry."""
        self._entries.append(entry)
        self.count += 1
        for follower in self._followers:
            follower(entry)


class BoxLog(LogBook):
    """The log of a box; the generation of its robot decides how long a cycle is."""

    def __init__(self, generation: RobotGeneration) -> None:
        super().__init__()
        self._generation = generation

    def note(self, event: events.Event, tick: int) -> None:
        """Write down an event of the controller."""
        self.write(tick, *_describe(event))

    def write(
        self, tick: int, source: str, text: str, level: ReportLevel = ReportLevel.INFO, code: str = ""
    ) -> None:
        """Write an entry; what is too long is cut."""
        if len(text) > MAX_TEXT:
            text = text[: MAX_TEXT - 3] + "..."
        time = self._generation.seconds(tick)
        self.add(LogEntry(tick, time, level, source, text.rstrip("\r\n"), code))


# Source and text of an entry; perhaps its level, and its code.
_Line = tuple[str, str] | tuple[str, str, ReportLevel] | tuple[str, str, ReportLevel, str]


def _describe(event: events.Event) -> _Line:
    match event:
        case events.ProgramStarted(name):
            return "Program", f"Starting program: {name}"
        case events.ProgramStopped(name):
            return "Program", f"Program stopped: {name}"
        case events.ProgramPaused(name):
            return "Program", f"Program paused: {name}"
        case events.ProgramResumed(name):
            return "Program", f"Program resumed: {name}"
        case events.TextPrinted(text):
            return "Program", text
        case events.ScriptFailed(_, _, text, secondary, log_text):
            prefix = "Secondary program: " if secondary else ""
            return "Program", prefix + (log_text or text), ReportLevel.FAULT
        case events.ErrorReported(code, argument, level, text):
            # Warnings of ours that have no number go without one.
            return "Controller", text, level, f"C{code}A{argument}" if code else ""
        case events.SafetyModeChanged(safety_mode):
            mode = SafetyMode(safety_mode)
            level = ReportLevel.INFO if mode is SafetyMode.NORMAL else ReportLevel.WARNING
            return "Safety", f"Safety mode: {mode.name}", level
        case events.RobotModeChanged(robot_mode):
            return "Controller", f"Robot mode: {RobotMode(robot_mode).name}"
        case events.LogAdded(source, text):
            return source, text
        case events.ValueRequested(_, kind, text):
            return "Program", f"Waiting for a value ({kind.name.lower()}): {text}"
        case events.PopupShown(title, text, warning, error):
            level = ReportLevel.FAULT if error else ReportLevel.WARNING if warning else ReportLevel.INFO
            return "Program", f"Popup: {title}: {text}", level
