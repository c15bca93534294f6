"""Runs operations: those of other threads, which wait for the result, and those of the HTTP port.

All is done in the thread of the loop, step by step as cycles pass.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from ur_emulator.commands.operation import Operation
from ur_emulator.control.operations import make
from ur_emulator.control.step_operation import Context, StepOperation, Steps
from ur_emulator.controller.command import Command
from ur_emulator.controller.events import Event, LogAdded
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.errors import ControlError, EmulatorError, NotRunningError
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.servers.box_access import settle

# Told of what has come of an operation: its result, or the error that ended it.
Finished = Callable[[Any, EmulatorError | None], None]
# What was given is shown in the log up to so many characters.
_MAX_SHOWN = 60
_ENDED = "the box has ended: operations need one that runs"


@dataclass(eq=False, slots=True)
class Job:
    """An operation under way."""

    steps: Steps
    done: Finished


class OperationRunner:
    """Runs operations on one box.

    Args:
        loop: of the box.
        context: what their steps need.
    """

    def __init__(self, loop: EventLoop, context: Context) -> None:
        self._loop = loop
        self._context = context
        self._jobs: list[Job] = []
        self._lock = threading.Lock()
        self._handed_in: deque[tuple[str, Mapping[str, Any], Future[Any]]] = deque()
        self._is_closed = False
        context.access.on_job_done.append(self.go_on)

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
        if self._loop.is_own_thread:
            raise ControlError(f"{name} called in the thread of the box, which cannot wait: use `submit`")
        future: Future[Any] = Future()
        with self._lock:
            if self._is_closed or not self._loop.is_running:
                raise NotRunningError(_ENDED if self._is_closed else "the box does not run: start it first")
            self._handed_in.append((name, arguments, future))
        self._loop.call_soon_threadsafe(self._take_in)
        return future.result()

    # --- in the loop

    def begin(self, name: str, arguments: Mapping[str, Any], done: Finished) -> Job | None:
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
        self._context.access.announce(LogAdded("Control", text))

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
            self.begin(name, arguments, settle(future))

    def _steps(self, name: str, arguments: Mapping[str, Any]) -> Steps:
        """Check what was given, write it into the log, do it."""
        operation = make(name, arguments)
        if operation.is_logged and not operation.only_reads:
            self._context.access.announce(LogAdded("Control", _shown(name, arguments)))
        return (yield from _steps_of(operation, self._context))

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


def _steps_of(operation: Operation[Any], context: Context) -> Steps:
    """Return the steps of an operation; a command is applied in the next cycle."""
    if isinstance(operation, StepOperation):
        return (yield from operation.steps(context))
    assert isinstance(operation, Command)
    result = yield from context.access.apply(operation)
    return {**(result or {}), "tick": context.access.snapshot.tick}


def _shown(name: str, arguments: Mapping[str, Any]) -> str:
    """Return an operation as one line for the log."""
    words = [name]
    for key, value in arguments.items():
        if value is None:
            continue
        text = " ".join(str(value).split())
        words.append(f"{key}={text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + '...'}")
    return " ".join(words)
