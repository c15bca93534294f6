"""One TCP connection of a client: packages are sent whole or not at all."""

from __future__ import annotations

import socket
from collections.abc import Callable
from functools import partial

from ur_emulator.budgets import BUDGETS
from ur_emulator.realtime.barrier import Report, guarded
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.servers.tcp.buffered_socket import BufferedSocket

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
            loop: watches the socket.
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
    def takes_answers(self) -> bool:
        """False as soon as it is known that the client is gone; what it has sent may still be read."""
        return self._can_send

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

        Args:
            on_end: called once, when that happens.
        """
        self._on_end = on_end

    def send(self, package: bytes) -> bool:
        """Send a package, whole or not at all.

        Returns:
            False if the package was dropped: the outbox is full or the connection is closed.
        """
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
        self._can_send = False
        self._outbox.clear()
        self._sent()
        if self.is_open:
            self._watch()

    def _sent(self) -> None:
        self._backlog.discard(self)
        if self._closing:
            self.close()
