"""Builtins for digital and analogue lines, flags and registers. They act at once, within the cycle."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableSequence
from typing import Any

from ur_emulator.controller.io import (
    CONFIGURABLE_SHIFT,
    N_CONFIGURABLE,
    N_STANDARD,
    N_TOOL,
    TOOL_SHIFT,
    AnalogLine,
)
from ur_emulator.controller.state import ControllerState
from urscript.errors import ScriptRuntimeError

Function = Callable[..., Any]

# Groups of the digital word: (name in the builtins, first bit, number of lines).
_DIGITAL_GROUPS = (
    ("standard", 0, N_STANDARD),
    ("configurable", CONFIGURABLE_SHIFT, N_CONFIGURABLE),
    ("tool", TOOL_SHIFT, N_TOOL),
)
# The deprecated get_digital_in(n) and its kin: 0..7 standard, 8..9 tool.
_DEPRECATED_BITS = (*range(N_STANDARD), TOOL_SHIFT, TOOL_SHIFT + 1)


def _pick(what: str, index: float, size: int) -> int:
    """Return the index of a line or register; the language lets a float without fraction through."""
    if not 0 <= index < size:
        raise ScriptRuntimeError(f"{what} {index:g} does not exist, allowed are 0 to {size - 1}")
    return int(index)


def io_functions(state: ControllerState) -> Mapping[str, Function]:
    """Return the builtins for lines and flags bound to one controller."""
    return {**_digital(state), **_analog(state), **_flags(state)}


def _digital(state: ControllerState) -> dict[str, Function]:
    io = state.io

    def reader(read: Callable[[int], bool], bits: tuple[int, ...], what: str) -> Function:
        return lambda thread, n: read(bits[_pick(what, n, len(bits))])

    def writer(bits: tuple[int, ...], what: str) -> Function:
        return lambda thread, n, b: io.write_digital_out(bits[_pick(what, n, len(bits))], b)

    functions: dict[str, Function] = {}
    for group, first, size in _DIGITAL_GROUPS:
        bits = tuple(range(first, first + size))
        functions[f"get_{group}_digital_in"] = reader(io.read_digital_in, bits, f"{group} digital input")
        functions[f"get_{group}_digital_out"] = reader(io.read_digital_out, bits, f"{group} digital output")
        functions[f"set_{group}_digital_out"] = writer(bits, f"{group} digital output")
    functions["get_digital_in"] = reader(io.read_digital_in, _DEPRECATED_BITS, "digital input")
    functions["get_digital_out"] = reader(io.read_digital_out, _DEPRECATED_BITS, "digital output")
    functions["set_digital_out"] = writer(_DEPRECATED_BITS, "digital output")
    return functions


def _analog(state: ControllerState) -> dict[str, Function]:
    io = state.io

    def reader(lines: list[AnalogLine], what: str) -> Function:
        return lambda thread, n: lines[_pick(what, n, len(lines))].value

    def writer(lines: list[AnalogLine], what: str) -> Function:
        return lambda thread, n, f: lines[_pick(what, n, len(lines))].set_ratio(f)

    def set_tool_voltage(thread: object, voltage: int) -> None:
        if voltage not in (0, 12, 24):
            raise ScriptRuntimeError(f"set_tool_voltage: {voltage} V is not one of 0, 12, 24")
        io.tool_voltage = int(voltage)

    return {
        "get_standard_analog_in": reader(io.analog_in, "standard analog input"),
        "get_tool_analog_in": reader(io.tool_analog_in, "tool analog input"),
        "get_standard_analog_out": reader(io.analog_out, "standard analog output"),
        "set_standard_analog_out": writer(io.analog_out, "standard analog output"),
        "get_analog_in": reader([*io.analog_in, *io.tool_analog_in], "analog input"),
        "get_analog_out": reader(io.analog_out, "analog output"),
        "set_analog_out": writer(io.analog_out, "analog output"),
        "set_tool_voltage": set_tool_voltage,
    }


def _flags(state: ControllerState) -> dict[str, Function]:
    flags = state.io.flags

    def set_flag(thread: object, n: int, b: bool) -> None:
        flags[_pick("flag", n, len(flags))] = b

    return {"get_flag": lambda thread, n: flags[_pick("flag", n, len(flags))], "set_flag": set_flag}


def register_functions(state: ControllerState) -> Mapping[str, Function]:
    """Return the builtins for the general purpose registers bound to one controller."""
    functions: dict[str, Function] = {}
    for kind, inputs, outputs in (
        ("boolean", state.registers.inputs.booleans, state.registers.outputs.booleans),
        ("integer", state.registers.inputs.integers, state.registers.outputs.integers),
        ("float", state.registers.inputs.floats, state.registers.outputs.floats),
    ):
        functions[f"read_input_{kind}_register"] = _register_reader(f"input {kind} register", inputs)
        functions[f"read_output_{kind}_register"] = _register_reader(f"output {kind} register", outputs)
        functions[f"write_output_{kind}_register"] = _register_writer(f"output {kind} register", outputs)
    return functions


def _register_reader(what: str, memory: MutableSequence[Any]) -> Function:
    return lambda thread, address: memory[_pick(what, address, len(memory))]


def _register_writer(what: str, memory: MutableSequence[Any]) -> Function:
    kind = type(memory[0])

    def write(thread: object, address: int, value: Any) -> None:
        memory[_pick(what, address, len(memory))] = kind(value)

    return write
