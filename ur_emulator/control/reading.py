"""Operations that ask the box what is going on, and the one that writes into its log."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from protocol.primary.messages import ReportLevel
from ur_emulator.box_log import LogEntry
from ur_emulator.budgets import BUDGETS
from ur_emulator.commands.operation import parameter
from ur_emulator.control.box_state import BoxState, take_state
from ur_emulator.control.step_operation import Context, StepOperation
from ur_emulator.controller.events import LogAdded

if TYPE_CHECKING:
    from ur_emulator.servers.steps import Steps


class ReadState(StepOperation[BoxState]):
    """What the box is doing at the end of its last cycle."""

    result: ClassVar[str] = (
        "modes, joints, tool, force, inputs and outputs, program, popups and questions, time"
    )
    only_reads: ClassVar[bool] = True

    def steps(self, context: Context) -> Steps[Any]:
        """Take the state."""
        yield from ()
        return take_state(context.access.controller)


class ReadLog(StepOperation[tuple[LogEntry, ...]]):
    """What PolyScope's log tab would show."""

    after: int = parameter("leave out so many entries: the `next` of the call before", low=0, default=0)
    level: str = parameter(
        "leave out what weighs less", choices=tuple(ReportLevel.__members__), default="DEBUG"
    )
    result: ClassVar[str] = (
        f"`entries`, the oldest first, at most {BUDGETS.log_entries} of them, and `next`, to be given as "
        "`after` in the next call"
    )
    only_reads: ClassVar[bool] = True

    def steps(self, context: Context) -> Steps[Any]:
        """Pick the entries."""
        yield from ()
        log, least = context.access.log, ReportLevel[self.level]
        new = log.since(self.after)
        entries, seen = list[LogEntry](), log.count - len(new)
        for entry in new:
            if len(entries) == BUDGETS.log_entries:
                break
            seen += 1
            if entry.level >= least:
                entries.append(entry)
        return {"entries": entries, "next": max(self.after, seen)}


class ReadIdentity(StepOperation[dict[str, Any]]):
    """What the box is."""

    result: ClassVar[str] = "software, robot model, serial number, pace, seed, fidelity, address and ports"
    only_reads: ClassVar[bool] = True

    def steps(self, context: Context) -> Steps[Any]:
        """Ask the box."""
        yield from ()
        return context.identity()


class AddToLog(StepOperation[int]):
    """Write a line into the log."""

    text: str = parameter("the line")
    is_logged: ClassVar[bool] = False

    def steps(self, context: Context) -> Steps[Any]:
        """Write it; that needs no cycle."""
        yield from ()
        context.access.announce(LogAdded("Control", self.text))
        return {"tick": context.access.snapshot.tick}
