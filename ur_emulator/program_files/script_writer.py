"""What a script of PolyScope consists of: names, the head of an installation, and lines with their labels."""

import re
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

from protocol.script_channel import MAX_PROGRAM
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import ProgramFileError
from ur_emulator.machine.controller.io.lines import RunState
from ur_emulator.machine.controller.io.network import FREEDRIVE_ACTION
from ur_emulator.program_files.installation import ExternalControlPc, Installation, OutputRule
from urscript.values import to_script_text

# --- names of programs, functions, threads and variables in scripts
#
# Source: names of programs and the names of the functions in the scripts that PolyScope saved beside them.

_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


def is_identifier(name: str) -> bool:
    """True for a name that a script can have as it is."""
    return _IDENTIFIER.fullmatch(name) is not None


def identifier(name: str) -> str:
    """Return the name of a program's function.

    A full stop is left out, a letter that is not ASCII becomes `u` and its decimal code, what else is neither
    letter nor digit becomes `_`, and a `P` stands before a digit at the start.
    """
    plain = "".join(_character(one) for one in name)
    return plain if is_identifier(plain) else f"P{plain}"


def _character(one: str) -> str:
    if one == ".":
        return ""
    if one.isascii():
        return one if one.isalnum() else "_"
    return f"u{ord(one)}"


class Names:
    """Names that are taken, so that each is unique."""

    def __init__(self) -> None:
        self._taken: dict[str, int] = {}  # with the number that was tried last

    def reserve(self, name: str) -> None:
        """Note that a name is taken."""
        self._taken.setdefault(name, 1)

    def new(self, wanted: str) -> str:
        """Return a name like the wanted one that is not taken yet, and take it."""
        plain = name = identifier(wanted)
        while name in self._taken:
            self._taken[plain] += 1
            name = f"{plain}_{self._taken[plain]}"
        self._taken[name] = 1
        return name


# --- the lines at the head of a script that PolyScope makes: what the installation declares
#
# They have the form of software 3.15, whatever software has saved the installation. The order of the blocks
# differs among real scripts; nothing depends on it.


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


@dataclass(frozen=True, slots=True)
class Gap:
    """A place for what a PC sends when the program is played; `indent` blanks before each line."""

    pc: ExternalControlPc
    indent: str


@dataclass(frozen=True, slots=True)
class Header:
    """A place for what the installation declares; its variables change while a program is loaded."""


Part = str | Gap | Header


class ScriptWriter:
    """The script so far: texts of whole lines, and places for others, in order."""

    def __init__(self) -> None:
        self.parts: list[Part] = []
        self._depth = 0
        self._size = 0
        self._gaps = 0

    @property
    def place(self) -> tuple[int, int]:
        """The end of the script so far: how many parts are before it, in how many open blocks it is."""
        return len(self.parts), self._depth

    def take(self, place: tuple[int, int]) -> list[Part]:
        """Remove what was written since a place, and return it; it may be put into another place."""
        length, self._depth = place
        taken = self.parts[length:]
        del self.parts[length:]
        return taken

    def add(self, *texts: str) -> None:
        """Write lines, one character a byte; a text of several lines is written as it is, each one indented.

        ProgramFileError if the script becomes longer than a box takes.
        """
        indent = "  " * self._depth
        for text in texts:
            plain = to_script_text(text).replace("\r\n", "\n").rstrip("\n")
            self._size += len(plain) + (1 + plain.count("\n")) * (len(indent) + 1)
            if self._size > MAX_PROGRAM:
                raise ProgramFileError(f"a script of more than {MAX_PROGRAM} bytes comes of the program")
            self.parts.append(indent + plain.replace("\n", "\n" + indent))

    def label(self, number: int, text: str, mark: str = "") -> None:
        """Write the label of a node as PolyScope does; the mark is "breakAfter", "noBreak" or nothing."""
        name = " ".join(text.splitlines()).replace('"', "'")
        self.add(f'$ {number} "{name}"' + (f' "{mark}"' if mark else ""))

    def gap(self, pc: ExternalControlPc) -> None:
        """Add a gap for a program that comes later; ProgramFileError if there are too many."""
        self._gaps += 1
        if self._gaps > BUDGETS.external_control_nodes:
            raise ProgramFileError(
                f"the program has more than {BUDGETS.external_control_nodes} nodes of External Control"
            )
        self.parts.append(Gap(pc, "  " * self._depth))

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Write a block, `head` being its first line."""
        with self.branch(head):
            yield
        self.add("end")

    @contextmanager
    def branch(self, head: str) -> Iterator[None]:
        """Write a branch of a block: `head` and the indented lines, without `end`."""
        self.add(head)
        self._depth += 1
        yield
        self._depth -= 1


def one_line(text: str) -> str:
    """Return a text for a string literal of a script; there are no escapes."""
    return " ".join(text.replace('"', "'").split())
