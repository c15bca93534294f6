"""What scripts have outside of the box: sockets, servers of remote procedures, Modbus units.

A call of a script changes only the records here and leaves a request, which the answer of the cycle carries
to the host. What comes of it is an arrival, one of the inputs of a later cycle. Both are plain records: the
arrivals of a session explain, in place of its sockets, all that its scripts have read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any, Final

from protocol.errors import LocalProtocolError
from protocol.xmlrpc import encode_call
from ur_emulator.budgets import BUDGETS, KIB
from ur_emulator.machine.controller.io.modbus_signals import ModbusSignal, SignalType, UnitAddress

# --- Requests: what the host is to do


@dataclass(frozen=True, slots=True)
class OpenSocket:
    """Connect to a host; the socket has a number of its own."""

    socket: int
    host: str
    port: int


@dataclass(frozen=True, slots=True)
class SendBytes:
    """Send bytes on a socket."""

    socket: int
    data: bytes


@dataclass(frozen=True, slots=True)
class CloseSocket:
    """Close a socket; nothing of it arrives any more."""

    socket: int


@dataclass(frozen=True, slots=True)
class CallProcedure:
    """Call a remote procedure by XML-RPC; `body` is the encoded call."""

    server: int
    url: str
    call: int
    body: bytes


@dataclass(frozen=True, slots=True)
class CloseServer:
    """Close the connection to a server of remote procedures, and forget its calls."""

    server: int


@dataclass(frozen=True, slots=True)
class ServeSignal:
    """Take a signal of a Modbus unit as it is described here; if it is `wanted`, write or read it once.

    `signal` is its number; the other fields are those of `ModbusSignal`.
    """

    unit: UnitAddress
    signal: int
    wanted: bool
    slave: int
    type: SignalType
    address: int
    count: int
    write_address: int
    sequential: bool
    tolerance: float | None
    output: tuple[int, ...] | None


@dataclass(frozen=True, slots=True)
class ForgetSignal:
    """Do nothing more for a signal."""

    unit: UnitAddress
    signal: int


@dataclass(frozen=True, slots=True)
class SendToUnit:
    """Send a request whose answer is not used."""

    unit: UnitAddress
    slave: int
    function_code: int
    data: bytes


@dataclass(frozen=True, slots=True)
class ResetUnit:
    """Close the connection to a unit and make a new one."""

    unit: UnitAddress


@dataclass(frozen=True, slots=True)
class ReleaseUnit:
    """Close the connection to a unit once what was sent is answered."""

    unit: UnitAddress


Request = (
    OpenSocket
    | SendBytes
    | CloseSocket
    | CallProcedure
    | CloseServer
    | ServeSignal
    | ForgetSignal
    | SendToUnit
    | ResetUnit
    | ReleaseUnit
)

# --- Arrivals: what comes from outside


@dataclass(frozen=True, slots=True)
class SocketOpened:
    """A socket is connected; `is_own`: to a port of the box itself."""

    socket: int
    is_own: bool


@dataclass(frozen=True, slots=True)
class SocketClosed:
    """The peer has closed, or there is no connection: `problem` says why, "" if the peer refused."""

    socket: int
    problem: str


@dataclass(frozen=True, slots=True)
class BytesArrived:
    """Bytes have come on a socket."""

    socket: int
    data: bytes


@dataclass(frozen=True, slots=True)
class BytesUnsent:
    """So many bytes of a socket wait for a peer that does not read; it is told when the number changes."""

    socket: int
    n_bytes: int


@dataclass(frozen=True, slots=True)
class CallEnded:
    """A remote procedure has returned a value, or the call has failed with a text."""

    call: int
    value: Any
    error: str


@dataclass(frozen=True, slots=True)
class SignalServed:
    """What is known of a signal now; see `ModbusSignal` for the fields. No values: none were read."""

    signal: int
    values: tuple[int, ...]
    trouble: str
    device_error: int
    connection_error: int


Arrival = SocketOpened | SocketClosed | BytesArrived | BytesUnsent | CallEnded | SignalServed

# A socket with no more unsent bytes than this can always send: one that is stuck does not stop the others.
_SHARE: Final = 4 * KIB


class ScriptSocket:
    """One TCP connection opened by a script. All calls return at once.

    Attributes:
        number: of the socket, for requests and arrivals.
        problem: why there is no connection; "" while there is one, and if the peer refused.
        inbox: bytes that have come and were not read yet; the reader takes them out of it.
        is_connecting: the connection is being made.
        is_open: the connection stands and the peer has not closed it.
        is_own: it leads to a port of the box itself.
        waiting: bytes that the peer has not taken, as the host said last.
        unsent: the same, and those that were sent in this cycle.
    """

    def __init__(self, network: Network, number: int) -> None:
        self._network = network
        self.number = number
        self.problem = ""
        self.inbox = bytearray()
        self.is_connecting = True
        self.is_open = self.is_own = False
        self.waiting = self.unsent = 0

    def send(self, data: bytes) -> bool:
        """Send bytes; False if the connection is closed or its buffer is full."""
        return self.is_open and self._network.send(self, data)

    def close(self) -> None:
        """Close the connection; harmless if it is closed already. What has come can still be read."""
        self.is_open = self.is_connecting = False
        self._network.close_socket(self)


class RemoteCallError(Exception):
    """A remote procedure call failed; the text says why."""


class RemoteCall:
    """One call of a remote procedure; it `is_done` once the result, or the failure, is known."""

    def __init__(self) -> None:
        self.is_done = False
        self._value: Any = None
        self._error = ""

    def result(self) -> Any:
        """Return what the procedure returned; RemoteCallError if the call failed."""
        if self._error:
            raise RemoteCallError(self._error)
        return self._value

    def finish(self, value: Any, error: str) -> None:
        """Take the end of the call."""
        self._value, self._error, self.is_done = value, error, True


class RemoteServer:
    """A server of remote procedures as one script handle knows it. All calls return at once."""

    def __init__(self, network: Network, number: int, url: str) -> None:
        self._network = network
        self._number = number
        self._url = url

    @property
    def is_busy(self) -> bool:
        """Whether a call is running."""
        return self._network.has_calls(self._number)

    def call(self, method: str, arguments: Sequence[Any]) -> RemoteCall:
        """Begin to call a procedure, connecting first if need be; calls are made one after the other."""
        call = RemoteCall()
        try:
            body = encode_call(method, arguments)
        except LocalProtocolError as error:
            call.finish(None, str(error))
        else:
            self._network.begin_call(self._number, self._url, body, call)
        return call

    def close(self) -> None:
        """Close the connection and forget the running calls; a later call connects again."""
        self._network.close_server(self._number)


class ModbusUnit:
    """The connection to a Modbus unit, shared by its signals. All calls return at once."""

    def __init__(self, network: Network, address: UnitAddress) -> None:
        self._network = network
        self._address = address

    def want(self, signal: ModbusSignal) -> None:
        """Write the signal's output, or read its value if it has none, as soon as possible."""
        self._network.serve_signal(self._address, signal, wanted=True)

    def describe(self, signal: ModbusSignal) -> None:
        """Take over how long the signal may be without a valid answer."""
        self._network.serve_signal(self._address, signal, wanted=False)

    def forget(self, signal: ModbusSignal) -> None:
        """Drop a signal."""
        self._network.forget_signal(self._address, signal)

    def send(self, slave: int, function_code: int, data: bytes) -> None:
        """Send a request and ignore the answer; the request is lost if the unit cannot be reached."""
        self._network.requests.append(SendToUnit(self._address, slave, function_code, data))

    def reset(self) -> None:
        """Close the connection and make a new one; all signals are disconnected until it answers."""
        self._network.requests.append(ResetUnit(self._address))

    def release(self) -> None:
        """Close the connection once what was sent is answered; a later call may open it again."""
        self._network.requests.append(ReleaseUnit(self._address))


class Network:
    """All that the scripts of one box have outside.

    Attributes:
        requests: of this cycle, in order; the door takes them.
    """

    def __init__(self) -> None:
        self.requests: list[Request] = []
        self._sockets: dict[int, ScriptSocket] = {}
        # The server and the call by the number of the call.
        self._calls: dict[int, tuple[int, RemoteCall]] = {}
        self._signals: dict[int, ModbusSignal] = {}
        self._signal_numbers: dict[ModbusSignal, int] = {}
        self._numbers = count(1)
        # Sockets that have sent in this cycle.
        self._senders: list[ScriptSocket] = []
        self._unsent = 0

    # --- what scripts ask

    def open(self, host: str, port: int) -> ScriptSocket:
        """Begin to connect to `host`:`port`; the result says when it is done."""
        socket = ScriptSocket(self, next(self._numbers))
        self._sockets[socket.number] = socket
        self.requests.append(OpenSocket(socket.number, host, port))
        return socket

    def remote_server(self, url: str) -> RemoteServer:
        """Return a server of remote procedures; nothing is connected before its first call."""
        return RemoteServer(self, next(self._numbers), url)

    def modbus_unit(self, address: UnitAddress) -> ModbusUnit:
        """Return the connection to a Modbus unit, shared by its signals; connected when it is needed."""
        return ModbusUnit(self, address)

    # --- what its parts note

    def send(self, socket: ScriptSocket, data: bytes) -> bool:
        """Note bytes to be sent, if there is room for them."""
        held = socket.unsent + len(data)
        if held > BUDGETS.unsent_bytes and socket.unsent:
            return False
        if held > _SHARE and self._unsent + len(data) > BUDGETS.all_unsent_bytes:
            return False
        if socket.unsent == socket.waiting:
            self._senders.append(socket)
        socket.unsent = held
        self._unsent += len(data)
        self.requests.append(SendBytes(socket.number, data))
        return True

    def close_socket(self, socket: ScriptSocket) -> None:
        """Forget a socket; harmless if that was done."""
        if self._sockets.pop(socket.number, None) is not None:
            self._set_unsent(socket, 0)
            self.requests.append(CloseSocket(socket.number))

    def begin_call(self, server: int, url: str, body: bytes, call: RemoteCall) -> None:
        """Note a call; it fails at once if as many other servers are being called as may be connected."""
        busy = {other for other, _ in self._calls.values()} - {server}
        if len(busy) >= (most := BUDGETS.remote_connections):
            call.finish(
                None, f"{most} remote procedures of other handles are being called, wait for one of them"
            )
            return
        number = next(self._numbers)
        self._calls[number] = server, call
        self.requests.append(CallProcedure(server, url, number, body))

    def has_calls(self, server: int) -> bool:
        """Whether calls of a server are running."""
        return any(other == server for other, _ in self._calls.values())

    def close_server(self, server: int) -> None:
        """Forget the calls of a server and close its connection."""
        self._calls = {number: one for number, one in self._calls.items() if one[0] != server}
        self.requests.append(CloseServer(server))

    def serve_signal(self, unit: UnitAddress, signal: ModbusSignal, *, wanted: bool) -> None:
        """Note how a signal is to be served."""
        number = self._signal_numbers.get(signal)
        if number is None:
            number = self._signal_numbers[signal] = next(self._numbers)
            self._signals[number] = signal
        s = signal
        self.requests.append(
            ServeSignal(
                unit, number, wanted, s.slave, s.type, s.address, s.count, s.write_address, s.sequential,
                s.tolerance, s.output,
            )
        )  # fmt: skip

    def forget_signal(self, unit: UnitAddress, signal: ModbusSignal) -> None:
        """Note that a signal is not used any more."""
        number = self._signal_numbers.pop(signal, None)
        if number is not None:
            del self._signals[number]
            self.requests.append(ForgetSignal(unit, number))

    # --- what the door does

    def take_requests(self) -> Sequence[Request]:
        """Return the requests of the cycle that has ended; what it has sent is taken for delivered."""
        requests = self.requests
        if not requests:
            return ()
        self.requests = []
        for socket in self._senders:
            self._set_unsent(socket, socket.waiting)
        self._senders.clear()
        return requests

    def take(self, arrival: Arrival) -> None:
        """Take what comes from outside; what is for something that scripts have closed is dropped."""
        match arrival:
            case BytesArrived(number, data):
                if (socket := self._sockets.get(number)) is not None:
                    socket.inbox += data
            case SocketOpened(number, is_own):
                if (socket := self._sockets.get(number)) is not None:
                    socket.is_connecting, socket.is_open, socket.is_own = False, True, is_own
            case SocketClosed(number, problem):
                if (socket := self._sockets.get(number)) is not None:
                    socket.is_connecting, socket.is_open, socket.problem = False, False, problem
            case BytesUnsent(number, n_bytes):
                if (socket := self._sockets.get(number)) is not None:
                    socket.waiting = n_bytes
                    self._set_unsent(socket, n_bytes)
            case CallEnded(number, value, error):
                if (running := self._calls.pop(number, None)) is not None:
                    running[1].finish(value, error)
            case SignalServed(number, values, trouble, device_error, connection_error):
                if (signal := self._signals.get(number)) is not None:
                    signal.served(values, trouble, device_error, connection_error)

    def unread(self, socket: int) -> int:
        """Return how many bytes of a socket no script has read."""
        found = self._sockets.get(socket)
        return 0 if found is None else len(found.inbox)

    def _set_unsent(self, socket: ScriptSocket, n_bytes: int) -> None:
        self._unsent += n_bytes - socket.unsent
        socket.unsent = n_bytes
