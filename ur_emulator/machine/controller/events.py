"""Events of the controller: frozen records that ports and log turn into messages."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from protocol.primary.messages import ReportLevel, RequestedType

if TYPE_CHECKING:
    from urscript import RunningProgram


@dataclass(frozen=True, slots=True)
class ProgramStarted:
    """A primary program began; its name is that of its `def`, or of the function that it calls."""

    name: str
    run: RunningProgram | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class ProgramStopped:
    """A primary program ended or was stopped."""

    name: str


@dataclass(frozen=True, slots=True)
class ProgramPaused:
    """The primary program is paused, and the arm is at rest."""

    name: str


@dataclass(frozen=True, slots=True)
class ProgramResumed:
    """A paused program continues."""

    name: str


@dataclass(frozen=True, slots=True)
class TextPrinted:
    """A script called `textmsg`."""

    text: str


@dataclass(frozen=True, slots=True)
class ScriptFailed:
    """A program did not compile, or a run-time error ended it.

    Attributes:
        line: in the text as sent, the `def` line being 1; columns count from 1, too.
        secondary: the program was a `sec`: only logged, the primary program goes on.
        log_text: as its log has it; "" if it is the same.
    """

    line: int
    column: int
    text: str
    secondary: bool = False
    log_text: str = ""


@dataclass(frozen=True, slots=True)
class ErrorReported:
    """The controller reports code C<code>A<argument>; `level` is a protocol.primary.messages.ReportLevel."""

    code: int
    argument: int
    level: ReportLevel
    text: str


@dataclass(frozen=True, slots=True)
class SafetyModeChanged:
    """The safety mode changed, for the safety-mode message of the primary port."""

    safety_mode: int


@dataclass(frozen=True, slots=True)
class RobotModeChanged:
    """The robot mode changed; for the log; the robot state shows it too."""

    robot_mode: int


@dataclass(frozen=True, slots=True)
class LogAdded:
    """A part of the box (`source`), such as the dashboard server, or a client added a line to the log."""

    source: str
    text: str


@dataclass(frozen=True, slots=True)
class PopupShown:
    """A script called `popup`. `request_id`: number of a blocking one, see `Pendant`; 0 otherwise."""

    title: str
    text: str
    warning: bool
    error: bool
    blocking: bool
    request_id: int = 0


@dataclass(frozen=True, slots=True)
class ValueRequested:
    """A script asks the operator for a value; `request_id` is that of `Pendant`."""

    request_id: int
    kind: RequestedType
    text: str


Event = (
    ProgramStarted
    | ProgramStopped
    | ProgramPaused
    | ProgramResumed
    | TextPrinted
    | ScriptFailed
    | ErrorReported
    | SafetyModeChanged
    | RobotModeChanged
    | LogAdded
    | PopupShown
    | ValueRequested
)


class EventQueue(list[Event]):
    """Events in their order; all parts append, the loop takes them once a cycle."""

    __slots__ = ()

    def take(self) -> list[Event]:
        """Return the events since the last call and remove them."""
        events = list(self)
        self.clear()
        return events


@dataclass(slots=True)
class ProgramRequests:
    """What scripts or clients ask for that waits for its place in the cycle.

    Attributes:
        pause: of the primary program, once the scripts of this cycle have run.
        power_off: at the same place.
        protective_stop: at the end of this cycle.
    """

    pause: bool = False
    power_off: bool = False
    protective_stop: bool = False
