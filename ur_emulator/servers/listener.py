"""A listening port: accepts clients and hands each to the port that it belongs to."""

from __future__ import annotations

import selectors
import socket
from collections.abc import Callable
from typing import Protocol

from ur_emulator.errors import PortError, PortPermissionError
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.servers.connection import Connection

_BACKLOG = 128


class Port(Protocol):
    """What a port does with its clients."""

    def opened(self, connection: Connection) -> None:
        """A client has connected."""
        ...

    def received(self, connection: Connection, data: bytes) -> None:
        """A client has sent something."""
        ...

    def closed(self, connection: Connection) -> None:
        """A client is gone."""
        ...


class Listener:
    """Accepts the clients of one port."""

    def __init__(
        self,
        loop: EventLoop,
        host: str,
        number: int,
        port: Port,
        backlog: set[Connection],
        notice: Callable[[str], None],
        name: str,
    ) -> None:
        """Listen.

        Args:
            loop: watches the sockets.
            host: address to bind to.
            number: TCP port; 0 takes a free one.
            port: gets the clients.
            backlog: shared by all connections of a box, see Connection.
            notice: told who comes and goes.
            name: of the port, for notices.

        Raises:
            PortPermissionError: this user may not open ports below 1024.
            PortError: the address cannot be bound.
        """
        self._loop = loop
        self._port = port
        self._backlog = backlog
        self._notice = notice
        self._name = name
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._sock = socket.socket(family, socket.SOCK_STREAM)
        try:
            self._sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._sock.bind((host, number))
            self._sock.listen(_BACKLOG)
        except PermissionError:
            self._sock.close()
            raise PortPermissionError(
                f"port {number} on {host} needs privileges; move all ports with --port-base N if you need it"
            ) from None
        except OSError as error:
            self._sock.close()
            raise PortError(
                f"cannot listen on {host}:{number} ({error.strerror or error}); "
                "stop what uses it, or move all ports with --port-base N"
            ) from None
        self._sock.setblocking(False)
        self.number: int = self._sock.getsockname()[1]
        loop.watch(self._sock, selectors.EVENT_READ, self._accept)

    def close(self) -> None:
        """Stop listening; connected clients stay."""
        self._loop.unwatch(self._sock)
        self._sock.close()

    def _accept(self, events: int) -> None:
        try:
            client, _ = self._sock.accept()
        except OSError:
            return  # the client has gone again, or descriptors are out: the next one may have more luck
        connection = Connection(self._loop, client, self._port.received, self._closed, self._backlog)
        self._notice(f"{connection.peer} connected to {self._name} port {self.number}")
        self._port.opened(connection)

    def _closed(self, connection: Connection) -> None:
        self._port.closed(connection)
        self._notice(f"{connection.peer} disconnected from {self._name} port {self.number}")
