"""The Modbus signals that programs have added: what each stands for, its value, and when it is due.

A signal lives until it is deleted, replaced by one of the same name, or the controller ends. It is refreshed
at its frequency in robot time; the connection to its unit belongs to the host, works in real time and never
delays a cycle. An output is read until a program sets it and is written from then on: at once when its value
changes, and at its frequency.
Source: URScript manual CB3 3.15, module interfaces; UR3 user manual CB3, section "MODBUS client I/O setup".
That a changed output goes out at once: chosen.
"""

from operator import attrgetter

from ur_emulator.machine.controller.io.lines import RunState, level
from ur_emulator.machine.controller.io.network import (
    DISCONNECTED,
    FREEDRIVE_ACTION,
    ModbusSignal,
    Network,
    ReleaseUnit,
    ResetUnit,
    SendToUnit,
    UnitAddress,
)

MAX_SIGNALS = 256
"""Chosen: a program that adds signals in an endless loop must end at some point."""

# What a signal stands for.
_PLACE = attrgetter("unit", "slave", "address", "type", "count", "write_address", "write_count")


class ModbusSignals:
    """All signals of one controller, by name."""

    def __init__(self, period_s: float, network: Network) -> None:
        self._rate = 1.0 / period_s
        self._network = network
        self.signals: dict[str, ModbusSignal] = {}

    def add(self, signal: ModbusSignal) -> None:
        """Add a signal; one of the same name is replaced, its value stays if it stands for the same thing."""
        # The new signal first: a unit that both share stays connected.
        old = self.signals.pop(signal.name, None)
        if old is not None and _PLACE(old) == _PLACE(signal):
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
        self._network.serve(signal)

    def set_tolerance(self, signal: ModbusSignal, tolerance: float) -> None:
        """Set how long a signal may be without a valid answer [s]."""
        signal.tolerance = tolerance
        self._network.serve(signal, wanted=False)

    def reset(self, unit: UnitAddress) -> list[ModbusSignal]:
        """Connect to a unit anew; return its signals."""
        signals = self._of(unit)
        if signals:
            self._network.requests.append(ResetUnit(unit))
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

    def send(self, unit: UnitAddress, slave: int, function_code: int, data: bytes) -> None:
        """Send a request that the program has composed; it is lost if the unit cannot be reached."""
        requests = self._network.requests
        requests.append(SendToUnit(unit, slave, function_code, data))
        if not self._of(unit):
            requests.append(ReleaseUnit(unit))

    @property
    def requests_freedrive(self) -> bool:
        """True while a digital input with the action "freedrive" is high, and its unit answers."""
        return any(
            s.action == FREEDRIVE_ACTION and any(s.values) and not s.trouble for s in self.signals.values()
        )

    def _set_level(self, signal: ModbusSignal, is_high: bool | None) -> None:
        if is_high is not None:
            self.set_output(signal, (int(is_high),) * len(signal.outputs))

    def _of(self, unit: UnitAddress) -> list[ModbusSignal]:
        return [signal for signal in self.signals.values() if signal.unit == unit]

    def _drop(self, signal: ModbusSignal) -> None:
        self._network.forget(signal)
        if not self._of(signal.unit):
            self._network.requests.append(ReleaseUnit(signal.unit))
