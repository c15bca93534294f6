"""One TCP connection of a client: it never blocks, its outbox is bounded, and packages stay whole."""

from __future__ import annotations

import selectors
import socket
from collections import deque
from collections.abc import Callable

from ur_emulator.realtime.event_loop import EventLoop

# Bytes that may wait for a client that does not read; further packages are dropped for it.
OUTBOX_LIMIT = 64 * 1024
# Kernel buffer for sending: small, so that a slow reader gets fresh data and a silent one costs little
# memory.
SEND_BUFFER = 64 * 1024
# Bytes taken from a client in a turn of the loop: 64 KiB of script lines would hold up a cycle for 100 ms.
_READ_SIZE = 8 * 1024
# A peer that is silent is asked whether it is still there, first after a minute; one that lost its power or
# its cable is forgotten after two. Where the system has no such options, after two hours.
_KEEP_ALIVE = [
    (getattr(socket, name), value)
    for name, value in (("TCP_KEEPIDLE", 60), ("TCP_KEEPINTVL", 10), ("TCP_KEEPCNT", 6))
    if hasattr(socket, name)
]


class Connection:
    """A connected client.

    Attributes:
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
    ) -> None:
        """Take over a connected socket.

        Args:
            loop: watches the socket.
            sock: connected; becomes non-blocking and belongs to this object.
            on_data: called with what has come.
            on_close: called once when the connection is gone, for whatever reason.
            backlog: the connection is in this set while something waits in its outbox.
        """
        self._loop = loop
        self._sock = sock
        self._on_data = on_data
        self._on_close = on_close
        self._backlog = backlog
        self._outbox: deque[memoryview] = deque()
        self._pending = 0
        self._closing = False
        self._deaf = False
        self._open = True
        self._reading = selectors.EVENT_READ
        self._on_end: Callable[[Connection], None] | None = None
        self.dropped = 0
        self.has_ended = False
        sock.setblocking(False)
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for option, value in _KEEP_ALIVE:
            sock.setsockopt(socket.IPPROTO_TCP, option, value)
        try:
            self.peer = "{}:{}".format(*sock.getpeername()[:2])
        except OSError:
            self.peer = "gone"
        loop.watch(sock, selectors.EVENT_READ, self._on_ready)

    @property
    def is_open(self) -> bool:
        """True until the connection is closed by either side."""
        return self._open

    @property
    def host(self) -> str:
        """Address of the client without its port."""
        return self.peer.rpartition(":")[0]

    def allow_half_close(self, on_end: Callable[[Connection], None]) -> None:
        """Stay open when the client closes its sending side: it may still read. The owner closes then.

        Args:
            on_end: called once, when that happens.
        """
        self._on_end = on_end

    def send(self, package: bytes) -> bool:
        """Send a package, whole or not at all.

        Returns:
            False if the package was dropped: the outbox is full or the connection is closed.
        """
        if not self._open or self._deaf:
            return False
        if self._pending:
            if self._pending + len(package) > OUTBOX_LIMIT:
                self.dropped += 1
                return False
            self._queue(memoryview(package))
            return True
        try:
            sent = self._sock.send(package)
        except BlockingIOError:
            sent = 0
        except OSError:
            self._stop_sending()
            return False
        if sent < len(package):
            self._queue(memoryview(package)[sent:])
            self._loop.watch(self._sock, self._reading | selectors.EVENT_WRITE, self._on_ready)
        return True

    def close_when_sent(self) -> None:
        """Close as soon as the outbox is empty."""
        self._closing = True
        if not self._pending:
            self.close()

    def close(self) -> None:
        """Close at once; harmless if closed already."""
        if self._open:
            self._open = False
            self._loop.unwatch(self._sock)
            self._sock.close()
            self._outbox.clear()
            self._pending = 0
            self._backlog.discard(self)
            self._on_close(self)

    def _stop_sending(self) -> None:
        """The peer takes nothing any more. What it sent before it went is still read; then it is closed.

        Without this, a script is lost when its sender closes the socket at once, as many do.
        """
        self._deaf = True
        self._outbox.clear()
        self._pending = 0
        self._backlog.discard(self)
        if self._closing:
            self.close()
        else:
            self._watch_for_data()

    def _watch_for_data(self) -> None:
        if self._reading:
            self._loop.watch(self._sock, self._reading, self._on_ready)
        else:
            self._loop.unwatch(self._sock)

    def _queue(self, data: memoryview) -> None:
        self._outbox.append(data)
        self._pending += len(data)
        self._backlog.add(self)

    def _on_ready(self, events: int) -> None:
        if events & selectors.EVENT_WRITE:
            self._flush()
        if events & selectors.EVENT_READ and self._open:
            self._receive()

    def _receive(self) -> None:
        try:
            data = self._sock.recv(_READ_SIZE)
        except BlockingIOError:
            return
        except OSError:
            self.close()
            return
        if data:
            self._on_data(self, data)
        elif self._on_end is None:
            self.close()
        else:
            self.has_ended = True
            self._reading = 0
            self._loop.unwatch(self._sock)
            if self._pending:
                self._loop.watch(self._sock, selectors.EVENT_WRITE, self._on_ready)
            self._on_end(self)

    def _flush(self) -> None:
        try:
            while self._outbox:
                data = self._outbox[0]
                sent = self._sock.send(data)
                self._pending -= sent
                if sent < len(data):
                    self._outbox[0] = data[sent:]
                    return
                self._outbox.popleft()
        except BlockingIOError:
            return
        except OSError:
            self._stop_sending()
            return
        self._backlog.discard(self)
        if self._closing:
            self.close()
        else:
            self._watch_for_data()
