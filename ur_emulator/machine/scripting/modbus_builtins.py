"""Modbus builtins: signals of other units that the controller supervises, and the robot's own map.

They act at once and never wait, but for a connection that is made anew on request.

Reading or setting a signal whose unit has given no valid answer for too long is a run-time error, as with the
watchdog of later controllers; before that a signal has its last value, at first 0.
Source: URScript manuals CB3 3.15 and e-Series 5.2x, module interfaces. Chosen: one value for a signal of
several sets its first one.
"""

import re
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from ur_emulator.machine.controller import modbus_map
from ur_emulator.machine.controller.clock import Clock
from ur_emulator.machine.controller.io.configuration import IoConfiguration
from ur_emulator.machine.controller.io.lines import RunState
from ur_emulator.machine.controller.io.modbus_signals import MAX_SIGNALS, ModbusSignals
from ur_emulator.machine.controller.io.network import (
    DEFAULT_PORT,
    ModbusSignal,
    SignalType,
    UnitAddress,
)
from ur_emulator.machine.controller.state import ControllerState
from ur_emulator.machine.scripting.builtin_group import BuiltinGroup, builtin, refusing
from urscript import Blocked, HostFunction, Outside, ScriptRuntimeError
from urscript.values import log_form, wrap_int

# Source: URScript manual, modbus_add_signal.
MAX_NAME = 20
WORD_MAX = 0xFFFF
ADDRESSES = 0x10000
BYTE_MAX = 0xFF
# Function code and data of a request. Source: Modbus application protocol, section 4.1.
MAX_DATA = 252

_ADDRESS = re.compile(r"([A-Za-z0-9._-]{1,253})(?::(\d{1,5}))?")
_SIGN = 0x8000

_T = TypeVar("_T")


class SignalError(Exception):
    """A signal, its unit or its value is not what a builtin needs."""


class ModbusBuiltins(BuiltinGroup):
    """Signals of other units."""

    def __init__(self, modbus: ModbusSignals, configuration: IoConfiguration, clock: Clock) -> None:
        """Bind the builtins; the configuration says whether a program runs."""
        self._modbus = modbus
        self._configuration = configuration
        self._clock = clock

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins; what a signal refuses is an error of the program."""
        modbus, signal, period_s = self._modbus, self._signal, self._clock.period_s
        functions = super().functions() | {
            "modbus_delete_signal": lambda thread, name: modbus.delete(name),
            "modbus_request_update_signal_value": lambda thread, name: modbus.refresh(signal(name)),
            "modbus_get_time_since_signal_invalid": lambda thread, name: (
                period_s * signal(name).invalid_cycles
            ),
            "modbus_set_signal_watchdog": lambda thread, name, timeout: modbus.set_tolerance(
                signal(name), float(timeout)
            ),
        }
        return refusing(functions, SignalError)

    # --- definitions

    @builtin("modbus_add_signal")
    def _add_signal(
        self,
        thread: object,
        ip: str,
        slave: int,
        address: int,
        kind: int,
        name: str,
        sequential: bool,
        register_count: int = 1,
    ) -> None:
        if kind not in tuple(SignalType) or kind == SignalType.READ_WRITE_REGISTERS:
            raise SignalError(f"signal_type {kind} is not known; allowed: 0 to 3, 15 and 16")
        unit, type_ = _unit_address(ip), SignalType(kind)
        self._add(ModbusSignal(name, unit, slave, address, type_, sequential, count=register_count))

    @builtin("modbus_add_rw_signal")
    def _add_rw_signal(
        self,
        thread: object,
        ip: str,
        slave: int,
        read_address: int,
        read_count: int,
        write_address: int,
        write_count: int,
        name: str,
        sequential: bool,
    ) -> None:
        unit, type_ = _unit_address(ip), SignalType.READ_WRITE_REGISTERS
        signal = ModbusSignal(name, unit, slave, read_address, type_, sequential, count=read_count)
        signal.write_address, signal.write_count = write_address, write_count
        self._add(signal)

    def _add(self, signal: ModbusSignal) -> None:
        name, signals = signal.name, self._modbus.signals
        if not 0 < len(name) <= MAX_NAME:
            raise SignalError(f'"{name}" is not a signal name; allowed: 1 to {MAX_NAME} characters')
        if name not in signals and len(signals) >= MAX_SIGNALS:
            raise SignalError(f"there are {MAX_SIGNALS} signals already, delete one first")
        for at, count in ((signal.address, signal.count), (signal.write_address, signal.write_count)):
            if at + count > ADDRESSES:
                raise SignalError(
                    f"address {at} with {count} registers; allowed: addresses below {ADDRESSES}"
                )
        self._modbus.add(signal)

    @builtin("modbus_send_custom_command")
    def _send_custom_command(self, thread: object, ip: str, slave: int, code: int, data: list[Any]) -> None:
        if len(data) > MAX_DATA or not all(type(item) is int and 0 <= item <= BYTE_MAX for item in data):
            raise SignalError(f"data must be a list of up to {MAX_DATA} integers from 0 to {BYTE_MAX}")
        self._modbus.send(_unit_address(ip), slave, code, bytes(data))

    # --- values

    @builtin("modbus_get_signal_status")
    def _get_status(self, thread: object, name: str, is_secondary: bool) -> bool | int | list[Any]:
        signal = self._signal(name)
        if not signal.frequency:
            self._modbus.refresh(signal)
        _require_answers(signal)
        values = list(map(bool, signal.values)) if signal.type.is_digital else list(signal.values)
        return values if signal.count > 1 else values[0]

    @builtin("modbus_set_output_signal")
    def _set_output_signal(self, thread: object, name: str, value: Any, is_secondary: bool) -> None:
        signal = self._signal(name, SignalType.DIGITAL_OUTPUT)
        self._set_output(signal, _values_for(signal, value))

    @builtin("modbus_set_output_register")
    def _set_output_register(self, thread: object, name: str, value: Any, is_secondary: bool) -> None:
        signal = self._signal(name, SignalType.REGISTER_OUTPUT)
        values = _values_for(signal, value)
        if not all(0 <= item <= WORD_MAX for item in values):
            raise SignalError(f"{log_form(value)} does not fit into a register; allowed: 0 to {WORD_MAX}")
        self._set_output(signal, values)

    def _set_output(self, signal: ModbusSignal, values: list[Any]) -> None:
        self._modbus.set_output(signal, tuple(map(int, values)))
        _require_answers(signal)

    # --- settings

    @builtin("modbus_set_signal_update_frequency")
    def _set_update_frequency(self, thread: object, name: str, frequency: float) -> None:
        signal = self._signal(name)
        signal.frequency = float(frequency)
        signal.due = self._clock.tick

    @builtin("modbus_set_digital_input_action")
    def _set_input_action(self, thread: object, name: str, action: str) -> None:
        self._signal(name, SignalType.DIGITAL_INPUT).action = action

    @builtin("modbus_set_runstate_dependent_choice")
    def _set_rule(self, thread: object, name: str, code: int) -> None:
        signal = self._signal(name)
        if not signal.type.is_output:
            raise SignalError(f'signal "{name}" is a {signal.type.title}, not an output')
        self._modbus.set_rule(signal, RunState(code), self._configuration.program_runs)

    # --- connections

    @builtin("modbus_get_error")
    def _get_error(self, thread: object, name: str, source: int) -> int:
        signal = self._signal(name)
        device, connection = signal.device_error, signal.connection_error
        # Both: the connection error in the upper two bytes.
        return (wrap_int((connection & WORD_MAX) << 16 | device), device, connection)[source]

    @builtin("modbus_reset_connection")
    def _reset_connection(self, thread: object, connection_id: str, is_blocking: bool) -> Sequence[Blocked]:
        signals = self._modbus.reset(_unit_address(connection_id))
        if not signals:
            raise SignalError(f'no signal is connected to "{connection_id}"')
        waits = Blocked(lambda: not any(signal.connection_error for signal in signals), Outside.PEER)
        return [waits] if is_blocking else []

    def _signal(self, name: str, wanted: SignalType | None = None) -> ModbusSignal:
        signal = self._modbus.signals.get(name)
        if signal is None:
            raise SignalError(f'there is no Modbus signal "{name}", add it with modbus_add_signal')
        if wanted is not None and signal.type.single is not wanted:
            raise SignalError(f'signal "{name}" is a {signal.type.title}, not a {wanted.title}')
        return signal


def _values_for(signal: ModbusSignal, value: Any) -> list[Any]:
    values = value if isinstance(value, list) else [value]
    most = len(signal.outputs)
    if not 1 <= len(values) <= most:
        raise SignalError(f'{len(values)} values for signal "{signal.name}"; allowed: 1 to {most}')
    return values


def _require_answers(signal: ModbusSignal) -> None:
    if signal.trouble:
        raise SignalError(f'signal "{signal.name}" is lost: {signal.trouble}')


def _unit_address(text: str) -> UnitAddress:
    match = _ADDRESS.fullmatch(text)
    port = int(match[2] or DEFAULT_PORT) if match else 0
    if match is None or not 0 < port <= WORD_MAX:
        raise SignalError(f'"{text[:80]}" is not an address; write "ip" or "ip:port", port 1 to 65535')
    return UnitAddress(match[1], port)


class MapBuiltins(BuiltinGroup):
    """The robot's own Modbus map, which shows the whole state of the controller.

    What can only be read ignores writes: the manual's own example writes to an input.
    """

    def __init__(self, state: ControllerState) -> None:
        self._state = state

    @builtin("read_port_bit")
    def _read_bit(self, thread: object, address: int) -> bool:
        return self._access(modbus_map.read_coil, address)

    @builtin("read_port_register")
    def _read_register(self, thread: object, address: int) -> int:
        word = self._access(modbus_map.read_register, address)
        return word - 2 * _SIGN if word & _SIGN else word

    @builtin("write_port_bit")
    def _write_bit(self, thread: object, address: int, value: bool) -> None:
        self._access(modbus_map.write, True, address, value)

    @builtin("write_port_register")
    def _write_register(self, thread: object, address: int, value: int) -> None:
        self._access(modbus_map.write, False, address, value)

    def _access(self, function: Callable[..., _T], *arguments: int) -> _T:
        try:
            return function(self._state, *arguments)
        except modbus_map.MapAddressError as error:
            raise ScriptRuntimeError(str(error)) from None
