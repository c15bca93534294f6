"""Where operations are handed in: by other threads, which wait for the result, and by the control port.

All is done in the thread of the loop, step by step as cycles pass. Actions are loaded with the first
operation, so that a box that nobody controls carries nothing of them.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ur_emulator.controller.events import Event, LogAdded
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.errors import ControlError, EmulatorError, NotRunningError
from ur_emulator.realtime.event_loop import EventLoop

if TYPE_CHECKING:
    from ur_emulator.control.actions import Actions, Steps
    from ur_emulator.servers.box_access import BoxAccess
    from ur_emulator.servers.program_desk import ProgramDesk

# Told of what has come of an operation: its result, or the error that ended it.
Done = Callable[[Any, EmulatorError | None], None]
# What was given is shown in the log up to so many characters.
_MAX_SHOWN = 60
_ENDED = "the box has ended: operations need one that runs"
_NOT_LOGGED = frozenset({"wait_until", "add_to_log"})


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What the actions need beside the box.

    Attributes:
        access: to the box.
        desk: loads program files.
        clock: monotonic seconds.
        identity: returns what `identity` tells.
    """

    access: BoxAccess
    desk: ProgramDesk
    clock: Callable[[], float]
    identity: Callable[[], dict[str, Any]]


@dataclass(eq=False, slots=True)
class Job:
    """An operation under way."""

    steps: Steps
    done: Done


class ControlDesk:
    """Has operations done."""

    def __init__(self, loop: EventLoop, around: Surroundings) -> None:
        """Open.

        Args:
            loop: of the box.
            around: what the actions need.
        """
        self._loop = loop
        self._around = around
        self._actions: Actions | None = None
        self._jobs: list[Job] = []
        self._lock = threading.Lock()
        self._handed_in: deque[tuple[str, Mapping[str, Any], Future[Any]]] = deque()
        self._is_closed = False
        around.access.on_job_done.append(self.go_on)

    @property
    def clients(self) -> tuple[()]:
        """No connections of its own."""
        return ()

    # --- other threads

    def perform(self, name: str, arguments: Mapping[str, Any]) -> Any:
        """Have an operation done, from any thread but that of the loop; return its result.

        Raises:
            ControlError: it was not done.
        """
        self.load()
        if self._loop.is_own_thread:
            raise ControlError(f"{name} called in the thread of the box, which cannot wait: use `submit`")
        future: Future[Any] = Future()
        with self._lock:
            if self._is_closed or not self._loop.is_running:
                raise NotRunningError(_ENDED if self._is_closed else "the box does not run: start it first")
            self._handed_in.append((name, arguments, future))
        self._loop.call_soon_threadsafe(self._take_in)
        return future.result()

    def load(self) -> Actions:
        """Load the actions, which takes some milliseconds; from any thread."""
        if self._actions is None:
            from ur_emulator.control.actions import Actions

            self._actions = Actions(self._around)
        return self._actions

    # --- in the loop

    def begin(self, name: str, arguments: Mapping[str, Any], done: Done) -> Job | None:
        """Begin an operation; `done` may be told before this returns, then there is no job.

        Args:
            name: of an operation that exists.
            arguments: as they were given.
            done: told what has come of it.
        """
        job = Job(self._steps(name, arguments), done)
        if self._advance(job):
            return None
        self._jobs.append(job)
        return job

    def cancel(self, job: Job) -> None:
        """Forget a job; what it has begun takes its course."""
        if job in self._jobs:
            self._jobs.remove(job)
            job.steps.close()

    def complain(self, text: str) -> None:
        """Write into the log what went wrong here."""
        self._around.access.announce(LogAdded("Control", text))

    def publish(self, snapshot: Snapshot) -> None:
        """Look at what is under way after a cycle."""
        if self._jobs:
            self.go_on()

    def say(self, event: Event) -> None:
        """Nothing is said unasked."""

    def go_on(self) -> None:
        """Take all steps that can be taken now."""
        for job in tuple(self._jobs):
            if job in self._jobs and self._advance(job):
                self._jobs.remove(job)

    def close(self) -> None:
        """Tell all who wait that the box has ended."""
        with self._lock:
            self._is_closed = True
            handed_in, jobs = tuple(self._handed_in), tuple(self._jobs)
            self._handed_in.clear()
            self._jobs.clear()
        for _, _, future in handed_in:
            future.set_exception(NotRunningError(_ENDED))
        for job in jobs:
            job.steps.close()
            job.done(None, NotRunningError(_ENDED))

    # --- how

    def _take_in(self) -> None:
        while True:
            with self._lock:
                if not self._handed_in:
                    return
                name, arguments, future = self._handed_in.popleft()
            self.begin(name, arguments, _teller(future))

    def _steps(self, name: str, arguments: Mapping[str, Any]) -> Steps:
        """Check what was given, write it into the log, do it."""
        from ur_emulator.control.operations import BY_NAME

        operation = BY_NAME[name]
        checked = operation.check(arguments)
        if not (operation.only_reads or name in _NOT_LOGGED):
            self._around.access.announce(LogAdded("Control", _shown(name, arguments)))
        return (yield from self.load().begin(name, checked))

    def _advance(self, job: Job) -> bool:
        """Take one step; return whether that was the last."""
        try:
            next(job.steps)
        except StopIteration as end:
            job.done(end.value, None)
        except EmulatorError as error:
            job.done(None, error)
        except Exception as error:  # a defect of ours must not end the box
            job.done(None, ControlError(f"the operation cannot be done: {error!r}"))
        else:
            return False
        return True


def _teller(future: Future[Any]) -> Done:
    def tell(result: Any, error: EmulatorError | None) -> None:
        if error is None:
            future.set_result(result)
        else:
            future.set_exception(error)

    return tell


def _shown(name: str, arguments: Mapping[str, Any]) -> str:
    """Return an operation as one line for the log."""
    words = [name]
    for key, value in arguments.items():
        if value is None:
            continue
        text = " ".join(str(value).split())
        words.append(f"{key}={text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + '...'}")
    return " ".join(words)
