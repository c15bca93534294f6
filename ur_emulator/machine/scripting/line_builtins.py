"""Builtins for lines, flags, registers, what lines stand for, and the tool connector; they act at once.

The catalogue has checked that a line or register exists.
"""

from collections.abc import MutableSequence, Sequence
from functools import partial
from typing import Any, Final

from ur_emulator.machine.controller.io import lines
from ur_emulator.machine.controller.io.configuration import IoConfiguration, OutputKind
from ur_emulator.machine.controller.io.registers import Registers
from ur_emulator.machine.scripting.builtin_group import BuiltinGroup, builtin
from urscript import HostFunction, ScriptRuntimeError

# Bits per second of the tool's serial line. Source: URScript manual e-Series, set_tool_communication.
BAUD_RATES: Final = (9600, 19200, 38400, 57600, 115200, 1_000_000, 2_000_000, 5_000_000)

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
_BOX_RANGES = {0: lines.VOLTAGE, 2: lines.VOLTAGE}
_TOOL_RANGES = {0: lines.VOLTAGE, 1: lines.VOLTAGE, 2: lines.CURRENT}
# The outputs that the undocumented list forms speak of, in the order of the old numbering.
_LISTED_STANDARD = tuple((OutputKind.STANDARD, i) for i in range(lines.STANDARD.count))
_LISTED_OUTPUTS = {
    "set_runstate_standard_digital_outputs": _LISTED_STANDARD,
    "set_runstate_configurable_digital_outputs": tuple(
        (OutputKind.CONFIGURABLE, i) for i in range(lines.CONFIGURABLE.count)
    ),
    "set_runstate_outputs": (*_LISTED_STANDARD, *((OutputKind.TOOL, i) for i in range(lines.TOOL.count))),
}


class LineBuiltins(BuiltinGroup):
    """Lines and flags, what lines stand for, the tool connector, and the light of the base.

    Nothing listens at the tool's serial line here: its settings are kept and reported, and how the outputs
    drive. No port shows the light: its settings are checked and have no other effect.
    """

    def __init__(self, io: lines.InputOutput, configuration: IoConfiguration) -> None:
        self._io = io
        self._configuration = configuration

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins."""
        io = self._io
        functions = super().functions() | {
            "get_standard_analog_in": lambda thread, n: io.analog_in[n].value,
            "get_tool_analog_in": lambda thread, n: io.tool_analog_in[n].value,
            "get_standard_analog_out": lambda thread, n: io.analog_out[n].value,
            "get_analog_in": lambda thread, n: (*io.analog_in, *io.tool_analog_in)[n].value,
            "get_analog_out": lambda thread, n: io.analog_out[n].value,
            "set_standard_analog_out": lambda thread, n, f: io.analog_out[n].set_ratio(f),
            "set_analog_out": lambda thread, n, f: io.analog_out[n].set_ratio(f),
            "set_standard_analog_input_domain": lambda thread, n, domain: io.analog_in[n].set_domain(domain),
            "set_tool_analog_input_domain": lambda thread, n, domain: io.tool_analog_in[n].set_domain(domain),
            "set_analog_outputdomain": lambda thread, n, domain: io.analog_out[n].set_domain(domain),
            "get_flag": lambda thread, n: n < len(io.flags) and io.flags[n],
            "set_tool_output_mode": lambda thread, mode: io.set_tool_output_mode(0, mode),
            "set_tool_digital_output_mode": lambda thread, n, mode: io.set_tool_output_mode(1 + n, mode),
            "set_input_actions_to_default": lambda thread: self._configuration.input_actions.clear(),
            "get_euromap_input": lambda thread, n: bool(io.euromap_inputs >> _euromap_port(n) & 1),
            "get_euromap_output": lambda thread, n: bool(io.euromap_outputs >> _euromap_port(n) & 1),
            "set_euromap_output": lambda thread, n, value: io.write_euromap_output(_euromap_port(n), value),
        }
        groups = {f"{name}_": group.bits for name, group in lines.DIGITAL_GROUPS.items()}
        for name, bits in (groups | {"": lines.STANDARD_AND_TOOL}).items():
            functions |= self._digital(name, bits)
        for group in _INPUT_GROUPS:
            functions[f"set_{group}_input_action"] = self._action_setter(group)
        for kind, output in _RUNSTATE_NAMES.items():
            name = f"set_runstate_{output}_to_value"
            functions[name] = partial(self._set_runstate, kind, name)
        for name, listed in _LISTED_OUTPUTS.items():
            functions[name] = partial(self._set_runstates, listed, name)
        return functions

    def _digital(self, group: str, bits: Sequence[int]) -> dict[str, HostFunction]:
        io = self._io
        return {
            f"get_{group}digital_in": lambda thread, n: io.read_digital_in(bits[n]),
            f"get_{group}digital_out": lambda thread, n: io.read_digital_out(bits[n]),
            f"set_{group}digital_out": lambda thread, n, b: io.write_digital_out(bits[n], b),
        }

    @builtin("set_tool_voltage")
    def _set_tool_voltage(self, thread: object, voltage: int) -> None:
        self._io.tool_voltage = voltage

    @builtin("set_flag")
    def _set_flag(self, thread: object, n: int, b: bool) -> None:
        self._io.flags[n] = b

    @builtin("set_tool_communication")
    def _set_tool_line(
        self, thread: object, enabled: bool, baud_rate: int, parity: int, stop_bits: int, *idle_chars: float
    ) -> None:
        if baud_rate not in BAUD_RATES:
            allowed = ", ".join(map(str, BAUD_RATES))
            raise ScriptRuntimeError(
                f"set_tool_communication: baud rate {baud_rate} is not supported; allowed: {allowed}"
            )
        self._io.tool_line = lines.ToolLine(enabled, baud_rate, parity, stop_bits, *idle_chars)

    @builtin("set_baselight_off", "set_baselight_iec", "set_baselight_solid")
    def _accept(self, thread: object, *setting: int) -> None:
        """Accept a setting without effect; the catalogue checks its range."""

    # --- what lines stand for: domains, input actions, outputs that follow the program, Euromap67

    @builtin("set_analog_inputrange")
    def _set_input_range(self, thread: object, port: int, code: int) -> None:
        ranges, line = (
            (_BOX_RANGES, self._io.analog_in[port])
            if port < 2
            else (_TOOL_RANGES, self._io.tool_analog_in[port - 2])
        )
        domain = ranges.get(code)
        if domain is None:
            allowed = ", ".join(map(str, ranges))
            raise ScriptRuntimeError(
                f"set_analog_inputrange: range {code} is not supported on port {port}; allowed: {allowed}"
            )
        line.set_domain(domain)

    @builtin("set_euromap_runstate_dependent_choice")
    def _set_euromap_rule(self, thread: object, n: int, choice: int) -> None:
        self._configuration.set_rule(OutputKind.EUROMAP, _euromap_port(n), lines.RunState(choice))

    def _action_setter(self, group: str) -> HostFunction:
        return lambda thread, port, action: self._configuration.set_input_action(group, port, action)

    def _set_runstate(self, kind: OutputKind, function: str, thread: object, output: int, code: int) -> None:
        # The catalogue checks the codes of the others, which the e-Series has more of.
        if kind in (OutputKind.GP_INTEGER, OutputKind.GP_FLOAT) and code not in range(4):
            raise ScriptRuntimeError(f"{function}: state {code} does not exist; allowed: 0 to 3")
        self._configuration.set_rule(kind, output, lines.RunState(code))

    def _set_runstates(
        self, known: Sequence[tuple[OutputKind, int]], function: str, thread: object, outputs: list[Any]
    ) -> None:
        if not all(i in range(len(known)) for i in outputs):
            raise ScriptRuntimeError(f"{function}: outputs are numbers from 0 to {len(known) - 1}")
        for i, (kind, index) in enumerate(known):
            state = lines.RunState.LOW_WHEN_STOPPED if i in outputs else lines.RunState.KEEP
            self._configuration.set_rule(kind, index, state)


def _euromap_port(number: int) -> int:
    if not 0 <= number < lines.N_EUROMAP:
        raise ScriptRuntimeError(
            f"Euromap67 port {number} does not exist; allowed: 0 to {lines.N_EUROMAP - 1}"
        )
    return number


class RegisterBuiltins(BuiltinGroup):
    """The general purpose registers."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers

    def functions(self) -> dict[str, HostFunction]:
        """Return the builtins."""
        inputs, outputs = self._registers.inputs, self._registers.outputs
        functions: dict[str, HostFunction] = {}
        for kind, read, written in (
            ("boolean", inputs.booleans, outputs.booleans),
            ("integer", inputs.integers, outputs.integers),
            ("float", inputs.floats, outputs.floats),
        ):
            functions[f"read_input_{kind}_register"] = _register_reader(read)
            functions[f"read_output_{kind}_register"] = _register_reader(written)
            functions[f"write_output_{kind}_register"] = partial(_write_register, written, type(written[0]))
        return functions


def _register_reader(memory: MutableSequence[Any]) -> HostFunction:
    return lambda thread, address: memory[address]


def _write_register(
    memory: MutableSequence[Any], kind: type[Any], thread: object, address: int, value: Any
) -> None:
    memory[address] = kind(value)
