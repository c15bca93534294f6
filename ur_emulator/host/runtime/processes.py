"""Processes beside this one: boxes and workers, forked by a server process that has loaded their code.

A process that needs some starts one server. A child has two sockets to the process that asked for it. `pipe`
carries messages, each with its length in front. `life` is held by the server: a byte or its end ends the
child, and the exit code of the child comes through it. So children end with the process that asked for them,
however that ends, also children that are stopped. The server and its children are in a session of their own,
where Ctrl-C does not reach them.
"""

from __future__ import annotations

import atexit
import gc
import importlib
import os
import resource
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
import weakref
from abc import abstractmethod
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final, NoReturn, cast

from ur_emulator.host.runtime.connection import BufferedSocket
from ur_emulator.host.runtime.event_loop import EventLoop

# Bytes of the length in front of a message, big-endian.
_HEAD: Final = 8
_READ_SIZE: Final = 1 << 18
# Bytes of what the server tells of a child: its number, then its exit code.
_NUMBER: Final = 4
_KILL: Final = b"k"
_PAGE: Final = resource.getpagesize()
# How long a process that ends waits for its server [s].
_FAREWELL: Final = 2.0
_COMMAND: Final = (
    "import sys; sys.path[:] = {path!r}\n"
    "from ur_emulator.host.runtime.processes import serve_forks; serve_forks()"
)


# What a child does: the byte that asks for it, and its module. That has `prepare`, which the server calls
# once before it forks, `run(pipe)`, the main function of the child, `clean_up`, which the server calls when a
# child has ended in another way, and `GRACE`: how long a child may take to end when the other end of its life
# is gone [s].
WORKER: Final = b"w"
BOX: Final = b"b"
_MODULES: Final = {WORKER: "ur_emulator.host.runtime.worker", BOX: "ur_emulator.host.box_process"}


def framed(message: bytes) -> bytes:
    """Return a message as it goes through a pipe."""
    return len(message).to_bytes(_HEAD, "big") + message


def read_message(pipe: socket.socket) -> bytes:
    """Wait for the next message from a blocking pipe; EOFError if the other end was closed."""
    return _read(pipe, int.from_bytes(_read(pipe, _HEAD), "big"))


def _read(pipe: socket.socket, size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        if not (part := pipe.recv(size - len(data))):
            raise EOFError
        data += part
    return bytes(data)


class Pipe(BufferedSocket):
    """A pipe in a loop: nothing waits; it closes when the other end is gone. `take` gets whole messages."""

    def __init__(self, loop: EventLoop, sock: socket.socket) -> None:
        super().__init__(loop, sys.maxsize, _READ_SIZE)
        self._inbox = bytearray()
        sock.setblocking(False)
        self._open(sock)

    @abstractmethod
    def take(self, message: bytes) -> None:
        """Take a message."""

    def _received(self, data: bytes) -> None:
        self._inbox += data
        while len(self._inbox) >= (end := _HEAD + int.from_bytes(self._inbox[:_HEAD], "big")):
            message = bytes(memoryview(self._inbox)[_HEAD:end])
            del self._inbox[:end]
            self.take(message)


def resident(process: int | str = "self") -> int:
    """Return what a process has in memory [bytes]; 0 where the system does not tell."""
    try:
        with open(f"/proc/{process}/statm", "rb") as file:
            return int(file.read().split()[1]) * _PAGE
    except OSError:
        return 0


def limit_memory(allowed: int) -> None:
    """Limit the data of this process to what it has and so many bytes more, where the system tells it."""
    with suppress(OSError, ValueError), open("/proc/self/statm", "rb") as file:
        limit = int(file.read().split()[5]) * _PAGE + allowed
        resource.setrlimit(resource.RLIMIT_DATA, (limit, resource.getrlimit(resource.RLIMIT_DATA)[1]))


def is_stopped(process: int) -> bool:
    """Return whether a process is stopped, as by SIGSTOP; False where the system does not tell."""
    try:
        with open(f"/proc/{process}/stat", "rb") as file:
            return file.read().rpartition(b") ")[2][:1] == b"T"
    except OSError:
        return False


# --- in the process that asks


class Child:
    """A child, as the process that asked for it sees it.

    Attributes:
        pipe: the socket for messages.
        life: becomes readable when the child has begun and when it has ended: then `look`.
        pid: its number, None before it has begun.
        exit_code: negative for a signal, None if it has not ended or nobody knows it.
    """

    def __init__(self, pipe: socket.socket, life: socket.socket) -> None:
        self.pipe = pipe
        self.life = life
        self.pid: int | None = None
        self.exit_code: int | None = None
        _children.add(self)

    def kill(self) -> None:
        """Let the child end at once; it has ended when `life` becomes readable."""
        with suppress(OSError):
            self.life.send(_KILL)

    def look(self) -> bool:
        """Take what `life` tells, perhaps wait for it; return whether the child has ended."""
        try:
            data = self.life.recv(_NUMBER, socket.MSG_WAITALL)
        except OSError:
            data = b""
        number = int.from_bytes(data, "big", signed=True)
        if len(data) == _NUMBER and self.pid is None:
            self.pid = number
            return False
        self.exit_code = number if data else None
        return True

    def wait(self) -> None:
        """Wait for the end."""
        while not self.look():
            pass

    @property
    def end(self) -> str:
        """How it has ended, for people; `exit_code` must be known."""
        code = self.exit_code
        assert code is not None
        how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
        return f"was ended {how}"

    def close(self) -> None:
        """Let go of the child: it ends if it has not."""
        with suppress(OSError):
            self.pipe.shutdown(socket.SHUT_RDWR)  # also for a thread that reads
        self.forget()

    def forget(self) -> None:
        """Close the sockets of this process; the child may have others that ask it for something."""
        self.pipe.close()
        self.life.close()


def start_child(role: bytes) -> Child:
    """Start a child; OSError if it cannot be started."""
    pipe, its_pipe = socket.socketpair()
    life, its_life = socket.socketpair()
    try:
        _ask(role, (its_pipe.fileno(), its_life.fileno()))
        return Child(pipe, life)
    except OSError:
        pipe.close()
        life.close()
        raise
    finally:
        its_pipe.close()
        its_life.close()


def prepare_workers() -> None:
    """Let the server load the code of workers now; a server that cannot be started is no error yet."""
    with suppress(OSError):
        _ask(WORKER, ())


class _Server:
    """The server of this process; in a box process it is the parent, and `process` is None."""

    def __init__(self, channel: socket.socket, process: subprocess.Popen[bytes] | None = None) -> None:
        self.channel = channel
        self.process = process

    @classmethod
    def start(cls) -> _Server:
        """Start one; OSError if there is no process or no descriptor to be had."""
        channel, other = socket.socketpair()
        with other:
            try:
                process = subprocess.Popen(
                    [sys.executable, "-c", _COMMAND.format(path=sys.path)],
                    stdin=other.fileno(),
                    stdout=subprocess.DEVNULL,
                    start_new_session=True,
                    # A box computes with small matrices only; a fork must not have threads.
                    env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "MUJOCO_GL": "disabled"},
                )
            except OSError:
                channel.close()
                raise
        return cls(channel, process)

    @property
    def has_ended(self) -> bool:
        """Whether it is gone; for a moment afterwards, a child that it has just forked holds its channel."""
        return self.process is not None and self.process.poll() is not None

    def end(self) -> None:
        """Let it end with all its children, and wait for that, for a moment."""
        self.channel.close()
        if self.process is not None:
            try:
                self.process.wait(_FAREWELL)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


_lock = threading.Lock()
_server: _Server | None = None
_children: weakref.WeakSet[Child] = weakref.WeakSet()


def _ask(role: bytes, descriptors: tuple[int, ...]) -> None:
    """Ask the server for a child, or, without descriptors, to load what one needs."""
    global _server
    with _lock:
        if _server is not None and not _server.has_ended:
            # A child must not close the channel to a server that lives, which would take that for its end.
            with suppress(BrokenPipeError, ConnectionResetError):
                socket.send_fds(_server.channel, [role], descriptors)
                return
        if _server is not None:
            _server.end()
            _server = None  # also if none can be started
        _server = _Server.start()
        socket.send_fds(_server.channel, [role], descriptors)


@atexit.register
def _end_server() -> None:
    global _server
    server, _server = _server, None
    for child in tuple(_children):
        child.close()
    if server is not None:
        server.end()


def _forget_server() -> None:
    """After a fork by the user: server and children belong to the parent, whose end they must notice."""
    global _server, _lock
    _lock = threading.Lock()
    if _server is not None:
        _server.channel.close()
        _server.process, _server = None, None
    for child in tuple(_children):
        child.forget()
    _children.clear()


os.register_at_fork(after_in_child=_forget_server)


# --- in the server


def serve_forks() -> None:
    """Fork children until nobody asks any more and all have ended; the main function of the server."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # where it is ignored nobody learns how a child has ended
    gc.disable()
    channel = socket.socket(fileno=os.dup(0))
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)  # else children would hold the channel
    _ForkServer(channel).run()


class _ForkServer:
    """Forks children of the process at its channel, reports how they end, ends those whose life is closed.

    Each child has a channel, too, for children of its own; the end of the channel is that of the child.
    """

    def __init__(self, channel: socket.socket) -> None:
        self._selector = selectors.DefaultSelector()
        self._lives: dict[int, tuple[bytes, socket.socket]] = {}
        # Process -> when it is killed; its life is closed [s, monotonic].
        self._doomed: dict[int, float] = {}
        self._prepared: set[bytes] = set()
        self._add_channel(channel)

    def run(self) -> None:
        """Work until nobody asks any more and all children have ended."""
        while self._selector.get_map():
            timeout = min(self._doomed.values(), default=None)
            ready = self._selector.select(None if timeout is None else max(0.0, timeout - time.monotonic()))
            for key, _ in ready:
                if self._selector.get_map().get(key.fd) is key:  # a call before it may have closed it
                    key.data()
            self._kill_doomed()

    def _add_channel(self, channel: socket.socket, child: int | None = None) -> None:
        self._selector.register(channel, selectors.EVENT_READ, partial(self._take_request, channel, child))

    def _take_request(self, channel: socket.socket, child: int | None) -> None:
        try:
            request, descriptors, _, _ = socket.recv_fds(channel, 1, 2)
        except OSError:
            request, descriptors = b"", []
        if not request:
            self._selector.unregister(channel)
            channel.close()
            if child is not None:
                self._reap(child)
            return
        if request not in self._prepared:
            self._prepared.add(request)
            self._module(request).prepare()
            gc.collect()
            gc.freeze()  # children write into fewer pages that they share
        if descriptors:
            pipe, life = (socket.socket(fileno=descriptor) for descriptor in descriptors)
            self._fork(request, pipe, life)

    def _fork(self, role: bytes, pipe: socket.socket, life: socket.socket) -> None:
        with pipe:
            channel, its_channel = socket.socketpair()
            with its_channel:
                try:
                    pid = os.fork()
                except OSError:
                    channel.close()
                    life.close()
                    return
                if not pid:
                    for sock in (channel, life):
                        sock.close()
                    self._leave()
                    _be_child(partial(self._module(role).run, pipe), its_channel)
        self._tell(life, pid)
        self._lives[pid] = role, life
        self._selector.register(life, selectors.EVENT_READ, partial(self._on_life, pid))
        self._add_channel(channel, pid)

    def _leave(self) -> None:
        """In a child: close what belongs to the server."""
        for key in tuple(self._selector.get_map().values()):
            cast(socket.socket, key.fileobj).close()
        self._selector.close()

    def _on_life(self, pid: int) -> None:
        """Who asked for a child wants its end, or has gone."""
        role, life = self._lives[pid]
        try:
            word = life.recv(1)
        except OSError:
            word = b""
        self._doomed[pid] = time.monotonic() + (0.0 if word == _KILL else self._module(role).GRACE)
        self._selector.unregister(life)

    def _kill_doomed(self) -> None:
        now = time.monotonic()
        for pid in [pid for pid, end in self._doomed.items() if end <= now]:
            del self._doomed[pid]
            os.kill(pid, signal.SIGKILL)

    def _reap(self, pid: int) -> None:
        """A child has ended; one that has only closed its channel ends now."""
        os.kill(pid, signal.SIGKILL)
        _, status = os.waitpid(pid, 0)
        role, life = self._lives.pop(pid)
        self._doomed.pop(pid, None)
        with suppress(KeyError):
            self._selector.unregister(life)
        code = os.waitstatus_to_exitcode(status)
        if code:
            self._module(role).clean_up()
        with life:
            self._tell(life, code)

    @staticmethod
    def _tell(life: socket.socket, number: int) -> None:
        with suppress(OSError):  # nobody listens any more
            life.send(number.to_bytes(_NUMBER, "big", signed=True))

    @staticmethod
    def _module(role: bytes) -> Any:
        return importlib.import_module(_MODULES[role])


def _be_child(run: Callable[[], None], channel: socket.socket) -> NoReturn:
    """Run the main function of a child; its own children come from the server that has forked it."""
    global _server
    _server = _Server(channel)
    code = 1
    try:
        run()
        code = 0
    except MemoryError:
        code = OUT_OF_MEMORY
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


# Exit code of a child that has no memory left, not even for saying so.
OUT_OF_MEMORY: Final = 77
