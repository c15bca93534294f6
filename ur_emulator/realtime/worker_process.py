"""WorkerProcess: does long tasks for a loop, so that they delay no cycle: both ends of the pipe.

A task is a function that can be imported and its arguments, pickled; the answer is what it returns or raises.
The process lives as long as this one: it ends when the pipe is closed. It is in a session of its own, where
Ctrl-C does not reach it. One that a loop leaves idle stays for the next loop of this process. While a task
takes long, the process says so and lowers its priority; when it takes too long, it ends.
"""

from __future__ import annotations

import atexit
import gc
import os
import pickle
import resource
import signal
import socket
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import FrameType

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import EmulatorError, WorkerError
from ur_emulator.realtime.barrier import place_of

# What comes before the answer to a task that takes long.
TAKES_LONG = b""
# After so much real time a task takes long [s], and after so much it ends: it may wait for a disk for ever.
_LONG = 1.0
_FOR_EVER = 60.0
# By so much the priority of a long task is lower: the loop comes first.
_NICENESS = 10
# Exit code of a process that has no memory left, not even for saying so.
OUT_OF_MEMORY = 77
# Bytes of the length in front of a task and of an answer, big-endian.
_HEAD = 8
_READ_SIZE = 1 << 18
# The collector looks when so many objects are new: the trees of a long program are no garbage before its end.
_MANY_OBJECTS = 300_000
_CODE = "import sys; sys.path[:] = {path!r}; from ur_emulator.realtime.worker_process import work; work()"


class WorkerProcess:
    """The process, as the loop sees it.

    Attributes:
        sock: our end of the pipe, non-blocking; a loop watches it.
    """

    def __init__(self) -> None:
        """Start it.

        Raises:
            OSError: there is no process or no descriptor to be had.
        """
        self.sock, other = socket.socketpair()
        with other:
            try:
                self._process = subprocess.Popen(
                    [sys.executable, "-c", _CODE.format(path=sys.path)],
                    stdin=other.fileno(),
                    stdout=subprocess.DEVNULL,
                    start_new_session=True,
                )
            except OSError:
                self.sock.close()
                raise
        self.sock.setblocking(False)
        self._outbox = memoryview(b"")
        self._inbox = bytearray()

    @property
    def has_more(self) -> bool:
        """Whether bytes of the task are still to be sent."""
        return bool(self._outbox)

    @property
    def is_alive(self) -> bool:
        """Whether the process has not ended."""
        return self._process.poll() is None

    def send(self, task: bytes) -> None:
        """Begin to send a task; the one before must be answered."""
        self._outbox = memoryview(_framed(task))
        self.flush()

    def flush(self) -> None:
        """Send what goes now. A process that has ended is noticed by `receive`."""
        try:
            self._outbox = self._outbox[self.sock.send(self._outbox) :]
        except BlockingIOError:
            return
        except OSError:
            self._outbox = memoryview(b"")

    def receive(self) -> list[bytes]:
        """Return the answers that have come completely.

        Raises:
            EOFError: the process has ended.
        """
        try:
            data = self.sock.recv(_READ_SIZE)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            raise EOFError
        self._inbox += data
        answers = []
        while len(self._inbox) >= (end := _HEAD + int.from_bytes(self._inbox[:_HEAD], "big")):
            answers.append(bytes(memoryview(self._inbox)[_HEAD:end]))
            del self._inbox[:end]
        return answers

    def kill(self) -> None:
        """Let the process end, soon."""
        self._process.kill()

    def end(self) -> int:
        """Let the process end, wait for that and release everything; return its exit code."""
        self._process.kill()
        self.sock.close()
        return self._process.wait()


# At most one process that waits for the next loop.
_idle: list[WorkerProcess] = []


def prestart_process() -> None:
    """Let a process be idle when the next loop starts: it takes a moment to load the compiler.

    One that cannot be started is not an error before there is a task for it.
    """
    if not _idle:
        with suppress(OSError):
            _idle.append(WorkerProcess())


def take_process() -> WorkerProcess:
    """Return an idle process, or a new one.

    Raises:
        OSError: it cannot be started.
    """
    while _idle:
        with suppress(IndexError):  # another thread was quicker
            process = _idle.pop()
            if process.is_alive:
                return process
            process.end()
    return WorkerProcess()


def leave_process(process: WorkerProcess) -> None:
    """Give back a process that has nothing to do."""
    if _idle:
        process.end()
    else:
        _idle.append(process)


@atexit.register
def _end_idle() -> None:
    while _idle:
        _idle.pop().end()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)


# --- in the process


def work() -> None:
    """Do tasks until the other end is closed; the main function of the process."""
    from ur_emulator.programs import compiling  # noqa: F401
    from urscript.syntax.parser import prepare

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    prepare()  # now, so that the first program does not wait for it
    gc.freeze()
    gc.set_threshold(_MANY_OBJECTS)
    _limit_memory()
    with socket.socket(fileno=sys.stdin.fileno()) as sock, sock.makefile("rb") as stream, suppress(OSError):

        def takes_long(number: int, frame: FrameType | None) -> None:
            signal.signal(signal.SIGALRM, signal.SIG_DFL)
            signal.setitimer(signal.ITIMER_REAL, _FOR_EVER)
            os.nice(_NICENESS)
            sock.sendall(_framed(TAKES_LONG))

        try:
            while head := stream.read(_HEAD):
                task = stream.read(int.from_bytes(head, "big"))
                signal.signal(signal.SIGALRM, takes_long)
                signal.setitimer(signal.ITIMER_REAL, _LONG)
                signal.setitimer(signal.ITIMER_PROF, BUDGETS.task_seconds)  # its signal ends the process
                answer = _answer(task)
                for timer in (signal.ITIMER_REAL, signal.ITIMER_PROF):
                    signal.setitimer(timer, 0.0)
                sock.sendall(_framed(answer))
        except MemoryError:
            os._exit(OUT_OF_MEMORY)
    os._exit(0)


def out_of_memory() -> str:
    """Say why a task is refused that needs too much memory."""
    return f"it needs more than {BUDGETS.task_memory >> 20} MiB of memory: make it shorter"


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


def _framed(data: bytes) -> bytes:
    return len(data).to_bytes(_HEAD, "big") + data
