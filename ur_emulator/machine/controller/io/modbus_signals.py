"""The Modbus signals that programs have added: what each stands for, its value, and when it is due.

A signal lives until it is deleted, replaced by one of the same name, or the controller ends. It is refreshed
at its frequency in robot time; the connection to its unit (`ModbusUnit`) belongs to the servers, works in
real time and never delays a cycle. An output is read until a program sets it and is written from then on: at
once when its value changes, and at its frequency.
Source: URScript manual CB3 3.15, module interfaces; UR3 user manual CB3, section "MODBUS client I/O setup".
That a changed output goes out at once: chosen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple, Protocol

from ur_emulator.machine.controller.io.lines import RunState, level

DEFAULT_PORT = 502
DEFAULT_FREQUENCY = 10.0
"""How often a signal is refreshed unless a program says otherwise [Hz]."""
DISCONNECTED = -2
"""Connection error of a signal whose unit is not connected. Source: manual, modbus_get_error."""
NO_ANSWER = 110
"""That of one whose unit does not answer: ETIMEDOUT."""
MAX_SIGNALS = 256
"""Chosen: a program that adds signals in an endless loop must end at some point."""

DEFAULT_ACTION = "default"
FREEDRIVE_ACTION = "freedrive"


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

    def __post_init__(self) -> None:
        """Begin with zeros."""
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

    def is_same_place(self, other: ModbusSignal) -> bool:
        """Whether both stand for the same thing."""
        return self._place == other._place

    @property
    def _place(self) -> tuple[object, ...]:
        write = self.write_address, self.write_count
        return self.unit, self.slave, self.address, self.type, self.count, *write


class ModbusUnit(Protocol):
    """The connection to a unit, shared by its signals. All calls return at once."""

    def want(self, signal: ModbusSignal) -> None:
        """Write the signal's output, or read its value if it has none, as soon as possible."""
        ...

    def describe(self, signal: ModbusSignal) -> None:
        """Take over how long the signal may be without a valid answer."""
        ...

    def forget(self, signal: ModbusSignal) -> None:
        """Drop a signal."""
        ...

    def send(self, slave: int, function_code: int, data: bytes) -> None:
        """Send a request and ignore the answer; the request is lost if the unit cannot be reached."""
        ...

    def reset(self) -> None:
        """Close the connection and make a new one; all signals are disconnected until it answers."""
        ...

    def release(self) -> None:
        """Close the connection once what was sent is answered; a later call may open it again."""
        ...


class ModbusSignals:
    """All signals of one controller, by name."""

    def __init__(self, period_s: float) -> None:
        self._rate = 1.0 / period_s
        self._units: dict[UnitAddress, ModbusUnit] = {}
        self.signals: dict[str, ModbusSignal] = {}

    def add(self, signal: ModbusSignal, open_unit: Callable[[UnitAddress], ModbusUnit]) -> None:
        """Add a signal; one of the same name is replaced, its value stays if it stands for the same thing."""
        # The new signal first: a unit that both share stays connected.
        if signal.unit not in self._units:
            self._units[signal.unit] = open_unit(signal.unit)
        old = self.signals.pop(signal.name, None)
        if old is not None and old.is_same_place(signal):
            signal.values = old.values
        self.signals[signal.name] = signal
        if old is not None:
            self._drop(old)

    def delete(self, name: str) -> None:
        """Delete a signal; harmless if there is none."""
        signal = self.signals.pop(name, None)
        if signal is not None:
            self._drop(signal)

    def step(self, tick: int) -> None:
        """Request the signals that are due in this cycle."""
        for signal in self.signals.values():
            has_error = signal.device_error or signal.connection_error
            signal.invalid_cycles = signal.invalid_cycles + 1 if has_error else 0
            if signal.frequency and tick >= signal.due:
                interval = self._rate / signal.frequency
                # After missed requests at most one follows at once.
                signal.due = (signal.due if tick - signal.due < interval else tick) + interval
                self.refresh(signal)

    def refresh(self, signal: ModbusSignal) -> None:
        """Request a signal now."""
        self._units[signal.unit].want(signal)

    def set_tolerance(self, signal: ModbusSignal, tolerance: float) -> None:
        """Set how long a signal may be without a valid answer [s]."""
        signal.tolerance = tolerance
        self._units[signal.unit].describe(signal)

    def reset(self, unit: UnitAddress) -> list[ModbusSignal]:
        """Connect to a unit anew; return its signals."""
        signals = [signal for signal in self.signals.values() if signal.unit == unit]
        if signals:
            self._units[unit].reset()
            for signal in signals:
                signal.connection_error = DISCONNECTED
                self.refresh(signal)
        return signals

    def set_output(self, signal: ModbusSignal, values: tuple[int, ...]) -> None:
        """Set the first outputs of a signal, the others stay: all are written from now on."""
        output = values + signal.outputs[len(values) :]
        is_news = signal.output != output or not signal.frequency
        signal.output = output
        if not signal.reads_back:
            signal.values = output
        if is_news:
            self.refresh(signal)

    def set_rule(self, signal: ModbusSignal, rule: RunState, program_runs: bool) -> None:
        """Let an output follow the program; it takes its value for the present state at once."""
        signal.rule = rule
        self._set_level(signal, level(rule, program_runs))

    def follow(self, program_runs: bool, *, unscheduled: bool) -> None:
        """Set the outputs that follow the program, which has started or ended; see `lines.level`."""
        for signal in self.signals.values():
            self._set_level(signal, level(signal.rule, program_runs, unscheduled=unscheduled))

    def send(
        self,
        unit: UnitAddress,
        open_unit: Callable[[UnitAddress], ModbusUnit],
        slave: int,
        function_code: int,
        data: bytes,
    ) -> None:
        """Send a request that the program has composed."""
        if unit in self._units:
            self._units[unit].send(slave, function_code, data)
        else:
            passing = open_unit(unit)
            passing.send(slave, function_code, data)
            passing.release()

    @property
    def requests_freedrive(self) -> bool:
        """True while a digital input with the action "freedrive" is high, and its unit answers."""
        return any(
            s.action == FREEDRIVE_ACTION and any(s.values) and not s.trouble for s in self.signals.values()
        )

    def _set_level(self, signal: ModbusSignal, is_high: bool | None) -> None:
        if is_high is not None:
            self.set_output(signal, (int(is_high),) * len(signal.outputs))

    def _drop(self, signal: ModbusSignal) -> None:
        self._units[signal.unit].forget(signal)
        if all(other.unit != signal.unit for other in self.signals.values()):
            self._units.pop(signal.unit).release()
