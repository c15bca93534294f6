"""Control boxes in a process of their own: both ends of its pipe.

Messages are pickled tuples with a kind first. The user's process sends the options of the boxes, then
`start`, then requests with a number; the boxes' process sends where the boxes are served, answers with the
number of the request, entries of the logs, and how each box has ended. Entries precede the answer to an
operation that has written them.
"""

from __future__ import annotations

import os
import pickle
import signal
import socket
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from itertools import count
from typing import TYPE_CHECKING, Any

from ur_emulator.errors import ArgumentError, ControlError, EmulatorError, NotRunningError
from ur_emulator.host.box_log import LogBook, LogEntry
from ur_emulator.host.box_options import BoxOptions, ServedAt
from ur_emulator.host.runtime.processes import BOX, Child, Pipe, framed, read_message, start_child

if TYPE_CHECKING:
    from ur_emulator.host.rack import LoopRack
    from ur_emulator.machine.commands.operation import Operation
    from ur_emulator.machine.controller.command import Command, Done

# How long the user's process waits for boxes that were told to end [s].
_END_TIMEOUT = 10.0
# How long the boxes' process waits at its end until its last messages are read [s].
_FAREWELL = 1.0
# How long the boxes' process may take to close its ports when the user's has ended [s].
GRACE = 5.0
# How often the boxes' process looks whether the user's process lives [s].
_LOOK_PERIOD = 1.0


class ProcessRack:
    """Boxes in a process of their own, as the user's process sees them; used from any thread.

    Attributes:
        served: where the boxes are served, and as what.
    """

    def __init__(self, options: Sequence[BoxOptions]) -> None:
        """Start the process and have the boxes assembled; nothing listens yet.

        Two boxes need two addresses, or a `port_base` each. EmulatorError if an argument is not allowed, or
        there is no process to be had.
        """
        try:
            self._child: Child = start_child(BOX)
        except OSError as error:
            raise EmulatorError(f"the process of the box cannot be started: {error}") from None
        self._let_go = weakref.finalize(self, self._child.close)
        self._sending = threading.Lock()
        self._state = threading.Lock()
        self._futures: dict[int, Future[Any]] = {}
        self._numbers = count(1)
        self._reader: threading.Thread | None = None
        self._has_ended = False
        self._said_farewell = False
        self._failure: Exception | None = None
        self._logs = [LogBook() for _ in options]
        self._ends: list[tuple[bool, Exception | None]] = [(False, None)] * len(options)
        self.served = self._ask_for_boxes((os.getpid(), os.getcwd(), list(options)))

    # --- life

    def start(self) -> None:
        """Open the ports and run; PortError if one is taken."""
        self.served = self._ask_for_boxes("start")
        self._reader = threading.Thread(target=_read, args=(weakref.ref(self), self._child.pipe), daemon=True)
        self._reader.start()

    def stop(self) -> None:
        """Let the boxes end, soon."""
        with suppress(OSError):
            self._send(("stop",))

    def join(self) -> BaseException | None:
        """End the boxes and wait for that; return the error that has ended one, if there is one."""
        self.stop()
        if self._has_ended:
            pass
        elif self._reader is not None:
            self._reader.join(_END_TIMEOUT)
            if self._reader.is_alive():
                self._child.kill()
                self._reader.join(_END_TIMEOUT)
                self._failure = EmulatorError(f"the box did not end within {_END_TIMEOUT:g} s: it was killed")
        else:
            self._child.wait()
        self._has_ended = True
        self._let_go()
        return self._failure or next((failure for _, failure in self._ends if failure), None)

    # --- what a user asks of the box with a number

    def perform(self, index: int, operation: Operation[Any]) -> Any:
        """Have an operation done; return its result."""
        if threading.current_thread() is self._reader:
            raise ControlError(
                f"{operation.api_name} called in the thread of the box's log, which cannot wait: use `submit`"
            )
        return self._begin("perform", index, operation).result()

    def submit(self, index: int, command: Command, done: Done | None) -> None:
        """Submit a command for the next cycle; `done` is called in a thread of its own."""
        self._begin("submit", index, command, done=done)

    def log(self, index: int) -> tuple[LogEntry, ...]:
        """Return the last entries of the log, the oldest first; also after the end."""
        self._catch_up()
        return self._logs[index].entries

    def follow_log(self, index: int, follower: Callable[[LogEntry], None]) -> None:
        """Call `follower` with every entry from now on, in a thread of its own."""
        self._logs[index].follow(follower)

    def end_of(self, index: int) -> tuple[bool, Exception | None]:
        """Return whether a client has switched the box off, and the error that has ended it."""
        self._catch_up()
        is_shut_down, failure = self._ends[index]
        return is_shut_down, failure or self._failure

    def _catch_up(self) -> None:
        """Wait until all has come that the boxes have to tell by now."""
        if threading.current_thread() is not self._reader:
            with suppress(NotRunningError):
                self._begin("news").result()

    # --- messages

    def _ask_for_boxes(self, message: Any) -> list[ServedAt]:
        """Send a message that has to do with all boxes; return where they are."""
        try:
            self._send(message)
            served, error = pickle.loads(read_message(self._child.pipe))
        except (OSError, EOFError):
            served, error = [], EmulatorError(f"the process of the box {self._how_it_ended()}")
        if error is not None:
            self._has_ended = True
            self._let_go()
            raise error
        boxes: list[ServedAt] = served
        return boxes

    def _send(self, message: Any) -> None:
        data = framed(pickle.dumps(message))
        with self._sending:
            self._child.pipe.sendall(data)

    def _begin(self, kind: str, *request: Any, done: Done | None = None) -> Future[Any]:
        """Ask for something; return its result, a ControlError if it was not done."""
        future: Future[Any] = Future()
        if done is not None:
            future.add_done_callback(partial(_tell, done))
        with self._state:
            if self._has_ended or self._reader is None:
                raise NotRunningError(
                    self._why_ended() if self._has_ended else "the box does not run: start it first"
                )
            number = next(self._numbers)
            self._futures[number] = future
        try:
            self._send((kind, number, *request))
        except OSError:
            # Else the reader is about to notice the end, and tells who waits.
            if not self._reader.is_alive():
                raise NotRunningError from None
        except Exception as error:
            del self._futures[number]
            raise ArgumentError(f"it cannot be sent to the process of the box: {error}") from None
        return future

    def _take(self, message: Any) -> None:
        """Take a message of the boxes; in the reading thread."""
        match message:
            case ("answer", number, result, error):
                with self._state:
                    future = self._futures.pop(number)
                if error is None:
                    future.set_result(result)
                else:
                    future.set_exception(error)
            case ("entries", index, entries):
                for entry in entries:
                    self._logs[index].add(entry)
            case ("end", index, is_shut_down, failure):
                self._ends[index] = (is_shut_down, failure)
            case ("farewell",):
                self._said_farewell = True

    def _end(self) -> None:
        """The process has ended: tell who waits."""
        how = self._how_it_ended()
        with self._state:
            self._has_ended = True
            if not self._said_farewell:
                self._failure = EmulatorError(f"the process of the box {how}")
            waiting, self._futures = tuple(self._futures.values()), {}
        for future in waiting:
            future.set_exception(NotRunningError(self._why_ended()))

    def _how_it_ended(self) -> str:
        self._child.wait()
        if self._child.exit_code is None:
            return "has ended, nobody knows why"
        return f"{self._child.end}: its log shows what it did last"

    def _why_ended(self) -> str:
        return NotRunningError.ENDED if self._failure is None else str(self._failure)


def _read(rack: weakref.ref[ProcessRack], pipe: socket.socket) -> None:
    """Take messages until the process has ended; the thread holds no rack that its user has let go."""
    with suppress(EOFError, OSError):
        while True:
            message = pickle.loads(read_message(pipe))
            if (owner := rack()) is not None:
                owner._take(message)
            del owner
    if (owner := rack()) is not None:
        owner._end()


def _tell(done: Done, future: Future[Any]) -> None:
    error = future.exception()
    if error is None or isinstance(error, Exception):
        done(None if error else future.result(), error)


# --- in the process of the boxes


def prepare() -> None:
    """Load what boxes and workers need."""
    from ur_emulator.host import rack  # noqa: F401
    from ur_emulator.host.runtime import worker

    worker.prepare()


def clean_up() -> None:
    """Remove what boxes have left behind that were killed."""
    from ur_emulator.host.reports.report_files import remove_left_folders

    remove_left_folders()


def run(pipe: socket.socket) -> None:
    """Serve boxes until the other end of the pipe is closed, or they have ended; the main function."""
    from ur_emulator.host.rack import LoopRack

    with pipe, suppress(EOFError, OSError):
        owner, folder, options = pickle.loads(read_message(pipe))
        os.chdir(folder)  # names of files are relative to that of the user's process
        try:
            rack = LoopRack(options)
            pipe.sendall(framed(pickle.dumps((rack.served, None))))
            if pickle.loads(read_message(pipe)) != "start":
                rack.close()
                return
            rack.listen()
        except EmulatorError as error:
            pipe.sendall(framed(pickle.dumps(([], error))))
        else:
            _Link(rack, pipe, owner).run()


class _Link(Pipe):
    """The boxes' end of the pipe, in their loop; `owner` is the number of the process of their user."""

    def __init__(self, rack: LoopRack, pipe: socket.socket, owner: int) -> None:
        self._rack = rack
        self._owner = owner
        # Entries of each log that were sent.
        self._n_sent = [0] * len(rack.boxes)
        self._has_ended: set[int] = set()
        super().__init__(rack.loop, pipe)

    def run(self) -> None:
        """Run the boxes until their end."""
        rack, loop = self._rack, self._rack.loop
        signal.signal(signal.SIGTERM, lambda number, frame: rack.stop())
        for box in rack.boxes:
            box.log.follow(lambda entry: loop.call_soon(self._send_news, self.failed))
        self._put(rack.served, None)
        self._look()
        with suppress(EmulatorError):  # of one of the boxes: it is sent below
            rack.serve_forever()
        self._say_farewell()

    def _look(self) -> None:
        """End with the process of the user, also when another one holds its end of the pipe."""
        try:
            os.kill(self._owner, 0)
        except ProcessLookupError:
            self._rack.stop()
        self._rack.loop.call_later(_LOOK_PERIOD, self._look, self.failed)

    def take(self, message: bytes) -> None:
        """Take a message of the user's process."""
        match pickle.loads(message):
            case ("stop",):
                self._rack.stop()
            case ("perform", number, index, operation):
                self._rack.boxes[index].begin(operation, partial(self._answer, number))
            case ("submit", number, index, command):
                self._rack.boxes[index].submit(command, partial(self._answer, number))
            case ("news", number):
                self._answer(number, None, None)

    def close(self) -> None:
        """Let the boxes end with the pipe: without it nobody can."""
        super().close()
        self._rack.stop()

    def failed(self, error: Exception) -> None:
        """End the boxes with an error of ours."""
        self.close()
        raise error

    def _flush(self) -> None:
        super()._flush()
        self._send_news()

    def _answer(self, number: int, result: Any, error: Exception | None) -> None:
        self._put_news()
        self._put("answer", number, result, _portable(error))

    def _send_news(self) -> None:
        """Send what is new, unless the other end has not read what was sent before."""
        if not self._outbox:
            self._put_news()

    def _put_news(self) -> None:
        for message in self._news():
            self._put(*message)

    def _news(self) -> Iterator[tuple[Any, ...]]:
        """Yield new entries of the logs, and which boxes have ended and how."""
        for index, box in enumerate(self._rack.boxes):
            if box.log.count > self._n_sent[index]:
                entries = box.log.since(self._n_sent[index])
                self._n_sent[index] = box.log.count
                yield "entries", index, entries
            if (box.is_shut_down or box.failure) and index not in self._has_ended:
                self._has_ended.add(index)
                yield "end", index, box.is_shut_down, _portable(box.failure)

    def _put(self, *message: Any) -> None:
        self.send(framed(pickle.dumps(message)))

    def _say_farewell(self) -> None:
        """Send the last news, and wait for a moment until they are read: the loop has ended."""
        if self._sock is not None:
            last = [framed(pickle.dumps(message)) for message in (*self._news(), ("farewell",))]
            self._sock.settimeout(_FAREWELL)
            with suppress(OSError):
                self._sock.sendall(b"".join((self._outbox, *last)))


def _portable(error: Exception | None) -> Exception | None:
    """Return an error that goes through the pipe."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return EmulatorError(f"{type(error).__name__}: {error}")
    return error
