"""Operations that take no cycle or several, done in steps (see `host.steps`).

They read the box, wait for it, do something at a time, run a program. The command line loads this module for
their parameters: nothing heavy at its top.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any, ClassVar

from protocol.primary.messages import ReportLevel, RequestedType
from protocol.ur_types import ProgramState, RobotMode, SafetyMode
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ArgumentError, RefusedError, WaitTimeoutError
from ur_emulator.host.box_log import LogEntry
from ur_emulator.host.control_api.box_state import BoxState, is_steady, take_state
from ur_emulator.machine.commands.operation import CommandOperation, Kind, Operation, R_co, parameter
from ur_emulator.machine.controller.events import LogAdded, ScriptFailed

if TYPE_CHECKING:
    from ur_emulator.host.player.player import ProgramPlayer
    from ur_emulator.host.served_box import ServedBox
    from ur_emulator.host.steps import Steps
    from ur_emulator.machine.controller.command import Result
    from ur_emulator.machine.controller.controller import Controller


@dataclass(slots=True)
class Context:
    """What steps need: `identity` gives the result of that operation, `make` makes an operation."""

    box: ServedBox
    player: ProgramPlayer
    identity: Callable[[], dict[str, Any]]
    make: Callable[[str, Mapping[str, Any]], Operation[Any]]


class StepOperation(Operation[R_co]):
    """An operation that takes no cycle, or is done in steps."""

    @abstractmethod
    def steps(self, context: Context) -> Any:
        """Do it; return its result, or steps that end in it: a dataclass, or what fits into JSON.

        ControlError: it cannot be done, or not now.
        """


class ReadState(StepOperation[BoxState]):
    """What the box is doing at the end of its last cycle."""

    result: ClassVar[str] = (
        "modes, joints, tool, force, inputs and outputs, program, popups and questions, time"
    )
    only_reads: ClassVar[bool] = True

    def steps(self, context: Context) -> BoxState:
        """Take the state."""
        return take_state(context.box)


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

    def steps(self, context: Context) -> dict[str, Any]:
        """Pick the entries."""
        log, least = context.box.log, ReportLevel[self.level]
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

    def steps(self, context: Context) -> dict[str, Any]:
        """Ask the box."""
        return context.identity()


class AddToLog(StepOperation[int]):
    """Write a line into the log."""

    text: str = parameter("the line")
    is_logged: ClassVar[bool] = False

    def steps(self, context: Context) -> dict[str, int]:
        """Write it; that needs no cycle."""
        context.box.announce(LogAdded("Control", self.text))
        return {"tick": context.box.snapshot.tick}


def _shows(controller: Controller, *, popup: bool) -> bool:
    """Return whether the pendant shows a popup, or a question."""
    pendant = controller.state.pendant
    asked = any((request.kind is RequestedType.NONE) is popup for request in pendant.requests)
    return asked or (popup and bool(pendant.shown))


# Parameters of `wait_until`, each with the present value in the box.
CONDITIONS: dict[str, Callable[[Controller], object]] = {
    "robot_mode": lambda controller: RobotMode(controller.snapshot.robot_mode).name,
    "safety_mode": lambda controller: SafetyMode(controller.snapshot.safety_mode).name,
    "program_state": lambda controller: ProgramState(controller.snapshot.runtime_state).name,
    "steady": is_steady,
    "popup": partial(_shows, popup=True),
    "question": partial(_shows, popup=False),
}


class WaitUntil(StepOperation[BoxState]):
    """Wait until all conditions hold at the end of a cycle, and return the state then.

    In lockstep time stands still while nothing goes on: what would only come with time does not come. With
    `time`, it passes until then.
    The program state is still STOPPED right after a port was sent a program.

    Raises:
        WaitTimeoutError: they did not all hold in time.
        RefusedError: `time` is more than an hour ahead.
    """

    time: float | None = parameter("the time of the robot, as in `state`, is reached", "s", 0.0, default=None)
    robot_mode: str | None = parameter(
        "the robot mode is this", choices=tuple(RobotMode.__members__), default=None
    )
    safety_mode: str | None = parameter(
        "the safety mode is this", choices=tuple(SafetyMode.__members__), default=None
    )
    program_state: str | None = parameter(
        "the program state is this", choices=tuple(ProgramState.__members__), default=None
    )
    steady: bool | None = parameter("the arm stands still, or not", default=None)
    popup: bool | None = parameter("a popup is shown, or none", default=None)
    question: bool | None = parameter("a program waits for an answer, or none does", default=None)
    log: str | None = parameter("an entry of the log contains this", default=None)
    after: int = parameter("entries of the log that do not count", low=0, default=0)
    timeout: float = parameter("give up after so long in real time", "s", 0.0, 3600.0, default=10.0)
    result: ClassVar[str] = "the state, as `state` gives it"
    is_logged: ClassVar[bool] = False

    def steps(self, context: Context) -> Steps[Any]:
        """Look after every cycle."""
        wanted = {name: value for name in CONDITIONS if (value := getattr(self, name)) is not None}
        if not wanted and self.log is None and self.time is None:
            raise ArgumentError("wait_until needs a condition, such as program_state STOPPED or steady true")
        log, controller = context.box.log, context.box.controller
        end = monotonic() + self.timeout
        after, seen = self.after, self.log is None
        begin = 0 if self.time is None else controller.generation.tick_at(self.time)
        context.box.wake_until(begin)
        while True:
            if not seen:
                seen = any(str(self.log) in entry.text for entry in log.since(after))
                after = max(after, log.count)
            present = {name: CONDITIONS[name](controller) for name in wanted}
            missing = [
                f"{name} is {now}, not {wanted[name]}" for name, now in present.items() if now != wanted[name]
            ]
            if not seen:
                missing.append(f"no log entry with {self.log!r}")
            if controller.snapshot.tick < begin:
                missing.append(f"time is {controller.snapshot.timestamp:g} s, not {self.time:g} s")
            if not missing:
                return take_state(context.box)
            if monotonic() >= end:
                raise WaitTimeoutError(f"waited {self.timeout:g} s in vain: {', '.join(missing)}")
            yield


class At(StepOperation[int]):
    """Do an operation at an exact time of the robot: in the first cycle that ends then, or later.

    It returns at once, and the log says later what has become of the operation. In lockstep it is no reason
    for time to pass: several can be asked for, then a program or `wait_until` with `time` lets it pass.

    Raises:
        ArgumentError: there is no such operation, or it does not take these arguments.
        RefusedError: the time has passed, or too many operations wait.
    """

    time: float = parameter("time of the robot, as in `state`", "s", 0.0)
    operation: str = parameter("name of an operation that acts within one cycle, such as push")
    arguments: Mapping[str, Any] | None = parameter("its parameters by name", default=None)
    result: ClassVar[str] = "`tick`: the cycle in which it will be applied"

    def steps(self, context: Context) -> dict[str, int]:
        """Hand it to the box for its cycle."""
        box, name = context.box, self.operation
        operation = context.make(name, dict(self.arguments or {}))
        if not isinstance(operation, CommandOperation):
            raise ArgumentError(f"{name} cannot be done at a time: it does not act within one cycle")

        def done(result: Result, error: Exception | None) -> None:
            end = "done" if error is None else f"refused: {error}"
            box.announce(LogAdded("Control", f"{name} at {self.time:g} s: {end}"))

        tick = box.controller.generation.tick_at(self.time)
        box.schedule(tick, operation, done)
        return {"tick": tick}


def read_script(path: Path) -> str:
    """Return the text of a program file of this machine; ArgumentError if it is UTF-16."""
    from urscript.source import as_utf8, program_text

    try:
        return as_utf8(program_text(path.read_bytes(), str(path)))
    except ValueError as error:
        raise ArgumentError(str(error)) from None


class RunProgram(StepOperation[int]):
    """Run a program in place of the one that runs.

    In Python the script may also be the path of a file of this machine.

    Raises:
        ArgumentError: the program does not compile.
        RefusedError: the box does not run programs now, cannot use the file, or has begun a newer program;
            with `wait`: the program ended with an error.
    """

    script: str | Path | None = parameter(
        "text of a program, as sent to port 30002", kind=Kind.SCRIPT, default=None
    )
    file: str | None = parameter("or a file in the folder of programs, as for `load`", default=None)
    wait: bool = parameter("return when the program has ended, with its error if it has one", default=False)
    result: ClassVar[str] = "`program`: its name, and `tick`: the cycle in which it began"

    def __post_init__(self) -> None:
        if isinstance(self.script, Path):  # read here: the box must not wait for a disk
            object.__setattr__(self, "script", read_script(self.script))
        super().__post_init__()

    def steps(self, context: Context) -> Steps[Any]:
        """Compile and start a text, or play a file as the dashboard does; what runs is stopped before."""
        box, player, asked = context.box, context.player, monotonic()
        programs = box.controller.programs
        if (self.script is None) == (self.file is None):
            raise ArgumentError("run_program needs either script, the text, or file, a name")
        if self.file is not None:
            yield from player.load(self.file, stops=True)
            yield from player.play("127.0.0.1")
            assert programs.latest is not None
            program = programs.latest.program
        else:
            from ur_emulator.program_files.compiling import compile_text

            catalogue = box.identity.software.catalogue
            outcome = yield from box.in_worker(compile_text, str(self.script), catalogue)
            if isinstance(outcome, ScriptFailed):
                raise ArgumentError(f"the program does not compile: {outcome.log_text or outcome.text}")
            program = outcome
            yield from box.apply(box.start_command(program, asked))
        name, tick, run = program.name, box.snapshot.tick, programs.latest
        if self.wait and run is not None and run.program is program:  # a `sec` has ended already
            while programs.latest is run and box.snapshot.runtime_state != ProgramState.STOPPED:
                yield
            if run.error is not None:
                raise RefusedError(f"program {name} ended with an error: {run.error}")
        return {"program": name, "tick": tick}
