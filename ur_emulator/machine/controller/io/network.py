"""What scripts have outside of the box: sockets, servers of remote procedures, Modbus units.

A call of a script changes only the records here and leaves a request, which the answer of the cycle carries
to the host. What comes of it is an arrival, one of the inputs of a later cycle. Both are plain records: the
arrivals of a session explain, in place of its sockets, all that its scripts have read.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import count
from typing import Any, Final, NamedTuple

from protocol.errors import LocalProtocolError
from protocol.xmlrpc import encode_call
from ur_emulator.budgets import BUDGETS, KIB
from ur_emulator.machine.controller.io.lines import RunState
from urscript.run.waits import Outside

# --- Modbus: addresses and types

DEFAULT_PORT = 502


class SignalType(IntEnum):
    """What a signal stands for in its unit."""

    DIGITAL_INPUT = 0
    DIGITAL_OUTPUT = 1
    REGISTER_INPUT = 2
    REGISTER_OUTPUT = 3
    MULTIPLE_DIGITAL_OUTPUTS = 15
    MULTIPLE_REGISTER_OUTPUTS = 16
    READ_WRITE_REGISTERS = 23

    @property
    def single(self) -> SignalType:
        """What one of its coils or registers is."""
        if self is SignalType.MULTIPLE_DIGITAL_OUTPUTS:
            return SignalType.DIGITAL_OUTPUT
        return min(self, SignalType.REGISTER_OUTPUT)

    @property
    def is_output(self) -> bool:
        """Whether it can be written."""
        return self.single in (SignalType.DIGITAL_OUTPUT, SignalType.REGISTER_OUTPUT)

    @property
    def is_digital(self) -> bool:
        """Whether it consists of bits; the others are words of 16."""
        return self.single in (SignalType.DIGITAL_INPUT, SignalType.DIGITAL_OUTPUT)

    @property
    def title(self) -> str:
        """In words."""
        return self.name.lower().replace("_", " ")


class UnitAddress(NamedTuple):
    """Where a Modbus unit listens."""

    host: str
    port: int = DEFAULT_PORT

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


# --- Requests: what the host is to do


class OpenSocket(NamedTuple):
    """Connect to a host; the socket has a number of its own."""

    socket: int
    host: str
    port: int


class SendBytes(NamedTuple):
    """Send bytes on a socket."""

    socket: int
    data: bytes


class CloseSocket(NamedTuple):
    """Close a socket; nothing of it arrives any more."""

    socket: int


class CallProcedure(NamedTuple):
    """Call a remote procedure by XML-RPC; `body` is the encoded call."""

    server: int
    url: str
    call: int
    body: bytes


class CloseServer(NamedTuple):
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


class ForgetSignal(NamedTuple):
    """Do nothing more for a signal."""

    unit: UnitAddress
    signal: int


class SendToUnit(NamedTuple):
    """Send a request whose answer is not used."""

    unit: UnitAddress
    slave: int
    function_code: int
    data: bytes


class ResetUnit(NamedTuple):
    """Close the connection to a unit and make a new one."""

    unit: UnitAddress


class ReleaseUnit(NamedTuple):
    """Close the connection to a unit once what was sent is answered."""

    unit: UnitAddress


UnitRequest = ServeSignal | ForgetSignal | SendToUnit | ResetUnit | ReleaseUnit
Request = OpenSocket | SendBytes | CloseSocket | CallProcedure | CloseServer | UnitRequest

# --- Arrivals: what comes from outside


class SocketOpened(NamedTuple):
    """A socket is connected; `is_own`: to a port of the box itself."""

    socket: int
    is_own: bool


class SocketClosed(NamedTuple):
    """The peer has closed, or there is no connection: `problem` says why, "" if the peer refused."""

    socket: int
    problem: str


class BytesArrived(NamedTuple):
    """Bytes have come on a socket."""

    socket: int
    data: bytes


class BytesUnsent(NamedTuple):
    """So many bytes of a socket wait for a peer that does not read; it is told when the number changes."""

    socket: int
    n_bytes: int


class CallEnded(NamedTuple):
    """A remote procedure has returned a value, or the call has failed with a text."""

    call: int
    value: Any
    error: str


class SignalServed(NamedTuple):
    """What is known of a signal now; see `ModbusSignal` for the fields. No values: none were read."""

    signal: int
    values: tuple[int, ...]
    trouble: str
    device_error: int
    connection_error: int


Arrival = SocketOpened | SocketClosed | BytesArrived | BytesUnsent | CallEnded | SignalServed

# --- What scripts know of what is outside

# A socket with no more unsent bytes than this can always send: one that is stuck does not stop the others.
SHARE: Final = 4 * KIB


class ScriptSocket:
    """One TCP connection opened by a script.

    Attributes:
        number: of the socket, for requests and arrivals.
        problem: why there is no connection; "" while there is one, and if the peer refused.
        inbox: bytes that have come and were not read yet; still there after the end of the connection.
        n_taken: how many bytes were taken out of it.
        is_connecting: the connection is being made.
        is_open: the connection stands and the peer has not closed it.
        is_own: it leads to a port of the box itself.
        has_asked: an answer to what was sent may come.
        waiting: bytes that the peer has not taken, as the host said last.
        unsent: the same, and those that were sent in this cycle.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self.problem = ""
        self.inbox = bytearray()
        self.is_connecting = True
        self.is_open = self.is_own = self.has_asked = False
        self.n_taken = self.waiting = self.unsent = 0

    @property
    def outside(self) -> Outside | None:
        """Who time must wait for: a peer, also a port of the box itself that was asked."""
        return Outside.PEER if self.has_asked or not self.is_own else None

    def take(self, size: int) -> bytes:
        """Take bytes out of the inbox."""
        data = bytes(self.inbox[:size])
        del self.inbox[:size]
        self.n_taken += len(data)
        self.has_asked = self.has_asked and bool(self.inbox)
        return data


class RemoteCallError(Exception):
    """A remote procedure call failed; the text says why."""


class RemoteCall:
    """One call of a remote procedure of a server.

    Attributes:
        is_done: the value that it has returned is known, or the error with which it has failed.
    """

    def __init__(self, server: int) -> None:
        self.server = server
        self.is_done = False
        self.value: Any = None
        self.error = ""

    def end(self, value: Any, error: str) -> None:
        """Take the end of the call."""
        self.value, self.error, self.is_done = value, error, True


DEFAULT_FREQUENCY = 10.0
"""How often a signal is refreshed unless a program says otherwise [Hz]."""
DISCONNECTED = -2
"""Connection error of a signal whose unit is not connected. Source: manual, modbus_get_error."""
NO_ANSWER = 110
"""That of one whose unit does not answer: ETIMEDOUT."""
DEFAULT_ACTION = "default"
FREEDRIVE_ACTION = "freedrive"


@dataclass(slots=True, eq=False)
class ModbusSignal:
    """One signal: a coil or register, or neighbouring ones.

    Attributes:
        unit: where its unit listens.
        slave: number of the unit behind that address, 0 to 255.
        address: of the first coil or register, 0 to 65535.
        count: how many coils or registers are read.
        write_address, write_count: of the registers that READ_WRITE_REGISTERS writes.
        sequential: the unit takes one request at a time.
        frequency: how often it is refreshed [Hz]; 0 only on demand.
        rule: what an output does when programs start and stop.
        values: last ones known: of the unit, or what a program has set; 0 before.
        output: what a program has set, to be written; None while the signal is only read.
        tolerance: how long there may be no valid answer [s]; None for the usual time.
        trouble: why there has been no valid answer for longer; empty while answers come.
        device_error: exception code of the last answer, 0 for a valid one.
        connection_error: DISCONNECTED, NO_ANSWER, or 0.
        invalid_cycles: number of cycles for which there has been an error.
        due: tick of the next refresh; with a fraction, so that any frequency is kept on average.
        number: for requests and arrivals; 0 before the first of them.
    """

    name: str
    unit: UnitAddress
    slave: int
    address: int
    type: SignalType
    sequential: bool = False
    frequency: float = DEFAULT_FREQUENCY
    action: str = DEFAULT_ACTION
    rule: RunState = RunState.KEEP
    values: tuple[int, ...] = ()
    output: tuple[int, ...] | None = None
    tolerance: float | None = None
    trouble: str = ""
    device_error: int = 0
    connection_error: int = 0
    invalid_cycles: int = 0
    due: float = 0.0
    count: int = 1
    write_address: int = 0
    write_count: int = 0
    number: int = 0

    def __post_init__(self) -> None:
        self.values = self.values or (0,) * self.count

    @property
    def reads_back(self) -> bool:
        """Whether what it reads is another thing than what it writes."""
        return self.type is SignalType.READ_WRITE_REGISTERS

    @property
    def outputs(self) -> tuple[int, ...]:
        """What it writes, or would write: what was set, else what was read, else zeros."""
        if self.output is not None:
            return self.output
        return (0,) * self.write_count if self.reads_back else self.values

    def served(self, values: tuple[int, ...], trouble: str, device_error: int, connection_error: int) -> None:
        """Take what the unit knows; an output that a program has set keeps its values."""
        self.trouble, self.device_error, self.connection_error = trouble, device_error, connection_error
        if values and (self.output is None or self.reads_back):
            self.values = values


class Network:
    """All that the scripts of one box have outside. All calls return at once.

    Attributes:
        requests: of this cycle, in order; the door takes them.
    """

    def __init__(self) -> None:
        self.requests: list[Request] = []
        self._sockets: dict[int, ScriptSocket] = {}
        # Servers that may be connected, the one that was called last is last.
        self._servers: dict[int, None] = {}
        self._calls: dict[int, RemoteCall] = {}
        self._signals: dict[int, ModbusSignal] = {}
        self._numbers = count(1)
        # Sockets that have sent in this cycle.
        self._senders: list[ScriptSocket] = []
        self._unsent = 0

    # --- sockets

    def open(self, host: str, port: int) -> ScriptSocket:
        """Begin to connect to `host`:`port`; the result says when it is done."""
        socket = ScriptSocket(next(self._numbers))
        self._sockets[socket.number] = socket
        self.requests.append(OpenSocket(socket.number, host, port))
        return socket

    def send(self, socket: ScriptSocket, data: bytes) -> bool:
        """Send bytes; False if the connection is closed or there is no room for them."""
        socket.has_asked = True
        held = socket.unsent + len(data)
        if not socket.is_open or (held > BUDGETS.unsent_bytes and socket.unsent):
            return False
        if held > SHARE and self._unsent + len(data) > BUDGETS.all_unsent_bytes:
            return False
        if socket.unsent == socket.waiting:
            self._senders.append(socket)
        socket.unsent = held
        self._unsent += len(data)
        self.requests.append(SendBytes(socket.number, data))
        return True

    def close(self, socket: ScriptSocket) -> None:
        """Close a connection; harmless if it is closed already. What has come can still be read."""
        socket.is_open = socket.is_connecting = False
        if self._sockets.pop(socket.number, None) is not None:
            self._set_unsent(socket, 0)
            self.requests.append(CloseSocket(socket.number))

    # --- servers of remote procedures

    def new_server(self) -> int:
        """Return the number of a server; nothing is connected before its first call."""
        return next(self._numbers)

    def call(self, server: int, url: str, method: str, arguments: Sequence[Any]) -> RemoteCall:
        """Begin to call a procedure, connecting first if need be; calls are made one after the other.

        Of more servers than may be connected, one that is idle is closed. The call fails if an argument
        cannot be sent, or if as many other servers are being called as may be connected.
        """
        call, most = RemoteCall(server), BUDGETS.remote_connections
        self._servers.pop(server, None)
        self._servers[server] = None
        busy = {other.server for other in self._calls.values()}
        idle = (other for other in self._servers if other not in busy)
        if len(self._servers) > most and (oldest := next(idle, server)) != server:
            self.close_server(oldest)
        try:
            body = encode_call(method, arguments)
        except LocalProtocolError as error:
            call.end(None, str(error))
            return call
        if len(busy - {server}) >= most:
            call.end(
                None, f"{most} remote procedures of other handles are being called, wait for one of them"
            )
            return call
        number = next(self._numbers)
        self._calls[number] = call
        self.requests.append(CallProcedure(server, url, number, body))
        return call

    def close_server(self, server: int) -> None:
        """Close the connection to a server and forget its calls; harmless if there is none."""
        if server in self._servers:
            del self._servers[server]
            self._calls = {number: call for number, call in self._calls.items() if call.server != server}
            self.requests.append(CloseServer(server))

    def close_servers(self, servers: Container[int]) -> None:
        """Close the connections to those of these servers that may be connected."""
        for server in [server for server in self._servers if server in servers]:
            self.close_server(server)

    # --- Modbus units: one connection each, made when it is needed and shared by its signals

    def serve(self, signal: ModbusSignal, *, wanted: bool = True) -> None:
        """Write the signal's output, or read its value if it has none, as soon as possible.

        If it is not `wanted`, only take over how long the signal may be without a valid answer.
        """
        if not signal.number:
            signal.number = next(self._numbers)
            self._signals[signal.number] = signal
        self.requests.append(
            ServeSignal(
                unit=signal.unit,
                signal=signal.number,
                wanted=wanted,
                slave=signal.slave,
                type=signal.type,
                address=signal.address,
                count=signal.count,
                write_address=signal.write_address,
                sequential=signal.sequential,
                tolerance=signal.tolerance,
                output=signal.output,
            )
        )

    def forget(self, signal: ModbusSignal) -> None:
        """Drop a signal."""
        if signal.number:
            del self._signals[signal.number]
            self.requests.append(ForgetSignal(signal.unit, signal.number))

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
                if (call := self._calls.pop(number, None)) is not None:
                    call.end(value, error)
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
