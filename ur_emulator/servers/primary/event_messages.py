"""Controller events as robot messages of the primary port."""

from __future__ import annotations

from protocol.primary.framing import NO_TIME
from protocol.primary.messages import (
    LONGEST_TITLE,
    ErrorCodeMessage,
    KeyMessage,
    MessageSource,
    PopupMessage,
    RequestValueMessage,
    RobotMessage,
    RuntimeExceptionMessage,
    SafetyModeMessage,
    TextMessage,
)
from ur_emulator.controller import events

# Titles of the key messages about a program's life. Sources: captures quoted by the public client library;
# PAUSED from Hirebotics/urscript-tools. None is known for a program that goes on after a pause.
STARTED_TITLE = "PROGRAM_XXX_STARTED"
PAUSED_TITLE = "PROGRAM_XXX_PAUSED"
STOPPED_TITLE = "PROGRAM_XXX_STOPPED"
SECONDARY_EXCEPTION_TITLE = "SECONDARY_PROGRAM_EXCEPTION_XXX"


def message_for(event: events.Event, timestamp: int) -> RobotMessage | None:
    """Return the message for an event; None for events that stand only in the log.

    Args:
        event: what happened.
        timestamp: microseconds since controller start.
    """
    match event:
        case events.ProgramStarted(name):
            return KeyMessage(timestamp=timestamp, title=STARTED_TITLE, text=name)
        case events.ProgramStopped(name):
            return KeyMessage(timestamp=timestamp, title=STOPPED_TITLE, text=name)
        case events.ProgramPaused(name):
            return KeyMessage(timestamp=timestamp, title=PAUSED_TITLE, text=name)
        case events.ProgramResumed() | events.RobotModeChanged() | events.LogAdded():
            return None  # no client knows a message for the first; the states show the second
        case events.TextPrinted(text):
            return TextMessage(timestamp=timestamp, text=text)
        case events.ScriptFailed(line, column, text, secondary):
            if secondary:
                return KeyMessage(timestamp=timestamp, title=SECONDARY_EXCEPTION_TITLE, text=text)
            # A capture shows "no time" on these.
            return RuntimeExceptionMessage(timestamp=NO_TIME, line=line, column=column, text=text)
        case events.ErrorReported(code, argument, level, text):
            return ErrorCodeMessage(
                timestamp=timestamp,
                source=MessageSource.CONTROLLER,
                code=code,
                argument=argument,
                report_level=level,
                text=text,
            )
        case events.SafetyModeChanged(safety_mode):
            return SafetyModeMessage(
                timestamp=timestamp, source=MessageSource.CONTROLLER, safety_mode=safety_mode
            )
        case events.ValueRequested(request_id, kind, text):
            return RequestValueMessage(
                timestamp=timestamp, request_id=request_id, requested_type=kind, text=text
            )
        case events.PopupShown(title, text, warning, error, blocking, request_id):
            return PopupMessage(
                timestamp=timestamp,
                request_id=request_id,
                is_warning=warning,
                is_error=error,
                is_blocking=blocking,
                title=title[:LONGEST_TITLE],
                text=text,
            )
