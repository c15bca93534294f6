"""Long tasks of the services of one loop: done in another process, one at a time.

A task that takes long keeps its process for itself, and the others go on in a new one, so that no client
waits for a long program or a damaged file of somebody else for more than a moment.
"""

from __future__ import annotations

import pickle
import selectors
import signal
import socket
import time
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import WorkerError
from ur_emulator.realtime.barrier import Failed, guarded
from ur_emulator.realtime.worker_process import (
    OUT_OF_MEMORY,
    TAKES_LONG,
    WorkerProcess,
    leave_process,
    out_of_memory,
    take_process,
)

# Gets the result of a task and None, or None and what it raised.
TaskDone = Callable[[Any, Exception | None], None]


class Watcher(Protocol):
    """The part of a loop that a task queue uses."""

    def watch(
        self, sock: socket.socket, events: int, callback: Callable[[int], None], failed: Failed
    ) -> None:
        """Call `callback(events)` whenever `sock` is ready, `failed` with an error in it."""
        ...

    def unwatch(self, sock: socket.socket) -> None:
        """Stop watching `sock`."""
        ...

    def call_soon(self, call: Callable[[], None], failed: Failed) -> None:
        """Run `call` in the loop, soon, and `failed` with an error in it."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A place among the tasks that wait.

    Attributes:
        sender: whose task it is; those of one sender never run at the same time.
        turn: tasks with a lower one come first.
        arrived: when it was asked for; decides among those of the same turn.
    """

    sender: Hashable
    turn: int = 0
    arrived: float = field(default_factory=time.monotonic)


@dataclass(eq=False, slots=True)
class Task:
    """A task.

    Attributes:
        place: among those that wait.
        request: the pickled function with its arguments.
        done: called at its end, unless it is dropped.
        failed: called with an error in `done`.
        is_dropped: its result is no longer wanted.
    """

    place: Place
    request: bytes
    done: TaskDone
    failed: Failed
    is_dropped: bool = False


class TaskQueue:
    """Tasks in the order of their places; used in the loop's thread."""

    def __init__(self, loop: Watcher) -> None:
        self._loop = loop
        self._waiting: list[Task] = []
        self._under_way: dict[WorkerProcess, Task] = {}
        # The process that does the next task; those that do long ones are only in `_under_way`.
        self._process: WorkerProcess | None = None
        self._killed: set[WorkerProcess] = set()

    @property
    def is_idle(self) -> bool:
        """True while there is nothing to do."""
        return not self._waiting and not self._under_way

    def start(self) -> None:
        """Start the process now, so that the first task need not wait for it."""
        with suppress(OSError):  # the first task tries again, and gets the error
            self._start()

    def submit(
        self, done: TaskDone, failed: Failed, place: Place, function: Callable[..., Any], *arguments: Any
    ) -> Task:
        """Submit a task that takes longer than a cycle.

        Args:
            done: called in the loop with its result, never before this returns.
            failed: called with an error in `done`.
            place: among those that wait.
            function: one that can be imported; it shares no memory with this process.
            arguments: of the function; what can be pickled.
        """
        task = Task(place, pickle.dumps((function, arguments)), done, failed)
        self._waiting.append(task)
        self._begin_next()
        return task

    def drop(self, task: Task) -> None:
        """Drop a task; no effect after its end. One that runs ends at the latest when it begins to take long.

        So a client that asks and goes, again and again, cannot make the box start a process each time.
        """
        task.is_dropped = True
        with suppress(ValueError):
            self._waiting.remove(task)
        for process, other in tuple(self._under_way.items()):
            if other is task and process is not self._process:
                self._kill(process)
                self._begin_next()

    def close(self) -> None:
        """Drop all tasks; the process stays for the next loop if it is idle."""
        self._waiting.clear()
        process, self._process = self._process, None
        if process is not None and process not in self._under_way:
            self._loop.unwatch(process.sock)
            leave_process(process)
        for other in (*self._under_way, *self._killed):
            self._release(other)
        self._under_way.clear()

    # --- how

    def _start(self) -> WorkerProcess:
        if self._process is None:
            self._process = take_process()
            self._watch(self._process)
        return self._process

    def _watch(self, process: WorkerProcess) -> None:
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if process.has_more else 0)
        self._loop.watch(process.sock, events, partial(self._on_ready, process), partial(self._lose, process))

    def _begin_next(self) -> None:
        if self._process in self._under_way or (task := self._take_next()) is None:
            return
        try:
            process = self._start()
        except OSError as error:
            problem = WorkerError(f"the process for it cannot be started ({error}): try again later")
            self._loop.call_soon(lambda: self._finish(task, None, problem), task.failed)
        else:
            self._under_way[process] = task
            process.send(task.request)
            task.request = b""  # the process keeps what it has not sent yet
            self._watch(process)

    def _take_next(self) -> Task | None:
        busy = {task.place.sender for task in self._under_way.values()}
        free = [task for task in self._waiting if task.place.sender not in busy]
        if not free:
            return None
        task = min(free, key=lambda task: (task.place.turn, task.place.arrived))
        self._waiting.remove(task)
        return task

    def _on_ready(self, process: WorkerProcess, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            process.flush()
            self._watch(process)
        if not events & selectors.EVENT_READ:
            return
        try:
            answers = process.receive()
        except EOFError:
            self._lose(process)
            return
        for answer in answers:
            if process not in self._under_way:
                return
            if answer == TAKES_LONG:
                self._set_apart(process)
            else:
                self._answered(process, answer)

    def _set_apart(self, process: WorkerProcess) -> None:
        """Let a process go on alone with a task that takes long, if somebody wants it and not too many do."""
        task = self._under_way[process]
        if not task.is_dropped and len(self._under_way) <= BUDGETS.long_tasks:
            self._process = None
            self._begin_next()
            return
        self._kill(process)
        text = "it takes long, and so does what another client has sent: make it shorter, or try again later"
        self._finish(task, None, WorkerError(text))

    def _answered(self, process: WorkerProcess, answer: bytes) -> None:
        """Take the answer to a task; a process that was set apart has served then."""
        task = self._under_way.pop(process)
        if process is not self._process:
            self._kill(process)
        try:
            result, error = pickle.loads(answer)
        except Exception as problem:  # an exception whose class cannot be made again
            result, error = None, WorkerError(repr(problem))
        self._finish(task, result, error)

    def _lose(self, process: WorkerProcess, error: Exception | None = None) -> None:
        """Do without a process that has ended, or with which we failed; its task fails."""
        task = self._under_way.pop(process, None)
        if process is self._process:
            self._process = None
        code = self._release(process)
        if task is not None:
            self._finish(task, None, WorkerError(repr(error) if error else _reason(code)))

    def _kill(self, process: WorkerProcess) -> None:
        """Let a process end, which takes a moment; it is released afterwards."""
        process.kill()
        self._killed.add(process)
        self._under_way.pop(process, None)
        if process is self._process:
            self._process = None

    def _release(self, process: WorkerProcess) -> int:
        """Release what is left of a process that has ended or was killed; return its exit code."""
        self._killed.discard(process)
        self._loop.unwatch(process.sock)
        return process.end()

    def _finish(self, task: Task, result: Any, error: Exception | None) -> None:
        if not task.is_dropped:
            guarded(task.failed, task.done, result, error)
        self._begin_next()


def _reason(code: int) -> str:
    if code == -signal.SIGPROF:
        return f"it takes more than {BUDGETS.task_seconds:g} s of processor time: make it shorter"
    if code == OUT_OF_MEMORY:
        return out_of_memory()
    how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
    return f"the process that did it was ended {how}: try again"
