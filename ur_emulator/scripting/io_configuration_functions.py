"""Builtins that set up lines: domains, input actions, outputs that follow the program, Euromap67."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ur_emulator.controller.io.configuration import IoConfiguration, OutputKind
from ur_emulator.controller.io.euromap import N_EUROMAP, Euromap
from ur_emulator.controller.io.lines import (
    CONFIGURABLE,
    CURRENT,
    STANDARD,
    TOOL,
    VOLTAGE,
    AnalogLine,
    InputOutput,
)
from ur_emulator.controller.io.run_states import RunState
from urscript.errors import ScriptRuntimeError

Function = Callable[..., Any]

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
