"""Builtins for digital and analogue lines, flags and registers. They act at once, within the cycle.

The catalogue has checked that a line or register exists; its number may be a float without fraction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableSequence, Sequence
from typing import Any

from ur_emulator.controller.io.lines import DIGITAL_GROUPS, STANDARD_AND_TOOL, AnalogLine, InputOutput
from ur_emulator.controller.io.registers import Registers

Function = Callable[..., Any]


def io_functions(io: InputOutput) -> Mapping[str, Function]:
    """Return the builtins for lines and flags."""
    return {**_digital(io), **_analog(io), **_flags(io.flags)}


def _digital(io: InputOutput) -> dict[str, Function]:
    def reader(read: Callable[[int], bool], bits: Sequence[int]) -> Function:
        return lambda thread, n: read(bits[int(n)])

    def writer(bits: Sequence[int]) -> Function:
        return lambda thread, n, b: io.write_digital_out(bits[int(n)], b)

    functions: dict[str, Function] = {}
    for name, group in DIGITAL_GROUPS.items():
        functions[f"get_{name}_digital_in"] = reader(io.read_digital_in, group.bits)
        functions[f"get_{name}_digital_out"] = reader(io.read_digital_out, group.bits)
        functions[f"set_{name}_digital_out"] = writer(group.bits)
    functions["get_digital_in"] = reader(io.read_digital_in, STANDARD_AND_TOOL)
    functions["get_digital_out"] = reader(io.read_digital_out, STANDARD_AND_TOOL)
    functions["set_digital_out"] = writer(STANDARD_AND_TOOL)
    return functions


def _analog(io: InputOutput) -> dict[str, Function]:
    def reader(lines: list[AnalogLine]) -> Function:
        return lambda thread, n: lines[int(n)].value

    def writer(lines: list[AnalogLine]) -> Function:
        return lambda thread, n, f: lines[int(n)].set_ratio(f)

    return {
        "get_standard_analog_in": reader(io.analog_in),
        "get_tool_analog_in": reader(io.tool_analog_in),
        "get_standard_analog_out": reader(io.analog_out),
        "set_standard_analog_out": writer(io.analog_out),
        "get_analog_in": reader([*io.analog_in, *io.tool_analog_in]),
        "get_analog_out": reader(io.analog_out),
        "set_analog_out": writer(io.analog_out),
        "set_tool_voltage": lambda thread, voltage: io.set_tool_voltage(int(voltage)),
    }


def _flags(flags: list[bool]) -> dict[str, Function]:
    def set_flag(thread: object, n: int, b: bool) -> None:
        flags[int(n)] = b

    return {"get_flag": lambda thread, n: flags[int(n)], "set_flag": set_flag}


def register_functions(registers: Registers) -> Mapping[str, Function]:
    """Return the builtins for the general purpose registers."""
    functions: dict[str, Function] = {}
    for kind, inputs, outputs in (
        ("boolean", registers.inputs.booleans, registers.outputs.booleans),
        ("integer", registers.inputs.integers, registers.outputs.integers),
        ("float", registers.inputs.floats, registers.outputs.floats),
    ):
        functions[f"read_input_{kind}_register"] = _register_reader(inputs)
        functions[f"read_output_{kind}_register"] = _register_reader(outputs)
        functions[f"write_output_{kind}_register"] = _register_writer(outputs)
    return functions


def _register_reader(memory: MutableSequence[Any]) -> Function:
    return lambda thread, address: memory[int(address)]


def _register_writer(memory: MutableSequence[Any]) -> Function:
    kind = type(memory[0])

    def write(thread: object, address: int, value: Any) -> None:
        memory[int(address)] = kind(value)

    return write
