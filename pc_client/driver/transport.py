"""The network as the driver sees it: a few methods. Tests put a robot in memory in the place of `TcpNetwork`.

No protocol here: bytes in, bytes out, and every failure is a DriverError that names address and port.
"""

import errno
import os
import re
import select
import socket
import time

from pc_client.errors import DriverError, UnknownHostError

_RECEIVE_SIZE = 16384
"""Bytes taken at once: more than ten realtime frames, so one call shows all that is waiting."""


MOST_WAITING = 16 << 20
"""More than this never waits on one connection [bytes]: Linux keeps 6 MiB for the receiver and 4 MiB for the
sender. A peer that sends more while it is read without a pause floods us."""


NO_ROUTE = (errno.EHOSTUNREACH, errno.ENETUNREACH)
"""Nothing on the way to the address knows it: not the robot, which says nothing, but the network."""

_EAGER_TIME = 300e-6
"""How long to look again and again before sleeping [s]: twice a cycle of an emulated box in lockstep."""

_LONGEST_PAUSE = 32
"""Most waits in a row that are not tried eagerly: on a real arm that leaves one try in a quarter second."""

_HOST_AND_PORT = re.compile(r"\[.*\]:\d+|[^:]*:\d+")

_SEND_TIMEOUT = 5.0
"""A peer that takes nothing for this long [s] is gone."""


class PortTakenError(DriverError):
    """Another program listens on the port."""


class TcpTransport:
    """A connected TCP socket without Nagle's delay.

    A robot that answers within a fraction of a millisecond, as an emulated one in lockstep, is polled:
    a blocking wait would take longer than the answer. `EagerWait` measures whether polling helps.

    Attributes:
        peer_address: the other end's address.
    """

    def __init__(self, connected: socket.socket, peer_address: str, name: str) -> None:
        connected.setblocking(False)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket = connected
        self.peer_address = peer_address
        self._name = name
        self._eager = EagerWait()

    @property
    def local_address(self) -> str:
        """Our end's address, as the other end sees it."""
        return str(self._socket.getsockname()[0])

    def send(self, data: bytes) -> None:
        """Send everything; DriverError if the connection is gone, or the peer takes nothing any more.

        The connection is closed then: the next message would be read as the rest of the one that was cut.
        """
        left = memoryview(data)
        try:
            while left:
                try:
                    left = left[self._socket.send(left) :]
                except BlockingIOError as full:
                    if not select.select((), (self._socket,), (), _SEND_TIMEOUT)[1]:
                        raise OSError(f"the other end took nothing for {_SEND_TIMEOUT:g} s") from full
        except (OSError, ValueError) as error:
            self.close()
            raise DriverError(f"{self._name}: cannot send, {_reason(error)}") from error

    def receive(self, timeout: float) -> bytes | None:
        """Bytes that arrived, b"" at the end of the stream, None when nothing came for `timeout` seconds.

        Raises:
            DriverError: the connection broke.
        """
        receive = self._socket.recv
        try:
            if timeout > 0.0 and self._eager.pays:
                end = time.perf_counter() + _EAGER_TIME
                while True:
                    try:
                        data = receive(_RECEIVE_SIZE)
                    except BlockingIOError:
                        if time.perf_counter() > end:
                            self._eager.failed()
                            break
                    else:
                        self._eager.succeeded()
                        return data
            if timeout > 0.0:
                select.select((self._socket,), (), (), timeout)
            return receive(_RECEIVE_SIZE)
        except BlockingIOError:
            return None
        except (OSError, ValueError) as error:
            raise DriverError(f"{self._name}: {_reason(error)}") from error

    def close(self) -> None:
        """Close; harmless when closed."""
        self._socket.close()


class EagerWait:
    """Measures whether polling helps: after each failure the next try comes later."""

    def __init__(self) -> None:
        self._pause = 1
        self._skip = 0

    @property
    def pays(self) -> bool:
        """Whether to try this time; each call counts as one wait."""
        if self._skip:
            self._skip -= 1
            return False
        return True

    def succeeded(self) -> None:
        """Something came in time."""
        self._pause = 1

    def failed(self) -> None:
        """Nothing came in time."""
        self._skip = self._pause
        self._pause = min(2 * self._pause, _LONGEST_PAUSE)


class TcpListener:
    """A listening TCP socket."""

    def __init__(self, listening: socket.socket) -> None:
        self._socket = listening

    @property
    def port(self) -> int:
        """The TCP port that is open."""
        return int(self._socket.getsockname()[1])

    def accept(self, timeout: float) -> TcpTransport | None:
        """The next caller, or None when there was no call for `timeout` seconds; DriverError if it cannot."""
        self._socket.settimeout(timeout)
        try:
            connected, address = self._socket.accept()
            return TcpTransport(connected, address[0], f"reverse connection from {address[0]}")
        except (TimeoutError, BlockingIOError, ConnectionError):  # nobody, or one that has gone again
            return None
        except OSError as error:
            raise DriverError(f"port {self.port} takes no calls: {_reason(error)}") from error

    def close(self) -> None:
        """Close; harmless when closed."""
        self._socket.close()


class TcpNetwork:
    """The real network."""

    def connect(self, host: str, port: int, timeout: float) -> TcpTransport:
        """Connect; DriverError for an unknown name, no answer, or a connection that is refused."""
        try:
            connected = socket.create_connection((host, port), timeout)
            return TcpTransport(connected, connected.getpeername()[0], f"{host}:{port}")
        except UnicodeError as error:  # of the codec for host names
            raise UnknownHostError(f"{host[:60]!r} is no host name or address") from error
        except socket.gaierror as error:
            remedy = "check the robot's name or address"
            if _HOST_AND_PORT.fullmatch(host):
                remedy = "give the name or address alone; --port-base (in Python: ports) sets the ports"
            raise UnknownHostError(f"{host} cannot be looked up: {remedy}") from error
        except OSError as error:
            raise DriverError(f"{host}:{port} {_reason(error)}") from error

    def listen(self, address: str, port: int) -> TcpListener:
        """Listen on a port of one of our own addresses; 0: any free one.

        Raises:
            PortTakenError: another program listens there.
            DriverError: not an address of this machine, or a port that we may not use.
        """
        family = socket.AF_INET6 if ":" in address else socket.AF_INET
        listening = socket.socket(family, socket.SOCK_STREAM)
        if os.name == "posix":
            # Connections of a session that has just ended keep the port for a minute otherwise. Two listeners
            # are never let in; on Windows the option would do that, and it is not needed there.
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((address, port))
            listening.listen(4)
        except OSError as error:
            listening.close()
            kind = PortTakenError if error.errno == errno.EADDRINUSE else DriverError
            raise kind(f"cannot listen on {address}:{port}: {_reason(error)}") from error
        return TcpListener(listening)

    def now(self) -> float:
        """Seconds of a monotonic clock."""
        return time.perf_counter()  # on Windows, time.monotonic may have steps of 16 ms


def _reason(error: OSError | ValueError) -> str:
    """Say in a few words what went wrong and what to look at."""
    if isinstance(error, TimeoutError):
        return "does not answer: check the address, the cable and that the robot is switched on"
    if isinstance(error, ConnectionRefusedError):
        return "refuses the connection: is the control box up, and is --port-base right?"
    if not isinstance(error, OSError):  # of a socket that is closed
        return str(error)
    if error.errno in NO_ROUTE:
        return "cannot be reached, there is no route to it: check the address and this computer's network"
    if error.errno == errno.EADDRINUSE:
        return "another program uses the port: end it, or give another --reverse-port (0: any free one)"
    if isinstance(error, (ConnectionResetError, BrokenPipeError, ConnectionAbortedError)):
        return "the other end closed the connection"
    return error.strerror or str(error) or type(error).__name__
