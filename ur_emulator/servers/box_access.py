"""What a server that acts for an operator may do with a box, and the steps in which it does it.

A step function is a generator: it yields once for every look at the box, `DashboardPort` looks again after
every cycle, and its return value is what it has come to. So nothing waits for a clock, and what was asked has
happened when it is answered.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

from ur_emulator.box_log import BoxLog, LogEntry
from ur_emulator.controller.command import Command
from ur_emulator.controller.controller import Controller
from ur_emulator.controller.events import Event, LogAdded
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.models.software import Software
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.realtime.served_box import ServedBox
from ur_emulator.scripting.network import Network

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class BoxIdentity:
    """What the box says of itself.

    Attributes:
        software: four numbers and a date.
        model: as people write it, "UR3".
        serial_number: digits; see protocol.ur_types.simulated_serial.
    """

    software: Software
    model: str
    serial_number: str


class BoxAccess:
    """A box as its servers use it.

    Attributes:
        identity: names and numbers of the box.
        network: opens sockets that the box dials out with.
        on_job_done: called in the loop when a job has ended, so that somebody looks before the next cycle.
    """

    def __init__(self, identity: BoxIdentity, box: ServedBox, loop: EventLoop, network: Network) -> None:
        self.identity = identity
        self.network = network
        self.on_job_done: list[Callable[[], None]] = []
        self._box = box
        self._loop = loop
        self._worker: ThreadPoolExecutor | None = None

    @property
    def controller(self) -> Controller:
        """Asked for its state, never changed directly."""
        return self._box.controller

    @property
    def snapshot(self) -> Snapshot:
        """State at the end of the last cycle."""
        return self._box.controller.snapshot

    @property
    def log(self) -> tuple[LogEntry, ...]:
        """The last entries of the log."""
        return self._box.log.entries

    @property
    def box_log(self) -> BoxLog:
        """The log itself, for those who read on where they left off."""
        return self._box.log

    def announce(self, event: Event) -> None:
        """Publish an event that needs no cycle."""
        self._box.announce(event)

    def note(self, text: str) -> None:
        """Write into the log what the dashboard server has to say."""
        self.announce(LogAdded("Dashboard", text))

    # --- steps

    def apply(self, command: Command) -> Generator[None, None, Any]:
        """Ask for something, and end after the cycle in which it was applied.

        Returns:
            What the command has to tell.

        Raises:
            RefusedError: it was refused.
        """
        outcome: Future[Any] = Future()
        self._box.submit(command, settle(outcome))
        while not outcome.done():
            yield
        return outcome.result()

    def in_worker(self, job: Callable[[], T]) -> Generator[None, None, T]:
        """Do something that takes longer than a cycle in a thread of its own, one job at a time.

        Returns:
            What it has come to; what it raises is raised here.
        """
        if self._worker is None:
            self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="dashboard")
        future = self._worker.submit(job)
        future.add_done_callback(lambda _: self._loop.call_soon_threadsafe(self._tell_of_job))
        while not future.done():
            yield
        return future.result()

    def _tell_of_job(self) -> None:
        for tell in self.on_job_done:
            tell()

    def close(self) -> None:
        """End the worker; what is queued is dropped, what is being done comes to nothing."""
        if self._worker is not None:
            self._worker.shutdown(wait=False, cancel_futures=True)


def settle(future: Future[Any]) -> Callable[[Any, Exception | None], None]:
    """Return what makes a result or an error that of a future."""

    def done(result: Any, error: Exception | None) -> None:
        if error is None:
            future.set_result(result)
        else:
            future.set_exception(error)

    return done
