"""What an installation declares, as lines at the head of scripts.

They have the form of software 3.15, whatever software has saved the installation. The order of the blocks
differs among real scripts; nothing depends on it.
"""

import uuid
from collections.abc import Iterator

from ur_emulator.machine.controller.io.lines import RunState
from ur_emulator.machine.controller.io.network import FREEDRIVE_ACTION
from ur_emulator.program_files.installation import Installation, OutputRule
from ur_emulator.program_files.names import is_identifier

# A thread that counts cycles.
_STEP_COUNTER = """\
step_count_{mark} = 0.0
thread Step_Counter_Thread_{mark}():
  while (True):
    step_count_{mark} = step_count_{mark} + 1.0
    sync()
  end
end
run Step_Counter_Thread_{mark}()"""


def header_lines(installation: Installation) -> Iterator[str]:
    """Yield the lines behind `def`, each without indentation of its own."""
    yield from _settings(installation)
    # The mark is new in each session of PolyScope, here it is not.
    mark = str(uuid.uuid5(uuid.NAMESPACE_URL, installation.wire_path)).replace("-", "_")
    yield from _STEP_COUNTER.format(mark=mark).splitlines()
    yield from _modbus(installation)
    for name, value in installation.variables.items():
        yield f"global {name}={value}"
    for name in sorted(installation.features):
        feature = installation.features[name]
        if feature.is_variable and is_identifier(name):
            yield f"global {name}=p{list(feature.pose)}"


def setup_script(installation: Installation, before: Installation) -> str:
    """Return the secondary program that makes an installation effective while no program runs.

    The rules and signals of the installation before end.
    """
    lines = (
        *(_rule(OutputRule(rule.group, rule.index, RunState.KEEP)) for rule in before.output_rules),
        *(f'modbus_delete_signal("{signal.name}")' for signal in before.modbus),
        *_settings(installation),
        *_modbus(installation),
    )
    return "sec installation():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"


def _settings(installation: Installation) -> Iterator[str]:
    domains = (*installation.analog_in_domains, *installation.analog_out_domains)
    calls = ("set_standard_analog_input_domain", "set_tool_analog_input_domain", "set_analog_outputdomain")
    for index, domain in enumerate(domains):
        yield f"{calls[index // 2]}({index % 2}, {domain})"
    yield f"set_tool_voltage({installation.tool_voltage})"
    yield "set_input_actions_to_default()"
    for group, index, action in installation.input_actions:
        if action.lower() == FREEDRIVE_ACTION:
            yield f'set_{group}_input_action({index}, "{FREEDRIVE_ACTION}")'
    low_ones = ("standard_digital", RunState.LOW_WHEN_STOPPED)
    if low := [rule.index for rule in installation.output_rules if (rule.group, rule.state) == low_ones]:
        yield f"set_runstate_standard_digital_outputs({low})"
    yield from map(_rule, installation.output_rules)
    yield f"set_safety_mode_transition_hardness({installation.transition_hardness})"
    yield f"set_tcp(p{list(installation.tcp_offset)})"
    cog = installation.payload_cog
    yield f"set_payload({installation.payload!r}{'' if cog is None else f', {list(cog)}'})"
    yield f"set_gravity({list(installation.gravity)})"


def _rule(rule: OutputRule) -> str:
    return f"set_runstate_{rule.group}_output_to_value({rule.index}, {int(rule.state)})"


def _modbus(installation: Installation) -> Iterator[str]:
    for signal in installation.modbus:
        place = f'"{signal.host}", {signal.slave}, {signal.address}, {int(signal.type)}'
        yield f'modbus_add_signal({place}, "{signal.name}", {signal.sequential})'
        if signal.frequency is not None:
            yield f'modbus_set_signal_update_frequency("{signal.name}", {signal.frequency:g})'
    for signal in installation.modbus:
        if signal.type.is_output:
            yield f'modbus_set_runstate_dependent_choice("{signal.name}",{int(signal.rule)})'
