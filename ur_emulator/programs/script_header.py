"""The lines at the head of a script that PolyScope makes: what the installation declares.

They have the form of software 3.15, whatever software has saved the installation. The order of the blocks
differs among real scripts; nothing depends on it.
"""

from __future__ import annotations

import uuid
from collections.abc import Iterator, Sequence

from ur_emulator.controller.io.configuration import FREEDRIVE_ACTION
from ur_emulator.controller.io.run_states import RunState
from ur_emulator.programs.installation import Installation, OutputRule
from ur_emulator.programs.script_names import is_identifier


def header_lines(installation: Installation) -> Iterator[str]:
    """Yield the lines behind `def`, each without indentation of its own."""
    yield from _settings(installation)
    yield from _step_counter(installation)
    yield from _modbus(installation)
    for name, value in installation.variables.items():
        yield f"global {name}={value}"
    for name in sorted(installation.features):
        feature = installation.features[name]
        if feature.is_variable and is_identifier(name):
            yield f"global {name}=p{_numbers(feature.pose)}"


def setup_script(installation: Installation, before: Installation) -> str:
    """Return the secondary program that makes an installation effective while no program runs.

    Args:
        installation: to be effective.
        before: what was; its rules and signals end.
    """
    lines = (
        *(_rule(OutputRule(rule.group, rule.index, RunState.KEEP)) for rule in before.output_rules),
        *(f'modbus_delete_signal("{signal.name}")' for signal in before.modbus),
        *_settings(installation),
        *_modbus(installation),
    )
    return "sec installation():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"


def _settings(installation: Installation) -> Iterator[str]:
    domains = installation.analog_in_domains
    for port in (0, 1):
        yield f"set_standard_analog_input_domain({port}, {domains[port]})"
    for port in (0, 1):
        yield f"set_tool_analog_input_domain({port}, {domains[2 + port]})"
    for port in (0, 1):
        yield f"set_analog_outputdomain({port}, {installation.analog_out_domains[port]})"
    yield f"set_tool_voltage({installation.tool_voltage})"
    yield "set_input_actions_to_default()"
    for group, index, action in installation.input_actions:
        if action.lower() == FREEDRIVE_ACTION:
            yield f'set_{group}_input_action({index}, "{FREEDRIVE_ACTION}")'
    low = [
        rule.index
        for rule in installation.output_rules
        if (rule.group, rule.state) == ("standard_digital", RunState.LOW_WHEN_STOPPED)
    ]
    if low:
        yield f"set_runstate_standard_digital_outputs({low})"
    yield from map(_rule, installation.output_rules)
    yield f"set_safety_mode_transition_hardness({installation.transition_hardness})"
    yield f"set_tcp(p{_numbers(installation.tcp_offset)})"
    payload = installation.payload
    yield f"set_payload({payload.mass!r}{'' if payload.cog is None else f', {_numbers(payload.cog)}'})"
    yield f"set_gravity({_numbers(installation.gravity)})"


def _rule(rule: OutputRule) -> str:
    return f"set_runstate_{rule.group}_output_to_value({rule.index}, {int(rule.state)})"


def _step_counter(installation: Installation) -> Iterator[str]:
    """Yield the thread that counts cycles; its name is new in each session of PolyScope, here it is not."""
    mark = str(uuid.uuid5(uuid.NAMESPACE_URL, installation.wire_path)).replace("-", "_")
    name = f"step_count_{mark}"
    yield f"{name} = 0.0"
    yield f"thread Step_Counter_Thread_{mark}():"
    yield "  while (True):"
    yield f"    {name} = {name} + 1.0"
    yield "    sync()"
    yield "  end"
    yield "end"
    yield f"run Step_Counter_Thread_{mark}()"


def _modbus(installation: Installation) -> Iterator[str]:
    for signal in installation.modbus:
        place = f'"{signal.host}", {signal.slave}, {signal.address}, {int(signal.type)}'
        yield f'modbus_add_signal({place}, "{signal.name}", {signal.sequential})'
        if signal.frequency is not None:
            yield f'modbus_set_signal_update_frequency("{signal.name}", {signal.frequency:g})'
    for signal in installation.modbus:
        if signal.type.is_output:
            yield f'modbus_set_runstate_dependent_choice("{signal.name}",{int(signal.rule)})'


def _numbers(values: Sequence[float]) -> str:
    return f"[{', '.join(map(repr, values))}]"
