"""Builtins for lines, flags, registers, what lines stand for, and the tool connector; they act at once.

The catalogue has checked that a line or register exists; its number may be a float without fraction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableSequence, Sequence
from typing import Any, Final

from ur_emulator.controller.io.configuration import IoConfiguration, OutputKind
from ur_emulator.controller.io.lines import (
    CONFIGURABLE,
    CURRENT,
    DIGITAL_GROUPS,
    N_EUROMAP,
    STANDARD,
    STANDARD_AND_TOOL,
    TOOL,
    VOLTAGE,
    AnalogLine,
    Euromap,
    InputOutput,
    RunState,
    ToolLine,
)
from ur_emulator.controller.io.registers import Registers
from urscript.errors import ScriptRuntimeError

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


# --- builtins that set up lines: domains, input actions, outputs that follow the program, Euromap67

_INPUT_GROUPS = ("standard_digital", "configurable_digital", "tool_digital", "gp_boolean")
# Builtins that let an output follow the program, by group.
_RUNSTATE_NAMES = {
    OutputKind.STANDARD: "standard_digital_output",
    OutputKind.CONFIGURABLE: "configurable_digital_output",
    OutputKind.TOOL: "tool_digital_output",
    OutputKind.ANALOG: "standard_analog_output",
    OutputKind.GP_BOOLEAN: "gp_boolean_output",
    OutputKind.GP_INTEGER: "gp_integer_output",
    OutputKind.GP_FLOAT: "gp_float_output",
}
# Meaning of the range codes of set_analog_inputrange on the ports of the box and of the tool. 0 to 5 V is
# mapped to 0 to 10 V; ranges with negative voltages ended with CB2. Source: URScript manual CB3.
_BOX_RANGES = {0: VOLTAGE, 2: VOLTAGE}
_TOOL_RANGES = {0: VOLTAGE, 1: VOLTAGE, 2: CURRENT}
# The outputs that the undocumented list forms speak of, in the order of the old numbering.
_LISTED_STANDARD = tuple((OutputKind.STANDARD, i) for i in range(STANDARD.count))
_LISTED_OUTPUTS = {
    "set_runstate_standard_digital_outputs": _LISTED_STANDARD,
    "set_runstate_configurable_digital_outputs": tuple(
        (OutputKind.CONFIGURABLE, i) for i in range(CONFIGURABLE.count)
    ),
    "set_runstate_outputs": (*_LISTED_STANDARD, *((OutputKind.TOOL, i) for i in range(TOOL.count))),
}


def io_configuration_functions(io: InputOutput, configuration: IoConfiguration) -> Mapping[str, Function]:
    """Return the builtins for the set-up of lines."""
    return {
        **_domains(io),
        **_actions(configuration),
        **_runstates(configuration),
        **_euromap(io.euromap, configuration),
    }


def _domains(io: InputOutput) -> dict[str, Function]:
    def domain_setter(lines: Sequence[AnalogLine]) -> Function:
        return lambda thread, port, domain: lines[int(port)].set_domain(int(domain))

    def set_analog_inputrange(thread: object, port: float, code: float) -> None:
        ranges, line = (
            (_BOX_RANGES, io.analog_in[int(port)])
            if port < 2
            else (_TOOL_RANGES, io.tool_analog_in[int(port) - 2])
        )
        domain = ranges.get(int(code))
        if domain is None:
            allowed = ", ".join(map(str, ranges))
            raise ScriptRuntimeError(
                f"set_analog_inputrange: range {code:g} is not supported on port {port:g}; allowed: {allowed}"
            )
        line.set_domain(domain)

    return {
        "set_standard_analog_input_domain": domain_setter(io.analog_in),
        "set_tool_analog_input_domain": domain_setter(io.tool_analog_in),
        "set_analog_outputdomain": domain_setter(io.analog_out),
        "set_analog_inputrange": set_analog_inputrange,
    }


def _actions(configuration: IoConfiguration) -> dict[str, Function]:
    def setter(group: str) -> Function:
        return lambda thread, port, action: configuration.set_input_action(group, int(port), action)

    return {
        **{f"set_{group}_input_action": setter(group) for group in _INPUT_GROUPS},
        "set_input_actions_to_default": lambda thread: configuration.clear_input_actions(),
    }


def _runstates(configuration: IoConfiguration) -> dict[str, Function]:
    def setter(kind: OutputKind, name: str) -> Function:
        # The catalogue checks the codes of the others, which the e-Series has more of.
        allowed = range(4) if kind in (OutputKind.GP_INTEGER, OutputKind.GP_FLOAT) else tuple(RunState)

        def set_runstate(thread: object, output: float, code: float) -> None:
            if code not in allowed:
                raise ScriptRuntimeError(f"{name}: state {code:g} does not exist; allowed: 0 to 3")
            configuration.set_rule(kind, int(output), RunState(int(code)))

        return set_runstate

    def set_listed(names: Sequence[tuple[OutputKind, int]], builtin: str) -> Function:
        def set_list(thread: object, outputs: list[Any]) -> None:
            if not all(type(i) in (int, float) and i in range(len(names)) for i in outputs):
                raise ScriptRuntimeError(f"{builtin}: outputs are numbers from 0 to {len(names) - 1}")
            for i, (kind, index) in enumerate(names):
                configuration.set_rule(
                    kind, index, RunState.LOW_WHEN_STOPPED if i in outputs else RunState.KEEP
                )

        return set_list

    functions: dict[str, Function] = {}
    for kind, output in _RUNSTATE_NAMES.items():
        name = f"set_runstate_{output}_to_value"
        functions[name] = setter(kind, name)
    for name, listed in _LISTED_OUTPUTS.items():
        functions[name] = set_listed(listed, name)
    return functions


def _euromap(euromap: Euromap, configuration: IoConfiguration) -> dict[str, Function]:
    def port(number: float) -> int:
        if not 0 <= number < N_EUROMAP:
            raise ScriptRuntimeError(
                f"Euromap67 port {number:g} does not exist; allowed: 0 to {N_EUROMAP - 1}"
            )
        return int(number)

    return {
        "get_euromap_input": lambda thread, n: euromap.read_input(port(n)),
        "get_euromap_output": lambda thread, n: euromap.read_output(port(n)),
        "set_euromap_output": lambda thread, n, value: euromap.write_output(port(n), value),
        "set_euromap_runstate_dependent_choice": lambda thread, n, choice: configuration.set_rule(
            OutputKind.EUROMAP, port(n), RunState(int(choice))
        ),
    }


# --- builtins for the tool connector of an e-Series arm, and for the light of its base
#
# Nothing listens at the tool's serial line here: its settings are kept and reported, and how the outputs
# drive. No port shows the light: its settings are checked and have no other effect.

# Bits per second of the tool's serial line. Source: URScript manual e-Series, set_tool_communication.
BAUD_RATES: Final = (9600, 19200, 38400, 57600, 115200, 1_000_000, 2_000_000, 5_000_000)


def tool_functions(io: InputOutput) -> Mapping[str, Callable[..., Any]]:
    """Return the builtins for the tool connector and the base light."""

    def set_tool_communication(
        thread: object, enabled: bool, baud_rate: int, parity: int, stop_bits: int, *idle_chars: float
    ) -> None:
        if baud_rate not in BAUD_RATES:
            allowed = ", ".join(map(str, BAUD_RATES))
            raise ScriptRuntimeError(
                f"set_tool_communication: baud rate {baud_rate} is not supported; allowed: {allowed}"
            )
        io.set_tool_line(ToolLine(enabled, int(baud_rate), int(parity), int(stop_bits), *idle_chars))

    def set_pin_mode(thread: object, n: float, mode: float) -> None:
        io.set_tool_output_mode(1 + int(n), int(mode))

    def accept(thread: object, *setting: int) -> None:
        """Accept a setting without effect; the catalogue checks its range."""

    return {
        "set_tool_communication": set_tool_communication,
        "set_tool_output_mode": lambda thread, mode: io.set_tool_output_mode(0, int(mode)),
        "set_tool_digital_output_mode": set_pin_mode,
        "set_baselight_off": accept,
        "set_baselight_iec": accept,
        "set_baselight_solid": accept,
    }
