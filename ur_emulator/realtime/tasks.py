"""Long tasks of the services of one loop: done one after the other in another process."""

from __future__ import annotations

import pickle
import selectors
import signal
import socket
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

from ur_emulator.errors import WorkerError
from ur_emulator.realtime.barrier import Failed, guarded
from ur_emulator.realtime.worker_process import TASK_LIMIT, WorkerProcess, leave_process, take_process

# Told of what has come of a task: its result and None, or None and what it raised.
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


@dataclass(eq=False, frozen=True, slots=True)
class Task:
    """A task: the pickled function with its arguments, what is called at its end, and with an error there."""

    request: bytes
    done: TaskDone
    failed: Failed


class TaskQueue:
    """Tasks in the order in which they were asked for; used in the loop's thread."""

    def __init__(self, loop: Watcher) -> None:
        self._loop = loop
        self._waiting: deque[Task] = deque()
        self._current: Task | None = None
        self._process: WorkerProcess | None = None
        self._killed: set[WorkerProcess] = set()

    def start(self) -> None:
        """Start the process now, so that the first task need not wait for it."""
        with suppress(OSError):  # the first task tries again, and gets the error
            self._start()

    def submit(self, done: TaskDone, failed: Failed, function: Callable[..., Any], *arguments: Any) -> Task:
        """Submit a task that takes longer than a cycle.

        Args:
            done: called in the loop with its result, never before this returns.
            failed: called with an error in `done`.
            function: one that can be imported; it shares no memory with this process.
            arguments: of the function; what can be pickled.
        """
        task = Task(pickle.dumps((function, arguments)), done, failed)
        self._waiting.append(task)
        self._begin_next()
        return task

    def drop(self, task: Task) -> None:
        """Drop a task; one in progress ends with its process. No effect after its end."""
        if task is self._current:
            self._current = None
            if self._process is not None:
                self._process.kill()
                self._killed.add(self._process)
                self._process = None
            self._begin_next()
        else:
            with suppress(ValueError):
                self._waiting.remove(task)

    def close(self) -> None:
        """Drop all tasks; the process stays for the next loop if it is idle."""
        self._waiting.clear()
        process, self._process = self._process, None
        if process is not None:
            self._loop.unwatch(process.sock)
            if self._current is None:
                leave_process(process)
            else:
                process.end()
        self._current = None
        for killed in tuple(self._killed):
            self._release(killed)

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
        if self._current is not None or not self._waiting:
            return
        task = self._current = self._waiting.popleft()
        try:
            process = self._start()
        except OSError as error:
            problem = WorkerError(f"the process for it cannot be started ({error}): try again later")
            self._loop.call_soon(lambda: self._finish(task, None, problem), task.failed)
        else:
            process.send(task.request)
            self._watch(process)

    def _on_ready(self, process: WorkerProcess, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            process.flush()
            self._watch(process)
        if not events & selectors.EVENT_READ:
            return
        try:
            answer = process.receive()
        except EOFError:
            self._lose(process)
            return
        if answer is not None and process is self._process and self._current is not None:
            try:
                result, error = pickle.loads(answer)
            except Exception as problem:  # an exception whose class cannot be made again
                result, error = None, WorkerError(repr(problem))
            self._finish(self._current, result, error)

    def _lose(self, process: WorkerProcess, error: Exception | None = None) -> None:
        """Do without a process that has ended, or with which we failed; its task fails."""
        code = self._release(process)
        if process is self._process:
            self._process = None
            if self._current is not None:
                self._finish(self._current, None, WorkerError(repr(error) if error else _reason(code)))

    def _finish(self, task: Task, result: Any, error: Exception | None) -> None:
        if task is self._current:
            self._current = None
            guarded(task.failed, task.done, result, error)
            self._begin_next()

    def _release(self, process: WorkerProcess) -> int:
        """Release what is left of a process that has ended or is killed; return its exit code."""
        self._killed.discard(process)
        self._loop.unwatch(process.sock)
        return process.end()


def _reason(code: int) -> str:
    if code == -signal.SIGPROF:
        return f"it takes more than {TASK_LIMIT:g} s of processor time: make it shorter"
    how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
    return f"the process that did it was ended {how}: try again"
