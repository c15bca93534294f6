"""A TCP socket in the loop: it never blocks, and what the kernel does not take waits in an outbox."""

from __future__ import annotations

import selectors
import socket
from abc import ABC, abstractmethod

from ur_emulator.realtime.event_loop import EventLoop


class BufferedSocket(ABC):
    """One end of a connection; what arrives and what ends it is for those who derive from it.

    Attributes:
        is_open: bytes can be received, until either side closes.
    """

    def __init__(self, loop: EventLoop, outbox_limit: int, read_size: int) -> None:
        """Prepare; there is no socket yet.

        Args:
            loop: watches the socket.
            outbox_limit: bytes that may wait for a peer that does not read.
            read_size: bytes taken from the peer in a turn of the loop.
        """
        self._loop = loop
        self._outbox_limit = outbox_limit
        self._read_size = read_size
        self._sock: socket.socket | None = None
        self._outbox = bytearray()
        self._can_send = False
        self._wants_data = True
        self.is_open = False

    def send(self, data: bytes) -> bool:
        """Send what the kernel takes at once, keep the rest for later; all of it or nothing.

        Returns:
            False if it was dropped: the outbox is full, or the peer takes nothing any more.
        """
        if not self._can_send:
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
        self.is_open = self._can_send = False

    @abstractmethod
    def failed(self, error: Exception) -> None:
        """End after an error of ours in what the socket has caused."""

    def _open(self, sock: socket.socket) -> None:
        """Begin with a connected, non-blocking socket."""
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._sock = sock
        self.is_open = self._can_send = True
        self._watch()

    @abstractmethod
    def _received(self, data: bytes) -> None:
        """Take what has arrived."""

    @abstractmethod
    def _ended(self) -> None:
        """The peer sends nothing more."""

    @abstractmethod
    def _send_failed(self) -> None:
        """The peer takes nothing any more."""

    @abstractmethod
    def _sent(self) -> None:
        """The outbox is empty again."""

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
        del self._outbox[:sent]
        if not self._outbox:
            self._watch()
            self._sent()
