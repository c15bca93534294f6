"""Sockets in the loop, and the connection of a client.

A socket never blocks; what the kernel does not take waits in an outbox. A package is sent whole, or not.
"""

from __future__ import annotations

import selectors
import socket
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from pathlib import Path

from ur_emulator.budgets import BUDGETS
from ur_emulator.host.runtime.barrier import Report, guarded
from ur_emulator.host.runtime.event_loop import EventLoop


class BufferedSocket(ABC):
    """One end of a connection; what arrives and what ends it is for those who derive from it.

    Attributes:
        is_open: bytes can be received, until either side closes.
        can_send: False as soon as it is known that the peer is gone; what it has sent may still be read.
        n_taken: how many bytes the kernel has taken.
    """

    def __init__(self, loop: EventLoop, outbox_limit: int, read_size: int) -> None:
        """Prepare; there is no socket yet.

        `outbox_limit` bytes may wait for a peer that does not read; `read_size` are taken from it in a turn.
        """
        self._loop = loop
        self._outbox_limit = outbox_limit
        self._read_size = read_size
        self._sock: socket.socket | None = None
        self._outbox = bytearray()
        self.can_send = False
        self._wants_data = True
        self.is_open = False
        self.n_taken = 0

    def send(self, data: bytes) -> bool:
        """Send what the kernel takes at once, keep the rest for later; all of it or nothing.

        False if it was dropped: the outbox is full, or the peer takes nothing any more.
        """
        if not self.can_send:
            return False
        if self._outbox:
            if len(self._outbox) + len(data) > self._outbox_limit:
                return False
            self._outbox += data
            return True
        assert self._sock is not None
        try:
            sent = self._sock.send(data)
        except BlockingIOError:
            sent = 0
        except OSError:
            self._send_failed()
            return False
        self.n_taken += sent
        if sent < len(data):
            self._outbox += data[sent:]
            self._watch()
        return True

    def close(self) -> None:
        """Close at once; harmless if closed already. What the kernel has taken is still delivered."""
        if self._sock is not None:
            self._loop.unwatch(self._sock)
            self._sock.close()
            self._sock = None
        self._outbox.clear()
        self.is_open = self.can_send = False

    @abstractmethod
    def failed(self, error: Exception) -> None:
        """End after an error of ours in what the socket has caused."""

    def _open(self, sock: socket.socket) -> None:
        """Begin with a connected, non-blocking socket."""
        if sock.family != socket.AF_UNIX:
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._sock = sock
        self.is_open = self.can_send = True
        self._watch()

    @abstractmethod
    def _received(self, data: bytes) -> None:
        """Take what has arrived."""

    def _ended(self) -> None:
        """The peer sends nothing more."""
        self.close()

    def _send_failed(self) -> None:
        """The peer takes nothing any more."""
        self.close()

    def _watch(self) -> None:
        """Register with the loop what the socket waits for at present."""
        assert self._sock is not None
        events = selectors.EVENT_READ if self._wants_data else 0
        if self._outbox:
            events |= selectors.EVENT_WRITE
        if events:
            self._loop.watch(self._sock, events, self._on_ready, self.failed)
        else:
            self._loop.unwatch(self._sock)

    def _on_ready(self, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            self._flush()
        if events & selectors.EVENT_READ and self._sock is not None:
            try:
                data = self._sock.recv(self._read_size)
            except BlockingIOError:
                return
            except OSError:
                self.close()
                return
            if data:
                self._received(data)
            else:
                self._ended()

    def _flush(self) -> None:
        assert self._sock is not None
        try:
            sent = self._sock.send(self._outbox)
        except BlockingIOError:
            return
        except OSError:
            self._send_failed()
            return
        self.n_taken += sent
        del self._outbox[:sent]
        if not self._outbox:
            self._watch()


# Kernel buffer for sending: small, so that a slow reader gets fresh data and a silent one costs little
# memory.
SEND_BUFFER = 64 * 1024
# A peer that is silent is asked whether it is still there, first after a minute; one that lost its power or
# its cable is forgotten after two. Where the system has no such options, after two hours.
_KEEP_ALIVE = [
    (getattr(socket, name), value)
    for name, value in (("TCP_KEEPIDLE", 60), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 6))
    if hasattr(socket, name)
]


class Connection(BufferedSocket):
    """A connected client.

    Attributes:
        on_data: called with what has come.
        peer: address of the client, for logs.
        dropped: packages that were dropped because the client did not read.
        has_ended: the client has closed its sending side, see `allow_half_close`.
    """

    def __init__(
        self,
        loop: EventLoop,
        sock: socket.socket,
        on_data: Callable[[Connection, bytes], None],
        on_close: Callable[[Connection], None],
        backlog: set[Connection],
        report: Report,
    ) -> None:
        """Take over a connected socket.

        Args:
            sock: connected; becomes non-blocking and belongs to this object.
            on_data: called with what has come.
            on_close: called once when the connection is gone, for whatever reason.
            backlog: the connection is in this set while something waits in its outbox.
            report: called with an error of ours in what the client has caused; it ends the connection.
        """
        super().__init__(loop, BUDGETS.outbox_bytes, BUDGETS.read_bytes)
        self.on_data = on_data
        self._on_close = on_close
        self._backlog = backlog
        self._report = report
        self._closing = False
        self._on_end: Callable[[Connection], None] | None = None
        self.dropped = 0
        self.has_ended = False
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in _KEEP_ALIVE:
            sock.setsockopt(socket.IPPROTO_TCP, option, value)
        try:
            self.peer = "{}:{}".format(*sock.getpeername()[:2])
        except OSError:
            self.peer = "gone"
        self._open(sock)

    @property
    def host(self) -> str:
        """Address of the client without its port."""
        return self.peer.rpartition(":")[0]

    @property
    def has_read(self) -> bool:
        """False if it is known that the client has not read anything yet."""
        waiting = None if self._sock is None else _bytes_on_the_way(self._sock)
        return waiting is None or waiting < self.n_taken

    def call_soon(self, call: Callable[[], None]) -> None:
        """Run `call` when this client has its next turn."""
        self._loop.call_soon(call, self.failed)

    def set_reading(self, wanted: bool) -> None:
        """Read on, or leave what comes with the system; no effect once either side has closed."""
        if self.is_open and not self.has_ended and wanted != self._wants_data:
            self._wants_data = wanted
            self._watch()

    def allow_half_close(self, on_end: Callable[[Connection], None]) -> None:
        """Stay open when the client closes its sending side: it may still read. The owner closes then.

        `on_end` is called once, when that happens.
        """
        self._on_end = on_end

    def send(self, package: bytes) -> bool:
        """Send a package, whole or not at all: False if the outbox is full or the connection is closed."""
        is_sent = super().send(package)
        if self._outbox:
            self._backlog.add(self)
            self.dropped += not is_sent
        return is_sent

    def close_when_sent(self) -> None:
        """Close as soon as the outbox is empty."""
        self._closing = True
        if not self._outbox:
            self.close()

    def close(self) -> None:
        """Close at once; harmless if closed already."""
        if self.is_open:
            super().close()
            self._backlog.discard(self)
            guarded(partial(self._report, f"{self.peer} is not forgotten"), self._on_close, self)

    def failed(self, error: Exception) -> None:
        """Close after an error of ours in what the client has caused, and report it."""
        self._report(f"{self.peer} is disconnected", error)
        self.close()

    def _received(self, data: bytes) -> None:
        self.on_data(self, data)

    def _ended(self) -> None:
        if self._on_end is None:
            self.close()
            return
        self.has_ended = True
        self._wants_data = False
        self._watch()
        self._on_end(self)

    def _send_failed(self) -> None:
        """Send nothing more. What the peer sent before it went is still read; then it is closed.

        Without this, a script is lost when its sender closes the socket at once, as many do.
        """
        self.can_send = False
        self._outbox.clear()
        self._sent()
        if self.is_open:
            self._watch()

    def _flush(self) -> None:
        super()._flush()
        if not self._outbox:
            self._sent()

    def _sent(self) -> None:
        self._backlog.discard(self)
        if self._closing:
            self.close()


def _bytes_on_the_way(sock: socket.socket) -> int | None:
    """Return how many bytes that were sent the peer has not read; None where the system does not say.

    Linux lists both ends of a connection within a machine. Source: proc(5).
    """
    try:
        here, there = (
            f"{int.from_bytes(socket.inet_aton(host), sys.byteorder):08X}:{port:04X}"
            for host, port in (sock.getsockname(), sock.getpeername())
        )
        rows = (row.split(maxsplit=5) for row in Path("/proc/net/tcp").read_text().splitlines())
        queues = {(row[1], row[2]): row[4].split(":") for row in rows}
        return int(queues[here, there][0], 16) + int(queues[there, here][1], 16)
    except (OSError, ValueError, LookupError):
        return None
