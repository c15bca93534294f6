"""The Modbus units that the programs of one box talk to: one connection each, made again when it breaks.

All times are real time. Bytes that are not Modbus, answers that were not asked for, and silence end the
connection, and a new one is made; an exception or a wrong answer is no valid answer. A signal without a valid
answer for too long is marked, and a program that uses it gets an error.

Sources: UR3 user manual CB3, section "MODBUS client I/O setup": functions by type, names of the exceptions;
script manual e-Series 5.2x, modbus_add_signal and modbus_add_rw_signal: functions of several addresses; later
script manual, modbus_set_signal_watchdog: the 2 s. All other times and limits: chosen.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from protocol import modbus
from protocol.errors import RemoteProtocolError
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.runtime.barrier import Report
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.script_network.sockets import OutgoingConnection
from ur_emulator.machine.controller.io.network import (
    DISCONNECTED,
    NO_ANSWER,
    Arrival,
    ForgetSignal,
    ModbusSignal,
    ReleaseUnit,
    ResetUnit,
    SendToUnit,
    ServeSignal,
    SignalServed,
    SignalType,
    UnitAddress,
    UnitRequest,
)

_READ = {
    SignalType.DIGITAL_INPUT: modbus.ModbusFunction.READ_DISCRETE_INPUTS,
    SignalType.DIGITAL_OUTPUT: modbus.ModbusFunction.READ_COILS,
    SignalType.REGISTER_INPUT: modbus.ModbusFunction.READ_INPUT_REGISTERS,
    SignalType.REGISTER_OUTPUT: modbus.ModbusFunction.READ_HOLDING_REGISTERS,
}
_WRITE_ONE = {
    SignalType.DIGITAL_OUTPUT: modbus.ModbusFunction.WRITE_COIL,
    SignalType.REGISTER_OUTPUT: modbus.ModbusFunction.WRITE_REGISTER,
}
_WRITE = {
    SignalType.DIGITAL_OUTPUT: modbus.ModbusFunction.WRITE_COILS,
    SignalType.REGISTER_OUTPUT: modbus.ModbusFunction.WRITE_REGISTERS,
}


@dataclass(slots=True)
class SentRequest:
    """A request, sent at a monotonic time [s], that waits; without a signal its answer is not used."""

    signal: ModbusSignal | None
    pdu: bytes
    sent_at: float


def request_for(signal: ModbusSignal) -> bytes:
    """Return the request that a signal needs: write its output if a program has set it, else read."""
    if signal.output is None:
        return modbus.encode_read(_READ[signal.type.single], signal.address, signal.count)
    if signal.reads_back:
        return modbus.encode_read_write(signal.address, signal.count, signal.write_address, signal.output)
    is_one = signal.count == 1 and signal.type in _WRITE_ONE
    function = _WRITE_ONE[signal.type] if is_one else _WRITE[signal.type.single]
    return modbus.encode_write(function, signal.address, signal.output)


def problem_of(answer: bytes, request: bytes) -> tuple[int, str]:
    """Return the exception code of an answer that has no value, and what is wrong with it in words."""
    if answer[0] != request[0] | modbus.EXCEPTION_BIT or len(answer) < 2:
        return modbus.ExceptionCode.SLAVE_DEVICE_FAILURE, "gives an answer that makes no sense"
    code = answer[1]
    known = code in modbus.ExceptionCode.__members__.values()
    name = modbus.ExceptionCode(code).name.lower().replace("_", " ") if known else "unknown"
    return code, f"answers with exception E{code} ({name})"


# A signal may be without a valid answer for this long, unless a program says otherwise [s].
TOLERANCE = 2.0
# Limits for making a connection, and for an answer [s].
CONNECT_TIMEOUT = 2.0
ANSWER_TIMEOUT = 1.0
# Pause before the next attempt to connect [s]: doubled each time until the unit answers.
FIRST_RETRY = 0.1
LAST_RETRY = 2.0
# Requests that a unit may have without an answer, unless it is in sequential mode.
MAX_UNDER_WAY = 16
# Unexpected answers in a row after which the connection is closed.
MAX_UNEXPECTED = 16

_SILENT = "does not answer"


@dataclass(slots=True)
class _Waiting:
    """Since when a signal waits for a valid answer [s], and what was wrong last."""

    since: float
    why: str = ""


class ModbusLink:
    """One unit's connection; its signals are the host's own records of those of the machine.

    Attributes:
        is_released: it is to be closed once what was sent is answered.
    """

    def __init__(self, name: str, connect: Callable[[], OutgoingConnection], period_s: float) -> None:
        """Prepare; nothing is connected before something is wanted.

        A unit that does not answer gets the next request after a control cycle.
        """
        self._name = name
        self._connect = connect
        self._period = period_s
        self._socket: OutgoingConnection | None = None
        self._connect_by = math.inf
        self._retry_at = -math.inf
        self._pause = FIRST_RETRY
        self._why = "is being connected"
        self._wanted: dict[ModbusSignal, None] = {}
        self._waiting: dict[ModbusSignal, _Waiting] = {}
        self._signals: set[ModbusSignal] = set()
        self._own_requests: list[tuple[int, bytes]] = []
        self._under_way: dict[int, SentRequest] = {}
        self._transaction = 0
        self._answered_at = -math.inf
        self._n_unexpected = 0
        self.is_released = False

    # --- what the controller asks

    def want(self, signal: ModbusSignal) -> None:
        """Write or read a signal as soon as possible."""
        self._signals.add(signal)
        self._wanted[signal] = None

    def forget(self, signal: ModbusSignal) -> None:
        """Do nothing more for a signal; an outstanding answer is dropped."""
        self._signals.discard(signal)
        self._wanted.pop(signal, None)
        self._waiting.pop(signal, None)
        for request in self._under_way.values():
            if request.signal is signal:
                request.signal = None

    def send(self, slave: int, function_code: int, data: bytes) -> None:
        """Send a request whose answer is not used."""
        if len(self._own_requests) < BUDGETS.modbus_requests:
            self._own_requests.append((slave, bytes((function_code,)) + data))

    def reset(self) -> None:
        """Close the connection and make a new one at once."""
        self._drop(DISCONNECTED)
        self._retry_at = -math.inf
        self._pause = FIRST_RETRY

    @property
    def is_idle(self) -> bool:
        """True when nothing is left to do."""
        return not (self._wanted or self._own_requests or self._under_way)

    def close(self) -> None:
        """Close at once."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        self._under_way.clear()

    def give_up(self, why: str) -> None:
        """Close at once, and mark all signals."""
        self.close()
        for signal in self._signals:
            signal.trouble = f"{self._name} {why}"

    # --- the loop

    def advance(self, now: float) -> float:
        """Do what can be done at monotonic time `now` [s]; return when to be called next at the latest."""
        for signal in self._wanted:
            self._waiting.setdefault(signal, _Waiting(now))
        if self._socket is not None:
            self._receive(self._socket.inbox, now)
        if self._is_connected(now):
            self._give_up_silent(now)
            self._ask(now)
        self._look_for_trouble(now)
        return self._next_time(now)

    def _is_connected(self, now: float) -> bool:
        """Connect if there is a reason and time to; True while the connection stands."""
        sock = self._socket
        if sock is None:
            if now < self._retry_at or self.is_idle:
                return False
            sock = self._socket = self._connect()
            self._connect_by = now + CONNECT_TIMEOUT
        if sock.is_connecting:
            if now >= self._connect_by:
                self._fail(now, f"cannot be connected within {CONNECT_TIMEOUT:g} s")
            return False
        if not sock.is_open:
            has_stood = self._connect_by == math.inf
            why = f"cannot be reached: {sock.problem}" if sock.problem else "refuses the connection"
            self._fail(now, "has closed the connection" if has_stood else why)
            return False
        if self._connect_by != math.inf:
            self._connect_by = math.inf
            self._answered_at = now
            self._n_unexpected = 0
            self._why = _SILENT
        return True

    def _fail(self, now: float, why: str) -> None:
        """Give the connection up; signals keep waiting, a program's own requests are lost."""
        self._why = why
        self._drop(NO_ANSWER if why == _SILENT else DISCONNECTED)
        self._own_requests.clear()
        self._retry_at = now + self._pause
        self._pause = min(2.0 * self._pause, LAST_RETRY)

    def _drop(self, error: int) -> None:
        """Close the connection; signals keep waiting, with a connection error."""
        for request in self._under_way.values():
            if request.signal is not None:
                self._wanted[request.signal] = None
        for waiting in self._waiting.values():
            waiting.why = ""
        for signal in self._signals:
            signal.connection_error = error
        self.close()

    # --- answers

    def _receive(self, inbox: bytearray, now: float) -> None:
        try:
            while self._socket is not None and (frame := modbus.take_frame(inbox)) is not None:
                self._take(frame, now)
        except RemoteProtocolError:
            self._fail(now, "sends what is not Modbus")

    def _take(self, frame: modbus.ModbusFrame, now: float) -> None:
        request = self._under_way.pop(frame.transaction, None)
        if request is None:
            self._n_unexpected += 1
            if self._n_unexpected > MAX_UNEXPECTED:
                self._fail(now, "sends answers that were not asked for")
            return
        self._answered_at = now
        self._n_unexpected = 0
        self._pause = FIRST_RETRY
        signal = request.signal
        if signal is None:
            return
        values = modbus.decode_values(request.pdu, frame.pdu)
        if values is None:
            signal.device_error, self._waiting[signal].why = problem_of(frame.pdu, request.pdu)
            signal.connection_error = 0
            return
        signal.trouble = ""
        signal.device_error = signal.connection_error = 0
        if signal in self._wanted:
            self._waiting[signal] = _Waiting(now)
        else:
            self._waiting.pop(signal, None)
        if signal.output is None or signal.reads_back:
            signal.values = values

    def _give_up_silent(self, now: float) -> None:
        """End what has waited too long: the request if the unit has answered another since, else the link."""
        for transaction, request in tuple(self._under_way.items()):
            if now < request.sent_at + ANSWER_TIMEOUT:
                continue
            if self._answered_at <= request.sent_at:
                self._fail(now, _SILENT)
                return
            del self._under_way[transaction]
            if request.signal is not None:
                self._wanted[request.signal] = None
                self._waiting[request.signal].why = "gives no answer"
                request.signal.connection_error = NO_ANSWER

    # --- requests

    def _ask(self, now: float) -> None:
        """Send the next request, if the unit is to get one."""
        sock = self._socket
        while sock is not None and self._may_ask(now):
            if self._own_requests:
                unit, pdu = self._own_requests.pop(0)
                request = SentRequest(None, pdu, now)
            else:
                busy = {request.signal for request in self._under_way.values()}
                signal = next((s for s in self._wanted if s not in busy), None)
                if signal is None:
                    return
                del self._wanted[signal]
                unit, request = signal.slave, SentRequest(signal, request_for(signal), now)
            transaction = self._next()
            self._under_way[transaction] = request
            # A connection that breaks here is noticed in the next round.
            sock.send(modbus.encode_frame(transaction, unit, request.pdu))

    def _may_ask(self, now: float) -> bool:
        if not self._under_way:
            return True
        if len(self._under_way) >= MAX_UNDER_WAY or any(signal.sequential for signal in self._signals):
            return False
        return now >= max(request.sent_at for request in self._under_way.values()) + self._period

    def _next(self) -> int:
        """Return a transaction number that is not in use."""
        self._transaction = self._transaction % 0xFFFF + 1
        while self._transaction in self._under_way:
            self._transaction = self._transaction % 0xFFFF + 1
        return self._transaction

    # --- time

    def _look_for_trouble(self, now: float) -> None:
        for signal, waiting in self._waiting.items():
            if now - waiting.since > (TOLERANCE if signal.tolerance is None else signal.tolerance):
                signal.trouble = f"{self._name} {waiting.why or self._why}"

    def _next_time(self, now: float) -> float:
        if self._socket is None:
            return self._retry_at if not self.is_idle else math.inf
        times = [self._connect_by]
        times += [request.sent_at + ANSWER_TIMEOUT for request in self._under_way.values()]
        if self._wanted or self._own_requests:
            times.append(now + self._period)
        return min(times)


# What the machine takes for known of a signal before anything has arrived: see `SignalServed`.
_AT_FIRST = ((), "", 0, 0)


class ModbusClient:
    """All connections to Modbus units of one box, and its records of the signals of the machine."""

    def __init__(
        self,
        loop: EventLoop,
        connect: Callable[[str, int], OutgoingConnection],
        period_s: float,
        arrive: Callable[[Arrival], None],
        report: Report,
    ) -> None:
        """Prepare; nothing is connected before there is a unit. `report` gets errors of ours."""
        self._loop = loop
        self._connect = connect
        self._period = period_s
        self._arrive = arrive
        self._report = report
        self._links: dict[UnitAddress, ModbusLink] = {}
        self._signals: dict[int, ModbusSignal] = {}
        self._told: dict[int, tuple[tuple[int, ...], str, int, int]] = {}

    def carry_out(self, request: UnitRequest) -> None:
        """Do what the machine asks of a unit."""
        match request:
            case ServeSignal(unit, number):
                signal = self._signals.get(number)
                if signal is None:
                    signal = self._signals[number] = _signal_of(request)
                signal.tolerance, signal.output = request.tolerance, request.output
                if request.wanted:
                    self._unit(unit).want(signal)
            case ForgetSignal(unit, number):
                self._told.pop(number, None)
                forgotten = self._signals.pop(number, None)
                if forgotten is not None and unit in self._links:
                    self._links[unit].forget(forgotten)
            case SendToUnit(unit, slave, function_code, data):
                self._unit(unit).send(slave, function_code, data)
            case ResetUnit(unit):
                self._unit(unit).reset()
            case ReleaseUnit(unit):
                if unit in self._links:
                    self._links[unit].is_released = True
        self._tell()

    def advance(self, now: float) -> float:
        """Advance all connections; close those that were released and are idle."""
        next_time = math.inf
        for address, link in tuple(self._links.items()):
            next_time = min(next_time, link.advance(now))
            if link.is_released and link.is_idle:
                self._end(address)
        self._tell()
        return next_time

    def failed(self, error: Exception) -> None:
        """Close all connections after an error of ours; programs see units that do not answer."""
        self._report("the connections to Modbus units are closed", error)
        for link in self._links.values():
            link.give_up("is not asked any more")
        self._tell()
        self.close()

    def close(self) -> None:
        """Close all connections at once."""
        for address in tuple(self._links):
            self._end(address)

    def _unit(self, address: UnitAddress) -> ModbusLink:
        """Return the connection to a unit, the same as long as it is in use."""
        link = self._links.get(address)
        if link is None:
            if not self._links:
                self._loop.add(self)
            elif len(self._links) >= BUDGETS.modbus_links:
                released = next((other for other, link in self._links.items() if link.is_released), None)
                if released is not None:
                    self._end(released)
            link = self._links[address] = ModbusLink(
                str(address), partial(self._connect, *address), self._period
            )
        link.is_released = False
        return link

    def _tell(self) -> None:
        """Let the machine know what has changed of its signals."""
        for number, signal in self._signals.items():
            known = signal.values, signal.trouble, signal.device_error, signal.connection_error
            if known != self._told.get(number, _AT_FIRST):
                self._told[number] = known
                self._arrive(SignalServed(number, *known))

    def _end(self, address: UnitAddress) -> None:
        self._links.pop(address).close()
        if not self._links:
            self._loop.remove(self)


def _signal_of(request: ServeSignal) -> ModbusSignal:
    """Return the host's record of a signal; no values have been read."""
    signal = ModbusSignal(
        name="",
        unit=request.unit,
        slave=request.slave,
        address=request.address,
        type=request.type,
        sequential=request.sequential,
        count=request.count,
        write_address=request.write_address,
        number=request.signal,
    )
    signal.values = ()
    return signal
