"""What the ports may do with a box: read its state, submit commands, write into the log, work in steps."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any, TypeVar

from protocol.ur_types import SIMULATED_MASTERBOARD
from ur_emulator.box_log import BoxLog
from ur_emulator.commands.programs import StartProgram
from ur_emulator.controller.command import Command, Done
from ur_emulator.controller.controller import Controller
from ur_emulator.controller.events import Event, LogAdded
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.errors import ControlError, RefusedError
from ur_emulator.models.robot_generation import Software
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.realtime.served_box import ServedBox
from ur_emulator.realtime.tasks import Place
from ur_emulator.scripting.network import Network
from ur_emulator.servers.steps import StepRunner, Steps, settle
from urscript import CompiledProgram

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class BoxIdentity:
    """Names and numbers by which clients know the box.

    Attributes:
        software: four numbers and a date.
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


class BoxAccess:
    """A box as its servers use it.

    Attributes:
        identity: names and numbers of the box.
        network: opens sockets that the box dials out with.
        steps: advances what takes several cycles.
    """

    def __init__(self, identity: BoxIdentity, box: ServedBox, loop: EventLoop, network: Network) -> None:
        self.identity = identity
        self.network = network
        self.steps = StepRunner(self._failed)
        self._box = box
        self._loop = loop

    @property
    def controller(self) -> Controller:
        """Asked for its state, never changed directly."""
        return self._box.controller

    @property
    def snapshot(self) -> Snapshot:
        """State at the end of the last cycle."""
        return self._box.controller.snapshot

    @property
    def log(self) -> BoxLog:
        """What the box has done."""
        return self._box.log

    @property
    def takes_commands(self) -> bool:
        """False when so many wait for the next cycle that a client shall wait for the one after it."""
        return self._box.takes_commands

    def submit(self, command: Command) -> None:
        """Ask for something in the next cycle."""
        self._box.submit(command)

    def schedule(self, tick: int, command: Command, done: Done) -> None:
        """Ask for something in the cycle of that number.

        Raises:
            RefusedError: the cycle has passed, or too many commands wait.
        """
        self._box.schedule(tick, command, done)

    def wake_until(self, tick: int) -> None:
        """Let time pass until the cycle of that number, also in lockstep with nothing to do.

        Raises:
            RefusedError: it is too far ahead.
        """
        self._box.wake_until(tick)

    def announce(self, event: Event) -> None:
        """Publish an event that needs no cycle."""
        self._box.announce(event)

    def note(self, text: str) -> None:
        """Write a line of the dashboard server into the log."""
        self.announce(LogAdded("Dashboard", text))

    # --- steps

    def start_alone(self, steps: Steps[None]) -> None:
        """Begin with steps whose result is not used; a refusal stands in the log already."""

        def finished(_: None, error: Exception | None) -> None:
            if error is not None and not isinstance(error, ControlError):
                self._box.report("a request is not done", error)

        self.steps.start(steps, finished)

    def apply(self, command: Command) -> Steps[Any]:
        """Ask for something, and end after the cycle in which it was applied.

        Returns:
            The result of the command.

        Raises:
            RefusedError: it was refused.
        """
        outcome: Future[Any] = Future()
        self._box.submit(command, settle(outcome))
        while not outcome.done():
            yield
        return outcome.result()

    def start(self, program: CompiledProgram, asked: float, *, loaded: bool = False) -> Steps[None]:
        """Start a program, and end after its first cycle.

        Args:
            program: compiled.
            asked: when somebody asked for it, in monotonic time [s].
            loaded: it was loaded from a file and played.

        Raises:
            RefusedError: a program has begun that was asked for later, or no program may run now.
        """
        if asked < self._box.newest:
            raise RefusedError(f"program {program.name} does not begin: a newer one was compiled before it")
        self._box.newest = asked
        yield from self.apply(StartProgram(program, loaded=loaded))

    def in_worker(self, function: Callable[..., T], *arguments: Any) -> Steps[T]:
        """Do something that takes longer than a cycle in the worker process, see `TaskQueue.submit`.

        Returns:
            Its result; what it raises is raised here.
        """
        outcome: Future[T] = Future()

        def done(result: Any, error: Exception | None) -> None:
            settle(outcome)(result, error)
            self.steps.advance()

        task = self._loop.tasks.submit(done, self._failed, Place(done), function, *arguments)
        try:
            while not outcome.done():
                yield
            return outcome.result()
        finally:
            self._loop.tasks.drop(task)
            # An error holds this frame by its traceback, and the frame must not hold the error: with the
            # arguments both would wait for the collector, which looks rarely.
            outcome, arguments = Future(), ()

    def _failed(self, error: Exception) -> None:
        """Report an error in what was to follow steps or a task."""
        self._box.report("an answer is lost", error)

    def close(self, error: Exception) -> None:
        """End all steps with an error, and the tasks that they wait for."""
        self.steps.close(error)
