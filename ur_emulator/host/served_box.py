"""One box in the loop: its machine, its pacer and its ports.

It decides when to tick and publishes. For its ports it is the whole box: they read its state, submit
commands, write into its log, and have work done in steps and in the worker process.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from heapq import heappop, heappush
from typing import Any, Protocol, TypeVar

from protocol.primary.messages import ReportLevel
from protocol.ur_types import SIMULATED_MASTERBOARD
from ur_emulator.budgets import BUDGETS, of_cycle
from ur_emulator.errors import ControlError, RefusedError
from ur_emulator.host.box_log import BoxLog
from ur_emulator.host.pacing import Pacer, RealtimePacer, reader_limit
from ur_emulator.host.runtime.barrier import Failed, describe_error, guarded
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.runtime.listener import Listener
from ur_emulator.host.runtime.worker import TaskQueue, Ticket
from ur_emulator.host.script_network.loop_network import LoopNetwork
from ur_emulator.host.steps import StepRunner, Steps, settle
from ur_emulator.machine.commands.power import PowerOff
from ur_emulator.machine.commands.programs import StartProgram, StopProgram
from ur_emulator.machine.commands.safety import PressEmergencyStop, UnlockProtectiveStop
from ur_emulator.machine.controller.command import Command, Done, Result
from ur_emulator.machine.controller.events import Event, LogAdded
from ur_emulator.machine.controller.io.network import Arrival
from ur_emulator.machine.controller.safety.modes import MOVING_MODES
from ur_emulator.machine.controller.snapshot import Snapshot
from ur_emulator.machine.machine import Answer, Input, Machine
from ur_emulator.machine.models.robot_generation import Software
from urscript import CompiledProgram
from urscript.run.waits import Outside

T = TypeVar("T")

# What was sent before one of these does not begin after it. The same goes for the word that unlocks a
# protective stop: in it programs are refused, and the arm must not move by one that was too long to compile.
_STOPS = (StopProgram, PowerOff, PressEmergencyStop)
# How far ahead somebody may ask for a time [s]: a typing error must not keep a processor busy.
LONGEST_WAIT = 3600.0


@dataclass(frozen=True, slots=True)
class BoxIdentity:
    """Names and numbers by which clients know the box.

    Attributes:
        model: as people write it, "UR5e".
        wire_model: as the dashboard server writes it: "UR5" for a UR5e.
        serial_number: digits; see protocol.serial_numbers.simulated_serial.
        masterboard: its version, by which clients know the box.
    """

    software: Software
    model: str
    wire_model: str
    serial_number: str
    masterboard: int = SIMULATED_MASTERBOARD


class Publisher(Protocol):
    """A part that publishes every cycle."""

    def publish(self, snapshot: Snapshot) -> None:
        """Send what is due for this cycle."""
        ...


class ServedBox:
    """Advances a machine in an event loop and publishes what it does.

    Attributes:
        machine: the box without its ports.
        controller: its parts; ports read them and never change them.
        network: carries out what scripts want of the outside; set before the box runs.
        keep: called with inputs and answer of each cycle, for a journal; None without one. A cycle that an
            error has ended has no answer.
        identity: names and numbers by which clients know the box.
        steps: advances what takes several cycles; the last of the publishers.
        log: programs, errors, modes, text messages, clients.
        listeners: those of the open ports, without that of the control API.
        backlog: the connections with bytes in their outbox; they enter and leave it themselves.
        watch: called with the time [s] after each cycle, to measure the memory of a process that only serves
            boxes; None in a process of the user.
        stops: how many commands so far stop the program and all that waits to be compiled.
    """

    def __init__(
        self, machine: Machine, identity: BoxIdentity, pacer: Pacer, tasks: TaskQueue, on_failure: Failed
    ) -> None:
        """Serve a machine.

        The loop of `tasks` expects bytes that a script waits for. `on_failure` gets the error that has ended
        a cycle; there will be no further one.
        """
        self.machine = machine
        self.controller = machine.controller
        self.identity = identity
        self.steps = StepRunner(partial(self.report, "an answer is lost"))
        self._tasks = tasks
        self.log = BoxLog(self.controller.generation)
        self.network: LoopNetwork | None = None
        self.keep: Callable[[Sequence[Input], Answer | None], None] | None = None
        self._pacer = pacer
        self._repeats = not isinstance(pacer, RealtimePacer)
        self._has_noted_input = False
        self._publishers: tuple[Publisher, ...] = ()
        self._listeners: tuple[Callable[[Event], None], ...] = ()
        # Commands for the next cycle, by the name under which a later one replaces them, or by an object.
        self._commands: dict[object, tuple[Command, Done]] = {}
        # Those that are no reason for a cycle, and, for a journal, what has arrived for scripts.
        self._quiet: list[tuple[Command, Done]] = []
        self._arrived: list[Arrival] = []
        self._is_urged = False
        # What is to act in a later cycle: its number, then the order in which they came.
        self._scheduled: list[tuple[int, int, Command, Done]] = []
        self._n_scheduled = 0
        self._awake_until = 0
        self.stops = 0
        # When the newest of the programs that were started was asked for, in monotonic time [s].
        self.newest = 0.0
        self.watch: Callable[[float], None] | None = None
        self.listeners: tuple[Listener, ...] = ()
        self.backlog: set[Connection] = set()
        self._on_failure = on_failure
        self._given_up: set[Connection] = set()
        self._failing: set[object] = set()
        self._last_frame = -math.inf
        # A cycle is computed and waits for its deadline.
        self._is_held = False

    def attach(
        self, publishers: Iterable[Publisher], listeners: Iterable[Callable[[Event], None]] = ()
    ) -> None:
        """Register publishers, called after every cycle in this order, and listeners of events.

        A listener gets each event before the cycle that it belongs to is published.
        """
        self._publishers, self._listeners = tuple(publishers), tuple(listeners)

    @property
    def snapshot(self) -> Snapshot:
        """State at the end of the last cycle."""
        return self.controller.snapshot

    @property
    def takes_commands(self) -> bool:
        """Whether the next cycle takes further commands; for clients that can wait."""
        return len(self._commands) < of_cycle(BUDGETS.commands, self.controller.generation.period_s)

    @property
    def remote_period(self) -> int:
        """Number of the present period of remote control, 0 in local control."""
        return self.controller.state.pendant.remote_period

    def submit(
        self, command: Command, done: Done | None = None, *, in_place_of: str = "", urgent: bool = True
    ) -> None:
        """Take a command for the next cycle; `done` is called then with the result or the error.

        A command that still waits under the same name `in_place_of` is dropped. In lockstep, time passes for
        an `urgent` one also while a script waits for the outside.
        """
        is_stopped = self.snapshot.safety_mode not in MOVING_MODES
        if isinstance(command, _STOPS) or (is_stopped and isinstance(command, UnlockProtectiveStop)):
            self.stops += 1
        name = in_place_of or object()
        self._commands.pop(name, None)
        self._commands[name] = command, done or self._report_error
        self._is_urged |= urgent

    def submit_quietly(self, command: Command) -> None:
        """Take a command for the next cycle, whenever that is: it is no reason for time to pass."""
        self._quiet.append((command, self._report_error))

    def arrive(self, arrival: Arrival) -> None:
        """Take what has arrived for a script; it is one of the inputs of the next cycle."""
        self.machine.take(arrival)
        if self.keep is not None:
            self._arrived.append(arrival)

    def schedule(self, tick: int, command: Command, done: Done) -> None:
        """Take a command for the cycle of that number; in lockstep it is no reason for time to pass.

        RefusedError if the cycle has passed, or too many commands wait.
        """
        now = self.snapshot
        if tick <= now.tick:
            raise RefusedError(f"the time has passed: the robot is at {now.timestamp:g} s")
        if len(self._scheduled) >= BUDGETS.scheduled_commands:
            raise RefusedError(
                f"{BUDGETS.scheduled_commands} operations wait for their time: no more are taken"
            )
        self._n_scheduled += 1
        heappush(self._scheduled, (tick, self._n_scheduled, command, done))

    def wake_until(self, tick: int) -> None:
        """Let time pass until that cycle, also in lockstep. RefusedError if it is too far ahead."""
        now, ahead = self.snapshot, self.controller.generation.seconds(tick)
        if ahead > now.timestamp + LONGEST_WAIT:
            raise RefusedError(
                f"{ahead:g} s is too far ahead: the robot is at {now.timestamp:g} s, "
                f"{LONGEST_WAIT:g} s more are possible"
            )
        self._awake_until = max(self._awake_until, tick)

    def announce(self, event: Event) -> None:
        """Publish an event at once, outside of a cycle."""
        self.log.note(event, self.snapshot.tick)
        for listener in self._listeners:
            guarded(partial(self._fail_to_publish, listener), listener, event)

    def note(self, text: str) -> None:
        """Write a line of the dashboard server into the log."""
        self.announce(LogAdded("Dashboard", text))

    def notice(self, text: str) -> None:
        """Write a line about a client into the log."""
        self.log.write(self.snapshot.tick, "Client", text)

    def note_input(self, client: Connection) -> None:
        """Say once that in lockstep an input, for which no program waits, comes at no fixed time."""
        is_running = self.controller.programs.is_running and not self.waits_outside
        if self._repeats and is_running and not self._has_noted_input:
            self._has_noted_input = True
            self.notice(
                f"{client.peer} writes inputs while a program runs: in lockstep each run has them at other "
                'times of the robot; a client that streams by the clock needs pace "realtime"'
            )

    def report(self, what: str, error: Exception) -> None:
        """Write into the log what an error of ours has ended."""
        text = f"{what}: {describe_error(error)}"
        self.log.write(self.snapshot.tick, "Controller", text, ReportLevel.FAULT)

    def _report_error(self, result: Result, error: Exception | None) -> None:
        """Report an error of ours in a command; a refusal is none."""
        if error is not None and not isinstance(error, RefusedError):
            self.report("a command is lost", error)

    # --- steps

    def start_alone(self, steps: Steps[None]) -> None:
        """Begin with steps whose result is not used; a refusal stands in the log already."""

        def finished(_: None, error: Exception | None) -> None:
            if error is not None and not isinstance(error, ControlError):
                self.report("a request is not done", error)

        self.steps.start(steps, finished)

    def apply(self, command: Command) -> Steps[Any]:
        """Ask for something, and end after the cycle in which it was applied, with its result.

        RefusedError if it was refused.
        """
        outcome: Future[Any] = Future()
        self.submit(command, settle(outcome))
        while not outcome.done():
            yield
        return outcome.result()

    def start_command(self, program: CompiledProgram, asked: float, **options: bool) -> StartProgram:
        """Return the command that starts a program; `asked`: when somebody wanted it, in monotonic time [s].

        RefusedError if a program has begun that was asked for later.
        """
        if asked < self.newest:
            raise RefusedError(f"program {program.name} does not begin: a newer one was compiled before it")
        self.newest = asked
        return StartProgram(program, **options)

    def in_worker(self, function: Callable[..., T], *arguments: Any) -> Steps[T]:
        """Do what takes longer than a cycle in the worker process; return its result."""
        outcome: Future[T] = Future()

        def done(result: Any, error: Exception | None) -> None:
            settle(outcome)(result, error)
            self.steps.advance()

        failed = partial(self.report, "an answer is lost")
        task = self._tasks.submit(done, failed, Ticket(done), function, *arguments)
        try:
            while not outcome.done():
                yield
            return outcome.result()
        finally:
            self._tasks.drop(task)
            # An error holds this frame by its traceback, and the frame must not hold the error: with the
            # arguments both would wait for the collector, which looks rarely.
            outcome, arguments = Future(), ()

    # --- what the pacer asks

    @property
    def is_active(self) -> bool:
        """True while there is a reason for time to pass."""
        return bool(self._commands) or self._is_awake or self.controller.is_active

    @property
    def _is_awake(self) -> bool:
        """True while somebody waits for a later cycle."""
        return self.snapshot.tick < self._awake_until

    @property
    def waits_outside(self) -> bool:
        """True while a script waits for the outside and no urgent command wants a cycle.

        Who waits for a time does not wait for the operator.
        """
        waits = self.controller.waits_outside
        return bool(waits and not self._is_urged and not (waits is Outside.OPERATOR and self._is_awake))

    @property
    def readers_full(self) -> bool:
        """True while a client has frames waiting that it has not read, unless it was given up.

        There is no waiting for clients while the arm only settles: a client that waits for rest would take
        the frames that are repeated meanwhile for the last ones. They are few and find room in the outbox.
        """
        if not self.backlog:
            self._given_up.clear()
            return False
        self._given_up &= self.backlog
        wants_cycles = bool(self._commands) or self._is_awake or self.controller.is_busy
        return len(self._given_up) < len(self.backlog) and wants_cycles

    def give_up_readers(self, waited: float) -> None:
        """Wait no longer for clients that have been behind for too long [s], until they have caught up."""
        for client in self.backlog - self._given_up:
            if waited >= reader_limit(client.has_read):
                self.notice(f"{client.peer} does not read: it is not waited for any more and loses frames")
                self._given_up.add(client)

    def fell_behind(self, n_cycles: int) -> None:
        """Write into the log that the box does not keep up with real time."""
        self.log.write(
            self.snapshot.tick,
            "Controller",
            f"{n_cycles} cycles behind real time: the machine is too slow or was held up",
            ReportLevel.WARNING,
        )

    # --- the loop

    def advance(self, now: float) -> float:
        """Tick if it is time to, or repeat the last frame if time stands still; return the next deadline."""
        if self._is_held:
            if now < self._pacer.publish_at:
                return self._pacer.publish_at
            self._is_held = False
            self._publish(self.snapshot, now)
        elif self._pacer.may_tick(now, self):
            self._submit_due()
            answer = self._tick()
            snapshot = answer.snapshot
            if self.watch is not None:
                self.watch(now)
            # Events first, also before a cycle that is held: an error must have arrived before any state or
            # answer that shows its effect.
            for event in answer.events:
                self.announce(event)
            if now < self._pacer.publish_at:
                self._is_held = True
                return self._pacer.publish_at
            self._publish(snapshot, now)
            if self._repeats and self.is_active:
                if not self.waits_outside:
                    return now  # the next cycle may follow at once, after the sockets have had their turn
                if self._tasks.loop.expect_soon():
                    self.machine.use_idle_time()
            return self._pacer.next_call(now)
        # While time stands still, every port repeats itself at its own rate, in real seconds: clients take
        # silence for a dead robot.
        if self._repeats and now - self._last_frame >= self.controller.period_s:
            self._publish(self.snapshot, now)
        return self._pacer.next_call(now)

    def _tick(self) -> Answer:
        commands = [*self._quiet, *self._commands.values()] if self._quiet or self._commands else []
        inputs: list[Input] = [command for command, _ in commands]
        if commands:
            self._quiet, self._commands, self._is_urged = [], {}, False
        answer = None
        try:
            answer = self.machine.tick(inputs)
        finally:
            if self.keep is not None:
                self.keep((*self._arrived, *inputs), answer)
                self._arrived = []
        for (_, done), (result, error) in zip(commands, answer.outcomes, strict=True):
            done(result, error)
        if self.network is not None and (answer.requests or self.network.holds_back):
            self.network.carry_out(answer.requests)
        return answer

    def _submit_due(self) -> None:
        """Add the commands that are scheduled for the cycle that begins."""
        tick = self.snapshot.tick + 1
        while self._scheduled and self._scheduled[0][0] <= tick:
            _, _, command, done = heappop(self._scheduled)
            self.submit(command, done)

    def failed(self, error: Exception) -> None:
        """End this box after an error in a cycle; the loop may have others."""
        self._on_failure(error)

    def _publish(self, snapshot: Snapshot, now: float) -> None:
        self._last_frame = now
        for publisher in self._publishers:
            try:
                publisher.publish(snapshot)
            except Exception as error:
                self._fail_to_publish(publisher, error)

    def _fail_to_publish(self, part: object, error: Exception) -> None:
        """Do without what a port could not publish; reported once, for it may be so in every cycle."""
        if part not in self._failing:
            self._failing.add(part)
            self.report("a port cannot publish", error)
