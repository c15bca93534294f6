"""Long tasks of the services of a loop, done in a worker process: both ends of its pipe.

A task is a function that can be imported and its arguments, pickled; the answer is what it returns or
raises. The process does one task after the other. One that takes long runs on with a lower priority in its
process, and the others go on in a new one, so that no client waits for a long program or a damaged file of
somebody else for more than a moment. A task that takes too much processor time or memory ends its process.
The queue looks at the clock itself: a process may be stopped.
"""

from __future__ import annotations

import gc
import os
import pickle
import selectors
import signal
import socket
import time
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from types import FrameType
from typing import Any, Final

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import EmulatorError, WorkerError
from ur_emulator.host.runtime.barrier import Failed, describe_error, guarded
from ur_emulator.host.runtime.event_loop import EventLoop, end_loop
from ur_emulator.host.runtime.processes import (
    OUT_OF_MEMORY,
    WORKER,
    Child,
    Pipe,
    framed,
    is_stopped,
    limit_memory,
    read_message,
    resident,
    start_child,
)

# A process that has ended is not waited for.
GRACE: Final = 0.0
LONG: Final = 1.0
"""After so much real time a task takes long, and after so much processor time it has a lower priority [s]."""
# By so much the priority of a long task is lower: the loop comes first.
_NICENESS = 10
# The collector looks when so many objects are new: the trees of a long program are no garbage before its end.
_MANY_OBJECTS = 300_000


def prepare() -> None:
    """Load the compiler."""
    from ur_emulator.program_files import compiling  # noqa: F401
    from urscript.syntax.parser import prepare

    prepare()


def clean_up() -> None:
    """Do nothing: tasks leave nothing behind."""


def run(pipe: socket.socket) -> None:
    """Do tasks until the other end is closed; the main function of the process."""
    gc.enable()
    gc.set_threshold(_MANY_OBJECTS)
    signal.signal(signal.SIGVTALRM, _take_long)
    limit_memory(BUDGETS.task_memory)
    with pipe, suppress(OSError, EOFError):
        while True:
            task = read_message(pipe)
            # Processor time: by the clock, also a short task would lose its priority on a busy machine.
            signal.setitimer(signal.ITIMER_VIRTUAL, LONG)
            signal.setitimer(signal.ITIMER_PROF, BUDGETS.task_seconds)  # its signal ends the process
            answer = _answer(task)
            for timer in (signal.ITIMER_VIRTUAL, signal.ITIMER_PROF):
                signal.setitimer(timer, 0.0)
            pipe.sendall(framed(answer))


def out_of_memory() -> str:
    """Say why a task is refused that needs too much memory."""
    return f"it needs more than {BUDGETS.task_memory >> 20} MiB of memory: make it shorter"


def _take_long(number: int, frame: FrameType | None) -> None:
    """Go on with a lower priority: the queue has a new process for the next tasks."""
    os.nice(_NICENESS)


def _answer(task: bytes) -> bytes:
    """Do a task; return its result and its error, one of them None, pickled.

    An error that is neither one of the emulator nor of the system is a defect of ours: a `WorkerError`.
    """
    try:
        function, arguments = pickle.loads(task)
        answer = pickle.dumps((function(*arguments), None))
        if len(answer) <= BUDGETS.task_result_bytes:
            return answer
        limit = BUDGETS.task_result_bytes >> 20
        error: Exception = WorkerError(f"its result has more than {limit} MiB: make it shorter")
    except (EmulatorError, OSError) as problem:
        error = problem
    except MemoryError:
        error = WorkerError(out_of_memory())
    except Exception as problem:
        error = WorkerError(describe_error(problem))
    gc.collect()  # what the task has left behind in circles; the next one has the same memory
    return pickle.dumps((None, error))


# Gets the result of a task and None, or None and what it raised.
TaskDone = Callable[[Any, Exception | None], None]
# How often the queue looks at the clock while there are tasks [s].
_LOOK_PERIOD = 0.25
# After so much real time a task ends [s]: it may wait for a disk for ever.
_FOR_EVER = 60.0


@dataclass(frozen=True, slots=True, eq=False)
class Ticket:
    """What decides when a task that waits has its turn.

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
        request: the pickled function with its arguments.
        failed: called with an error in `done`.
        is_dropped: its result is no longer wanted.
        began: when a process got it, or began itself [s, monotonic].
    """

    ticket: Ticket
    request: bytes
    done: TaskDone
    failed: Failed
    is_dropped: bool = False
    began: float = 0.0


class _Process(Pipe):
    """A worker process, and the pipe to it; `memory_at_rest` is what it held when it began [bytes]."""

    def __init__(self, queue: TaskQueue) -> None:
        self._queue = queue
        self.child: Child = start_child(WORKER)
        self.memory_at_rest = 0
        super().__init__(queue.loop, self.child.pipe)

    @property
    def memory(self) -> int:
        """What it holds [bytes]; 0 where nobody knows."""
        return 0 if self.child.pid is None else resident(self.child.pid)

    @property
    def growth(self) -> int:
        """What it holds beyond what it held when it began [bytes]."""
        return max(0, self.memory - self.memory_at_rest)

    def take(self, message: bytes) -> None:
        """Take the answer to a task."""
        self._queue.answered(self, message)

    def failed(self, error: Exception) -> None:
        """Do without the process after an error of ours."""
        self._queue.lose(self, error)


class TaskQueue:
    """Tasks in the order of their tickets; used in the thread of `loop`."""

    def __init__(self, loop: EventLoop) -> None:
        self.loop = loop
        self._waiting: list[Task] = []
        self._under_way: dict[_Process, Task] = {}
        # The process that does the next task; those that do long ones are only in `_under_way`.
        self._process: _Process | None = None
        # All that have not ended yet.
        self._processes: set[_Process] = set()
        self._is_looking = False

    @property
    def is_idle(self) -> bool:
        """True while there is nothing to do."""
        return not self._waiting and not self._under_way

    def start(self) -> None:
        """Start the process now, so that the first task need not wait for it."""
        with suppress(OSError):  # the first task tries again, and gets the error
            self._start()

    def submit(
        self, done: TaskDone, failed: Failed, ticket: Ticket, function: Callable[..., Any], *arguments: Any
    ) -> Task:
        """Submit a task that takes longer than a cycle.

        Args:
            done: called in the loop with its result, never before this returns.
            failed: called with an error in `done`.
            function: one that can be imported; it shares no memory with this process.
            arguments: what can be pickled.
        """
        task = Task(ticket, pickle.dumps((function, arguments)), done, failed)
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

    def memory(self) -> int:
        """Return what the processes hold beyond what they began with [bytes]."""
        return sum(process.growth for process in self._under_way)

    def end_for_memory(self) -> None:
        """End the task that holds most."""
        process = max(self._under_way, key=lambda process: process.growth)
        self._end(process, WorkerError(out_of_memory()))

    def close(self) -> None:
        """Drop all tasks and let go of all processes."""
        self._waiting.clear()
        for process in tuple(self._processes):
            process.child.kill()
            self._release(process)
        self._under_way.clear()
        self._process = None

    # --- how

    def _start(self) -> _Process:
        if self._process is None:
            self._process = process = _Process(self)
            self._processes.add(process)
            look = partial(self._look_at, process)
            self.loop.watch(process.child.life, selectors.EVENT_READ, look, end_loop)
        return self._process

    def _begin_next(self) -> None:
        if self._process in self._under_way or (task := self._take_next()) is None:
            return
        try:
            process = self._start()
        except OSError as error:
            problem = WorkerError(f"the process for it cannot be started ({error}): try again later")
            self.loop.call_soon(lambda: self._finish(task, None, problem), task.failed)
            return
        self._under_way[process] = task
        task.began = time.monotonic()
        process.send(framed(task.request))
        task.request = b""  # the pipe keeps what it has not sent yet
        if not self._is_looking:
            self._look_later()

    def _take_next(self) -> Task | None:
        busy = {task.ticket.sender for task in self._under_way.values()}
        free = [task for task in self._waiting if task.ticket.sender not in busy]
        if not free:
            return None
        task = min(free, key=lambda task: (task.ticket.turn, task.ticket.arrived))
        self._waiting.remove(task)
        return task

    def answered(self, process: _Process, answer: bytes) -> None:
        """Take the answer to a task; a process in which one took long has a low priority, and goes."""
        if (task := self._under_way.pop(process, None)) is None:
            return
        if process is not self._process or time.monotonic() - task.began >= LONG:
            self._kill(process)
        try:
            result, error = pickle.loads(answer)
        except Exception as problem:  # an exception whose class cannot be made again
            result, error = None, WorkerError(repr(problem))
        self._finish(task, result, error)

    # --- tasks that take long

    def _look_later(self) -> None:
        self._is_looking = True
        self.loop.call_later(_LOOK_PERIOD, self._look, end_loop)

    def _look(self) -> None:
        """Set tasks apart that take long; end those that take for ever or whose process was stopped."""
        self._is_looking = False
        now = time.monotonic()
        for process, task in tuple(self._under_way.items()):
            pid = process.child.pid
            if pid is not None and is_stopped(pid):
                self._end(process, WorkerError("the process that did it was stopped: try again"))
            elif now - task.began >= _FOR_EVER:
                self._end(process, WorkerError(f"it takes more than {_FOR_EVER:g} s: make it shorter"))
            elif process is self._process and pid is not None and now - task.began >= LONG:
                self._set_apart(process)
        if self._under_way:
            self._look_later()

    def _set_apart(self, process: _Process) -> None:
        """Let a process go on alone with a task that takes long, if somebody wants it and not too many do."""
        if not self._under_way[process].is_dropped and len(self._under_way) <= BUDGETS.long_tasks:
            self._process = None
            self._begin_next()
        else:
            text = "it takes long, and so does what another client has sent: "
            self._end(process, WorkerError(f"{text}make it shorter, or try again later"))

    # --- ends

    def _end(self, process: _Process, error: WorkerError) -> None:
        task = self._under_way[process]
        self._kill(process)
        self._finish(task, None, error)

    def _look_at(self, process: _Process, events: int) -> None:
        """Take what the server tells of a process: it has begun, or ended."""
        if process.child.look():
            self.lose(process)
        else:
            process.memory_at_rest = process.memory
            if process in self._under_way:  # its task has waited for it until now
                self._under_way[process].began = time.monotonic()

    def lose(self, process: _Process, error: Exception | None = None) -> None:
        """Do without a process that has ended, or with which we failed; its task fails."""
        task = self._under_way.get(process)
        reason = repr(error) if error else _reason(process.child)
        self._kill(process)
        self._release(process)
        if task is not None:
            self._finish(task, None, WorkerError(reason))

    def _kill(self, process: _Process) -> None:
        """Let a process end, which takes a moment; it is released afterwards."""
        process.child.kill()
        self._under_way.pop(process, None)
        if process is self._process:
            self._process = None

    def _release(self, process: _Process) -> None:
        """Release what is left of a process that has ended or was killed."""
        self._processes.discard(process)
        self.loop.unwatch(process.child.life)
        process.close()
        process.child.close()

    def _finish(self, task: Task, result: Any, error: Exception | None) -> None:
        if not task.is_dropped:
            guarded(task.failed, task.done, result, error)
        self._begin_next()


def _reason(child: Child) -> str:
    """Say why a task is refused whose process has ended."""
    if child.exit_code == -signal.SIGPROF:
        return f"it takes more than {BUDGETS.task_seconds:g} s of processor time: make it shorter"
    if child.exit_code == OUT_OF_MEMORY:
        return out_of_memory()
    if child.exit_code is None:
        return "the process that did it has ended: try again"
    return f"the process that did it {child.end}: try again"
