"""The worker process: does long tasks for a loop, so that they delay no cycle.

A task is a function that can be imported and its arguments, pickled; the answer is what it returns or
raises. `tasks` is the other end of the pipe. A task that takes long runs with a lower priority; one that
takes too much processor time or memory ends the process.
"""

from __future__ import annotations

import gc
import os
import pickle
import resource
import signal
import socket
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Final

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import EmulatorError, WorkerError
from ur_emulator.realtime.barrier import place_of
from ur_emulator.realtime.processes import framed, read_message

LONG: Final = 1.0
"""After so much real time a task takes long [s]."""
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
    signal.signal(signal.SIGALRM, _take_long)
    _limit_memory()
    with pipe, suppress(OSError, EOFError):
        while True:
            task = read_message(pipe)
            signal.setitimer(signal.ITIMER_REAL, LONG)
            signal.setitimer(signal.ITIMER_PROF, BUDGETS.task_seconds)  # its signal ends the process
            answer = _answer(task)
            for timer in (signal.ITIMER_REAL, signal.ITIMER_PROF):
                signal.setitimer(timer, 0.0)
            pipe.sendall(framed(answer))


def out_of_memory() -> str:
    """Say why a task is refused that needs too much memory."""
    return f"it needs more than {BUDGETS.task_memory >> 20} MiB of memory: make it shorter"


def _take_long(number: int, frame: FrameType | None) -> None:
    """Go on with a lower priority: the queue has a new process for the next tasks."""
    os.nice(_NICENESS)


def _limit_memory() -> None:
    """Limit what this process has beside what it needs for itself; some systems do not report that amount."""
    with suppress(OSError):
        n_pages = int(Path("/proc/self/statm").read_text().split()[5])
        limit = n_pages * resource.getpagesize() + BUDGETS.task_memory
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


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
        error = WorkerError(place_of(problem))
    gc.collect()  # what the task has left behind in circles; the next one has the same memory
    return pickle.dumps((None, error))
