"""Scripts and words on ports 30001 to 30003: split, compiled in the worker process, handed over as commands.

Words act at once: they never wait for a program. What waits when a client stops the program or switches the
power off is stopped with it, whoever has sent it: on a real controller it would run already. Programs begin
in the order of arrival, but who sends many at once lets others go first, and no client waits for a program
that takes long to compile: it does not begin any more when a newer one of anybody has begun meanwhile.
A program is compiled also when its sender has closed the connection meanwhile, as many do.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field, replace
from functools import partial

from protocol.primary.messages import ReportLevel
from protocol.script_channel import ControlLine, Overflow, ProgramText, ScriptChannel
from ur_emulator.budgets import BUDGETS, KIB, of_cycle
from ur_emulator.errors import ArgumentError, RefusedError
from ur_emulator.host.runtime.barrier import describe_error
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.runtime.worker import Task, TaskQueue, Ticket
from ur_emulator.host.served_box import ServedBox
from ur_emulator.machine.commands import power, programs, safety
from ur_emulator.machine.controller.command import Command
from ur_emulator.machine.controller.events import ErrorReported, ScriptFailed
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.program_files.compiling import CompileResult, compile_text

# All words but `SPEED_WORD`; those that change nothing here map to None.
# Source: what PolyScope and public clients send on the script ports (protocol.script_channel).
WORDS: dict[str, Command | None] = {
    "power on": power.PowerOn(),
    "power off": power.PowerOff(),
    "set robotmode run": power.ReleaseBrakes(),
    "set robotmode freedrive": power.StartFreedrive(),
    "set unlock protective stop": safety.UnlockProtectiveStop(),
    "stop program": programs.StopProgram(),
    "pause program": programs.PauseProgram(),
    "resume program": programs.ResumeProgram(),
    "set real": None,
    "set sim": None,
    "confirm user safety parameters": safety.ConfirmSafety(),
}
SPEED_WORD = "set speed"

# A program costs so much beside its text [bytes].
_PROGRAM_COST = 2 * KIB


# No `repr`: a sender and its programs refer to each other.
@dataclass(eq=False, repr=False, slots=True)
class Sender:
    """A client that sends scripts.

    Attributes:
        remote_period: number of the period of remote control in which it has connected, see `Pendant`.
        channel: what it has sent of a program that is not complete.
        programs: those that have not begun, in order; only the first may be compiled.
        n_sent: how many programs it has sent since none of its waited.
        held: script of it that the box keeps, as `BUDGETS` counts it [bytes].
        is_open: its connection is open.
        is_told: it was informed that it sends too much.
    """

    remote_period: int = 1
    channel: ScriptChannel = field(default_factory=ScriptChannel)
    programs: deque[Program] = field(default_factory=deque)
    n_sent: int = 0
    held: int = 0
    is_open: bool = True
    is_told: bool = False


@dataclass(eq=False, repr=False, slots=True)
class Program:
    """A program that waits; its ticket decides when it is compiled. A secondary one cannot be stopped.

    Attributes:
        stops: how often the program had been stopped when it arrived.
        task: compiles it, or has done so; None before.
    """

    sender: Sender
    text: str
    ticket: Ticket
    stops: int
    is_secondary: bool
    task: Task | None = None

    @property
    def cost(self) -> int:
        """What it is counted with [bytes]."""
        return _PROGRAM_COST + len(self.text)


# Error code for script text in local control. Source: the maker's client library; the text: a user's log.
READ_ONLY = 210
# So much of a client's script is taken whatever others send [bytes].
_ALWAYS_TAKEN = 64 * KIB
# A program comes a turn later for so many that its sender has sent at once before it, and for so much text of
# its own [bytes]: a short one goes before a long one that waits.
_PROGRAMS_A_TURN = 16
_BYTES_A_TURN = 8 * KIB


class ProgramIntake:
    """Turns script text into commands for one box."""

    def __init__(self, tasks: TaskQueue, box: ServedBox) -> None:
        self._tasks = tasks
        self._box = box
        # Those with programs that have not begun.
        self._senders: dict[Sender, None] = {}
        # Those that are compiled, in the order in which they begin.
        self._ready: dict[Program, CompileResult] = {}
        self._held = 0
        # When the program was paused last, 0 if it goes on.
        self._paused = 0.0
        self._stops = 0
        self._n_programs = self._n_warnings = 0

    # --- clients

    def new_sender(self) -> Sender:
        """Return a client that has just connected."""
        return Sender(self._box.remote_period)

    def received(self, sender: Sender, data: bytes) -> None:
        """Take script text of a client; in local control it has no effect, until the client connects anew."""
        if not sender.remote_period or sender.remote_period != self._box.remote_period:
            self._warn("Socket is read-only when the robot is in local control", READ_ONLY)
            return
        before = sender.channel.pending
        items = sender.channel.feed(data)
        self._hold(sender, sender.channel.pending - before)
        for item in items:
            match item:
                case ProgramText():
                    self._take_program(sender, item)
                case ControlLine():
                    self._take_word(item)
                case Overflow(what, limit):
                    self._warn(f"a script {what} of more than {limit} bytes was dropped")
        if self._holds_too_much(sender):
            self._hold(sender, -sender.channel.pending)
            sender.channel.drop()
            self._tell(sender)
        self._begin(sender)

    def closed(self, sender: Sender) -> None:
        """Keep some programs of a client that has gone, and drop what is not complete."""
        self._hold(sender, -sender.channel.pending)
        sender.is_open = False
        self._drop_gone()

    def publish(self, snapshot: Snapshot) -> None:
        """Go on after a cycle."""
        self._n_programs = self._n_warnings = 0
        if self._stops != self._box.stops:
            self._stops = self._box.stops
            self._drop_stopped()
        if self._ready or self._senders:
            self._hand_over()

    def close(self) -> None:
        """Forget what waits and what is being compiled."""
        for program in [program for sender in self._senders for program in sender.programs]:
            self._drop(program)

    # --- what it sends

    def _take_program(self, sender: Sender, item: ProgramText) -> None:
        sender.n_sent += 1
        turn = sender.n_sent // _PROGRAMS_A_TURN + len(item.text) // _BYTES_A_TURN
        ticket = Ticket(sender, turn)
        program = Program(sender, item.text, ticket, self._box.stops, item.kind == "sec")
        self._hold(sender, program.cost)
        if self._holds_too_much(sender):
            self._hold(sender, -program.cost)
            self._tell(sender)
        else:
            sender.programs.append(program)
            self._senders[sender] = None

    def _take_word(self, item: ControlLine) -> None:
        try:
            is_speed = item.word == SPEED_WORD
            command = programs.SetSpeedSlider(float(item.argument)) if is_speed else WORDS[item.word]
        except (ValueError, ArgumentError):
            self._warn(f"'{item.text}' was ignored: the speed slider takes 0 to 1")
            return
        if command is not None:
            self._box.submit(command, in_place_of=item.word)
        if isinstance(command, programs.PauseProgram):
            self._paused = time.monotonic()
        elif isinstance(command, programs.ResumeProgram):
            self._paused = 0.0

    def _holds_too_much(self, sender: Sender) -> bool:
        is_crowded = self._held > BUDGETS.script_bytes and sender.held > _ALWAYS_TAKEN
        return is_crowded or sender.held > BUDGETS.script_bytes_client

    def _hold(self, sender: Sender, n_bytes: int) -> None:
        self._held += n_bytes
        sender.held += n_bytes
        if not sender.held:
            sender.n_sent, sender.is_told = 0, False

    def _tell(self, sender: Sender) -> None:
        if not sender.is_told:
            sender.is_told = True
            self._warn("programs come faster than they compile, some were dropped")

    def _warn(self, text: str, code: int = 0) -> None:
        self._n_warnings += 1
        if self._n_warnings <= BUDGETS.script_warnings_per_cycle:
            self._box.announce(ErrorReported(code, 0, ReportLevel.WARNING, text))

    # --- programs

    @property
    def _programs_per_cycle(self) -> int:
        return of_cycle(BUDGETS.programs_per_cycle, self._box.controller.period_s)

    def _begin(self, sender: Sender) -> None:
        """Have the next program of a client compiled, unless there are enough for this cycle."""
        if _is_idle(sender) and len(self._ready) < self._programs_per_cycle:
            program = sender.programs[0]
            program.task = self._tasks.submit(
                partial(self._compiled, program),
                partial(self._failed, program),
                program.ticket if sender.is_open else replace(program.ticket, sender=self),
                compile_text,
                program.text,
                self._box.identity.software.catalogue,
                "<program>",
                program.is_secondary,
            )

    def _compiled(self, program: Program, outcome: CompileResult, error: Exception | None) -> None:
        if error is not None:
            outcome = ScriptFailed(1, 1, f"the program cannot be compiled: {error}")
        self._ready[program] = outcome
        self._hand_over()

    def _failed(self, program: Program, error: Exception) -> None:
        self._drop(program)
        self._warn(f"a program is lost: {describe_error(error)}")

    def _hand_over(self) -> None:
        """Hand over what is compiled, as much as a cycle takes, and go on with compiling."""
        while self._ready and self._n_programs < self._programs_per_cycle:
            self._n_programs += 1
            program = next(iter(self._ready))
            self._start(program, self._ready.pop(program))
            self._drop(program)
        idle = filter(_is_idle, self._senders)
        for sender in sorted(idle, key=lambda sender: sender.programs[0].ticket.arrived):
            self._begin(sender)

    def _start(self, program: Program, outcome: CompileResult) -> None:
        arrived = program.ticket.arrived
        if isinstance(outcome, ScriptFailed):
            self._box.announce(outcome)
        elif program.is_secondary:
            self._box.submit(programs.StartProgram(outcome))
        elif program.stops != self._box.stops:
            self._warn(f"program {outcome.name} was stopped before it began")
        else:
            try:
                self._box.submit(self._box.start_command(outcome, arrived, pauses=arrived < self._paused))
            except RefusedError as error:
                self._warn(str(error))

    def _drop_gone(self) -> None:
        """Drop programs of clients that have gone until the rest keeps its budget, the longest one aside.

        The client with most waiting programs loses its newest first; no client loses a program to others.
        """
        gone = [other for other in self._senders if not other.is_open]
        waiting = [program for other in gone for program in other.programs]
        if not waiting:
            return
        longest = max(waiting, key=lambda program: (program.cost, -program.ticket.arrived))
        while sum(other.held for other in gone) - longest.cost > BUDGETS.script_bytes_gone:
            greediest = max(gone, key=lambda other: other.held - (other is longest.sender) * longest.cost)
            self._tell(greediest)
            self._drop(next(program for program in reversed(greediest.programs) if program is not longest))

    def _drop_stopped(self) -> None:
        """Drop the programs that arrived before the last stop."""
        stopped = [
            program
            for sender in self._senders
            for program in sender.programs
            if program.stops != self._stops and not program.is_secondary
        ]
        for program in stopped:
            self._drop(program)
        if stopped:
            self._warn(f"programs that were stopped before they began: {len(stopped)}")

    def _drop(self, program: Program) -> None:
        """Let go of a program that was handed over, or that is no longer wanted."""
        sender = program.sender
        sender.programs.remove(program)
        if program.task is not None:
            self._tasks.drop(program.task)
            program.task = None  # it holds the program: nothing is left to the garbage collector
        self._ready.pop(program, None)
        self._hold(sender, -program.cost)
        if not sender.programs:
            self._senders.pop(sender, None)


def _is_idle(sender: Sender) -> bool:
    """Whether a client has a program that waits, and none that is compiled."""
    return bool(sender.programs) and sender.programs[0].task is None


class ScriptPort:
    """Sends packages to all clients, takes script text of each."""

    def __init__(self, intake: ProgramIntake | None) -> None:
        """Prepare; `intake` takes script text, None makes the port read-only."""
        self._intake = intake
        self._clients: dict[Connection, Sender] = {}

    def opened(self, connection: Connection) -> None:
        """The client gets the next package."""
        self._clients[connection] = Sender() if self._intake is None else self._intake.new_sender()

    def received(self, connection: Connection, data: bytes) -> None:
        """Take script text."""
        if self._intake is not None:
            self._intake.received(self._clients[connection], data)

    def closed(self, connection: Connection) -> None:
        """Forget the client; a program it sent goes on."""
        sender = self._clients.pop(connection, None)
        if self._intake is not None and sender is not None:
            self._intake.closed(sender)

    def _send(self, *packages: bytes) -> None:
        for connection in tuple(self._clients):
            for package in packages:
                connection.send(package)
