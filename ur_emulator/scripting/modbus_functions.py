"""Modbus builtins: signals of other units that the controller supervises. They act at once and never wait.

Reading or setting a signal whose unit has given no valid answer for too long is a run-time error, as with the
watchdog of later controllers; before that a signal has its last value, at first 0.
Source: URScript manuals CB3 3.15 and e-Series 5.2x, module interfaces. Chosen: one value for a signal of
several sets its first one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Mapping
from typing import Any, TypeVar

from ur_emulator.controller import modbus_map
from ur_emulator.controller.clock import Clock
from ur_emulator.controller.io.configuration import IoConfiguration
from ur_emulator.controller.io.lines import RunState
from ur_emulator.controller.io.modbus_signals import (
    DEFAULT_ACTION,
    DEFAULT_PORT,
    MAX_SIGNALS,
    ModbusSignal,
    ModbusSignals,
    SignalType,
    UnitAddress,
)
from ur_emulator.controller.modbus_map import MapAddressError
from ur_emulator.controller.state import ControllerState
from ur_emulator.scripting.network import Network
from urscript.errors import ScriptRuntimeError
from urscript.run.waits import Blocked
from urscript.values import is_number, log_form, wrap_int

Function = Callable[..., Any]

# Source: URScript manual, modbus_add_signal.
MAX_NAME = 20
WORD_MAX = 0xFFFF
ADDRESSES = 0x10000
BYTE_MAX = 0xFF
# Function code and data of a request. Source: Modbus application protocol, section 4.1.
MAX_DATA = 252

_ADDRESS = re.compile(r"([A-Za-z0-9._-]{1,253})(?::(\d{1,5}))?")


def modbus_functions(
    modbus: ModbusSignals, configuration: IoConfiguration, clock: Clock, network: Network
) -> Mapping[str, Function]:
    """Return the Modbus builtins.

    Args:
        modbus: the signals.
        configuration: says whether a program runs.
        clock: when a signal is due.
        network: connects to units.
    """
    return {
        **_definitions(modbus, network),
        **_values(modbus),
        **_settings(modbus, configuration, clock),
        **_connections(modbus, clock),
    }


def _definitions(modbus: ModbusSignals, network: Network) -> dict[str, Function]:
    def add_signal(
        thread: object,
        ip: str,
        slave: float,
        address: float,
        kind: float,
        name: str,
        sequential: bool,
        register_count: float = 1,
    ) -> None:
        builtin = "modbus_add_signal"
        if kind not in tuple(SignalType) or kind == SignalType.READ_WRITE_REGISTERS:
            raise ScriptRuntimeError(
                f"{builtin}: signal_type {kind:g} is not known; allowed: 0 to 3, 15 and 16"
            )
        unit = _unit_address(builtin, ip)
        add(
            builtin,
            ModbusSignal(
                name,
                unit,
                int(slave),
                int(address),
                SignalType(int(kind)),
                sequential,
                count=int(register_count),
            ),
        )

    def add_rw_signal(
        thread: object,
        ip: str,
        slave: float,
        read_address: float,
        read_count: float,
        write_address: float,
        write_count: float,
        name: str,
        sequential: bool,
    ) -> None:
        builtin = "modbus_add_rw_signal"
        unit = _unit_address(builtin, ip)
        add(
            builtin,
            ModbusSignal(
                name,
                unit,
                int(slave),
                int(read_address),
                SignalType.READ_WRITE_REGISTERS,
                sequential,
                count=int(read_count),
                write_address=int(write_address),
                write_count=int(write_count),
            ),
        )

    def add(builtin: str, signal: ModbusSignal) -> None:
        name = signal.name
        if not 0 < len(name) <= MAX_NAME:
            raise ScriptRuntimeError(
                f'{builtin}: "{name}" is not a signal name; allowed: 1 to {MAX_NAME} characters'
            )
        if name not in modbus.signals and len(modbus.signals) >= MAX_SIGNALS:
            raise ScriptRuntimeError(f"{builtin}: there are {MAX_SIGNALS} signals already, delete one first")
        for first, count in ((signal.address, signal.count), (signal.write_address, signal.write_count)):
            if first + count > ADDRESSES:
                raise ScriptRuntimeError(
                    f"{builtin}: address {first} with {count} registers; allowed: addresses below {ADDRESSES}"
                )
        modbus.add(signal, network.modbus_unit)

    def send_custom_command(thread: object, ip: str, slave: float, code: float, data: list[Any]) -> None:
        builtin = "modbus_send_custom_command"
        if len(data) > MAX_DATA or not all(type(item) is int and 0 <= item <= BYTE_MAX for item in data):
            raise ScriptRuntimeError(
                f"{builtin}: data must be a list of up to {MAX_DATA} integers from 0 to {BYTE_MAX}"
            )
        modbus.send(_unit_address(builtin, ip), network.modbus_unit, int(slave), int(code), bytes(data))

    return {
        "modbus_add_signal": add_signal,
        "modbus_add_rw_signal": add_rw_signal,
        "modbus_delete_signal": lambda thread, name: modbus.delete(name),
        "modbus_send_custom_command": send_custom_command,
    }


def _values(modbus: ModbusSignals) -> dict[str, Function]:
    def get_signal_status(thread: object, name: str, is_secondary: bool) -> bool | int | list[Any]:
        builtin = "modbus_get_signal_status"
        signal = _signal(modbus, builtin, name)
        if not signal.frequency:
            modbus.refresh(signal)
        _require_answers(builtin, signal)
        values = list(map(bool, signal.values)) if signal.type.is_digital else list(signal.values)
        return values if signal.count > 1 else values[0]

    def set_output_signal(thread: object, name: str, value: Any, is_secondary: bool) -> None:
        builtin = "modbus_set_output_signal"
        signal = _signal(modbus, builtin, name, SignalType.DIGITAL_OUTPUT)
        values = _values_for(builtin, signal, value)
        if not all(isinstance(item, bool) for item in values):
            raise ScriptRuntimeError(f"{builtin}: {log_form(value)} is not modelled; allowed: True or False")
        _set(builtin, signal, values)

    def set_output_register(thread: object, name: str, value: Any, is_secondary: bool) -> None:
        builtin = "modbus_set_output_register"
        signal = _signal(modbus, builtin, name, SignalType.REGISTER_OUTPUT)
        values = _values_for(builtin, signal, value)
        if not all(is_number(item) and 0 <= item <= WORD_MAX for item in values):
            raise ScriptRuntimeError(
                f"{builtin}: {log_form(value)} does not fit into a register; allowed: 0 to {WORD_MAX}"
            )
        _set(builtin, signal, values)

    def _values_for(builtin: str, signal: ModbusSignal, value: Any) -> list[Any]:
        values = value if isinstance(value, list) else [value]
        most = len(signal.outputs)
        if not 1 <= len(values) <= most:
            raise ScriptRuntimeError(
                f'{builtin}: {len(values)} values for signal "{signal.name}"; allowed: 1 to {most}'
            )
        return values

    def _set(builtin: str, signal: ModbusSignal, values: list[Any]) -> None:
        modbus.set_output(signal, tuple(map(int, values)))
        _require_answers(builtin, signal)

    return {
        "modbus_get_signal_status": get_signal_status,
        "modbus_set_output_signal": set_output_signal,
        "modbus_set_output_register": set_output_register,
    }


def _settings(modbus: ModbusSignals, configuration: IoConfiguration, clock: Clock) -> dict[str, Function]:
    def set_update_frequency(thread: object, name: str, frequency: float) -> None:
        signal = _signal(modbus, "modbus_set_signal_update_frequency", name)
        signal.frequency = max(0.0, float(frequency))
        signal.due = clock.tick

    def set_input_action(thread: object, name: str, action: str) -> None:
        builtin = "modbus_set_digital_input_action"
        _signal(modbus, builtin, name, SignalType.DIGITAL_INPUT).action = action or DEFAULT_ACTION

    def set_runstate_choice(thread: object, name: str, code: float) -> None:
        builtin = "modbus_set_runstate_dependent_choice"
        signal = _signal(modbus, builtin, name)
        if not signal.type.is_output:
            raise ScriptRuntimeError(f'{builtin}: signal "{name}" is a {signal.type.title}, not an output')
        modbus.set_rule(signal, RunState(int(code)), configuration.program_runs)

    return {
        "modbus_set_signal_update_frequency": set_update_frequency,
        "modbus_set_digital_input_action": set_input_action,
        "modbus_set_runstate_dependent_choice": set_runstate_choice,
    }


def _connections(modbus: ModbusSignals, clock: Clock) -> dict[str, Function]:
    def get_error(thread: object, name: str, source: float) -> int:
        signal = _signal(modbus, "modbus_get_error", name)
        device, connection = signal.device_error, signal.connection_error
        # Both: the connection error in the upper two bytes.
        return (wrap_int((connection & WORD_MAX) << 16 | device), device, connection)[int(source)]

    def get_time_invalid(thread: object, name: str) -> float:
        return clock.period_s * _signal(modbus, "modbus_get_time_since_signal_invalid", name).invalid_cycles

    def request_update(thread: object, name: str) -> None:
        modbus.refresh(_signal(modbus, "modbus_request_update_signal_value", name))

    def set_watchdog(thread: object, name: str, timeout: float) -> None:
        _signal(modbus, "modbus_set_signal_watchdog", name).tolerance = float(timeout)

    def reset_connection(
        thread: object, connection_id: str, is_blocking: bool
    ) -> Generator[Blocked, None, None]:
        builtin = "modbus_reset_connection"
        signals = modbus.reset(_unit_address(builtin, connection_id))
        if not signals:
            raise ScriptRuntimeError(f'{builtin}: no signal is connected to "{connection_id}"')
        if is_blocking:
            yield Blocked(lambda: not any(signal.connection_error for signal in signals), outside=True)

    return {
        "modbus_get_error": get_error,
        "modbus_get_time_since_signal_invalid": get_time_invalid,
        "modbus_request_update_signal_value": request_update,
        "modbus_set_signal_watchdog": set_watchdog,
        "modbus_reset_connection": reset_connection,
    }


def _signal(modbus: ModbusSignals, builtin: str, name: str, wanted: SignalType | None = None) -> ModbusSignal:
    """Return a signal, which must be of the wanted type."""
    signal = modbus.signals.get(name)
    if signal is None:
        raise ScriptRuntimeError(
            f'{builtin}: there is no Modbus signal "{name}", add it with modbus_add_signal'
        )
    if wanted is not None and signal.type.single is not wanted:
        raise ScriptRuntimeError(f'{builtin}: signal "{name}" is a {signal.type.title}, not a {wanted.title}')
    return signal


def _require_answers(builtin: str, signal: ModbusSignal) -> None:
    if signal.trouble:
        raise ScriptRuntimeError(f'{builtin}: signal "{signal.name}" is lost: {signal.trouble}')


def _unit_address(builtin: str, text: str) -> UnitAddress:
    match = _ADDRESS.fullmatch(text)
    port = int(match[2] or DEFAULT_PORT) if match else 0
    if match is None or not 0 < port <= WORD_MAX:
        raise ScriptRuntimeError(
            f'{builtin}: "{text[:80]}" is not an address; write "ip" or "ip:port", port 1 to 65535'
        )
    return UnitAddress(match[1], port)


# --- builtins on the robot's own Modbus map. They act at once, like those for lines

_SIGN = 0x8000

T = TypeVar("T")


def port_functions(state: ControllerState) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for the Modbus map of one controller, whose whole state it shows.

    What can only be read ignores writes: the manual's own example writes to an input.
    """

    def access(function: Callable[..., T], address: float, *value: int | bool) -> T:
        try:
            return function(state, int(address), *value)
        except MapAddressError as error:
            raise ScriptRuntimeError(str(error)) from None

    def read_port_register(thread: object, address: float) -> int:
        word = access(modbus_map.read_register, address)
        return word - 2 * _SIGN if word & _SIGN else word

    def write_port_register(thread: object, address: float, value: float) -> None:
        access(modbus_map.write_register, address, int(value))

    def write_port_bit(thread: object, address: float, value: bool) -> None:
        access(modbus_map.write_coil, address, value)

    return {
        "read_port_bit": lambda thread, address: access(modbus_map.read_coil, address),
        "read_port_register": read_port_register,
        "write_port_bit": write_port_bit,
        "write_port_register": write_port_register,
    }
