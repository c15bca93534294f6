"""A listening port: accepts clients and hands each to the port that it belongs to.

A page in a browser may send a request to any port of its machine, and lines of its choice after the head:
such a client is closed before anything of it is read, unless the port itself takes no harm.

Clients beyond the limits of a box (`ClientLimits`), and those for whom the process has no descriptor left are
accepted and closed at once, so that they notice it; connected clients are not disturbed. The limits of a real
controller are not known.
"""

import errno
import math
import os
import re
import selectors
import socket
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Protocol

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import PortError, PortPermissionError
from ur_emulator.host.runtime.barrier import Report, guarded
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.runtime.event_loop import EventLoop


class SpareDescriptor:
    """A descriptor that is released for a moment when no other is left: to refuse a client needs one."""

    def __init__(self) -> None:
        self._descriptor: int | None = None

    def take(self) -> None:
        """Take a descriptor, if there is one; harmless if it is held already."""
        if self._descriptor is None:
            with suppress(OSError):
                self._descriptor = os.open(os.devnull, os.O_RDONLY)

    def refuse_client(self, listening: socket.socket) -> bool:
        """Accept the next client of a listening socket and close it at once; False if no client waits.

        Without descriptors, the system does not look before it refuses. OSError: another thread or process
        took the descriptor first.
        """
        self.close()
        try:
            listening.accept()[0].close()
        except BlockingIOError:
            return False
        finally:
            self.take()
        return True

    def close(self) -> None:
        """Release the descriptor."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


class ClientLimits:
    """Counts the clients of a box by their addresses and ports, and refuses those beyond its limits."""

    def __init__(self) -> None:
        self._taken: Counter[tuple[str | int, ...]] = Counter()

    def take(self, host: str, port: int) -> str:
        """Count a client that has connected to a port; return "", or which limit stands against it."""
        for key, limit, what in _limits(host, port):
            if self._taken[key] >= limit:
                return f"{limit} clients{what} are the most"
        self._taken.update(key for key, _, _ in _limits(host, port))
        return ""

    def release(self, host: str, port: int) -> None:
        """Forget a client that is gone."""
        self._taken -= Counter(key for key, _, _ in _limits(host, port))  # what is at 0 goes


def _limits(host: str, port: int) -> tuple[tuple[tuple[str | int, ...], int, str], ...]:
    return (
        ((host, port), BUDGETS.clients_of_port, f" of {host} at this port"),
        ((host,), BUDGETS.clients_of_address, f" of {host}"),
        ((), BUDGETS.clients, ""),
    )


# The start of a request over HTTP; no script, no command of the dashboard and no package begins so.
# GET without a path is a request of a gripper's port, too.
_WEB_REQUEST = re.compile(rb"GET /|(HEAD|POST|PUT|PATCH|DELETE|OPTIONS|CONNECT|TRACE) ")
# Buffer of the system for what a client sends and the box has not read yet.
RECEIVE_BUFFER = 64 * 1024
# How long not to listen when a client can be neither accepted nor refused [s].
PAUSE = 0.1
# Errors of accept() that mean that this process or system has nothing left, not that the client has gone.
_EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}


class Port(Protocol):
    """What a port does with its clients."""

    def opened(self, connection: Connection) -> None:
        """A client has connected."""

    def received(self, connection: Connection, data: bytes) -> None:
        """A client has sent something."""

    def closed(self, connection: Connection) -> None:
        """A client is gone, also one with which `opened` has failed."""


class Listener:
    """Accepts the clients of one port.

    Attributes:
        connections: to the clients that are connected.
    """

    def __init__(
        self,
        loop: EventLoop,
        host: str,
        number: int,
        port: Port,
        backlog: set[Connection],
        notice: Callable[[str], None],
        report: Report,
        name: str,
        limits: ClientLimits,
        spare: SpareDescriptor,
        *,
        reads_http: bool = False,
    ) -> None:
        """Listen.

        Args:
            number: TCP port; 0 takes a free one.
            port: gets the clients.
            backlog: shared by all connections of a box, see Connection.
            notice: called with a text when a client connects or disconnects.
            report: called with an error of ours and what it has ended.
            limits: of the box, for its clients.
            spare: refuses clients when no descriptor is left.
            reads_http: the port answers or refuses requests of browsers itself.

        Raises:
            PortPermissionError: this user may not open ports below 1024.
            PortError: the address cannot be bound.
        """
        self._loop = loop
        self._port = port
        self._backlog = backlog
        self._notice = notice
        self._report = report
        self._name = name
        self._limits = limits
        self._spare = spare
        self._reads_http = reads_http
        self._refuses = False
        self._sock = _listening_socket(host, number)
        self.connections: dict[Connection, None] = {}
        self.number: int = self._sock.getsockname()[1]
        self._listen()

    @property
    def clients(self) -> list[str]:
        """Address of each client, and the port, for people."""
        return [f"{connection.peer} at {self._name} {self.number}" for connection in self.connections]

    def close(self) -> None:
        """Stop listening, and close all connections."""
        self._loop.unwatch(self._sock)
        self._sock.close()
        for connection in tuple(self.connections):
            connection.close()

    def failed(self, error: Exception) -> None:
        """Pause after an error of ours in accepting clients."""
        self._report(f"{self._name} port {self.number} pauses", error)
        self._pause()

    def _accept(self, events: int) -> None:
        for _ in range(BUDGETS.accepted_at_once):
            try:
                client, address = self._sock.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno not in _EXHAUSTED:
                    continue  # this client has closed its end already
                self._refuse_next(error)
                return
            why_not = self._limits.take(address[0], self.number)
            if why_not:
                client.close()
                self._refused(why_not)
                continue
            self._refuses = False
            try:
                connection = Connection(
                    self._loop,
                    client,
                    self._port.received if self._reads_http else self._begin,
                    partial(self._closed, address[0]),
                    self._backlog,
                    self._report,
                )
            except OSError:
                client.close()  # closed by the client; some systems report it only now
                self._limits.release(address[0], self.number)
                continue
            self.connections[connection] = None
            self._notice(f"{connection.peer} connected to {self._name} port {self.number}")
            guarded(connection.failed, self._port.opened, connection)

    def _begin(self, connection: Connection, data: bytes) -> None:
        """Take the first bytes of a client, unless a page in a browser has sent them."""
        if _WEB_REQUEST.match(data):
            self._notice(f"{connection.peer} is a browser, which {self._name} port {self.number} is not for")
            connection.close()
        else:
            connection.on_data = self._port.received
            self._port.received(connection, data)

    def _refuse_next(self, error: OSError) -> None:
        """Close the next client, or pause: the port stays readable, the loop would spin."""
        try:
            is_refused = self._spare.refuse_client(self._sock)
        except OSError:
            self._pause()
            is_refused = True
        if is_refused:
            self._refused(str(error.strerror))

    def _refused(self, why: str) -> None:
        """Write one line for all clients that are refused one after the other."""
        if not self._refuses:
            self._refuses = True
            self._notice(f"clients are turned away from {self._name} port {self.number}: {why}")

    def _pause(self) -> None:
        self._loop.unwatch(self._sock)
        self._loop.call_later(PAUSE, self._listen, self.failed)

    def _listen(self) -> None:
        if self._sock.fileno() >= 0:  # it may have been closed in a pause
            self._loop.watch(self._sock, selectors.EVENT_READ, self._accept, self.failed)

    def _closed(self, host: str, connection: Connection) -> None:
        del self.connections[connection]
        self._limits.release(host, self.number)
        self._port.closed(connection)
        self._notice(f"{connection.peer} disconnected from {self._name} port {self.number}")


def _listening_socket(host: str, number: int) -> socket.socket:
    sock = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)  # its clients inherit it
        sock.bind((host, number))
        sock.listen(socket.SOMAXCONN)
    except OSError as error:
        sock.close()
        if isinstance(error, PermissionError):
            raise PortPermissionError(
                f"port {number} on {host} needs privileges; move all ports with --port-base N if you need it"
            ) from None
        if isinstance(error, socket.gaierror):
            raise PortError(
                f"cannot listen on {host}: no such name or address is known; take one of this machine's own, "
                "127.0.0.1 keeps other machines out"
            ) from None
        if error.errno == errno.EADDRNOTAVAIL:
            raise PortError(
                f"cannot listen on {host}:{number}: {host} is not an address of this machine; "
                "take one of its own, or add it (on macOS: sudo ifconfig lo0 alias ADDRESS)"
            ) from None
        raise PortError(
            f"cannot listen on {host}:{number} ({error.strerror or error}); "
            "stop what uses it, or move all ports with --port-base N"
        ) from None
    sock.setblocking(False)
    return sock


_WINDOW = 60.0  # s


class ClientLines:
    """Writes so many lines a minute about clients into the log: a storm of them must not empty it.

    The others are counted. The clock is monotonic [s]; also where the time of the box stands still, clients
    come and go.
    """

    def __init__(self, write: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        self._write = write
        self._clock = clock
        self._began = -math.inf
        self._n = 0

    def write(self, text: str) -> None:
        """Write a line, unless there were too many in this minute."""
        now = self._clock()
        if now - self._began >= _WINDOW:
            left_out = self._n - BUDGETS.client_lines
            self._began, self._n = now, 0
            if left_out > 0:
                self._write(f"{left_out} lines about clients that came and went were left out")
        self._n += 1
        if self._n <= BUDGETS.client_lines:
            self._write(text)
        elif self._n == BUDGETS.client_lines + 1:
            self._write(
                f"clients come and go: beyond {BUDGETS.client_lines} lines a minute they are left out"
            )
