"""Lines of inputs and outputs in program files: which builtins read and set them.

A program calls a line by the name that its installation gives it, else by its own name, such as
`digital_in[0]`; a Modbus signal by its name. Analogue inputs 2 and 3 are those of the tool. Source: program
files and the scripts that PolyScope saved beside them; public generators of program files.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.installation import Installation


@dataclass(frozen=True, slots=True)
class LineKind:
    """A kind of lines.

    Attributes:
        label: how labels call a line without a name of its own, `{n}` being its number.
        read: call that reads it.
        write: call that sets it, `{value}` being its level; "" for an input.
    """

    label: str
    read: str
    write: str = ""


LINES: Mapping[str, LineKind] = {
    "digital_in": LineKind("DI[{n}]", "get_standard_digital_in({n})"),
    "digital_out": LineKind(
        "DO[{n}]", "get_standard_digital_out({n})", "set_standard_digital_out({n}, {value})"
    ),
    "config_in": LineKind("CI[{n}]", "get_configurable_digital_in({n})"),
    "config_out": LineKind(
        "CO[{n}]", "get_configurable_digital_out({n})", "set_configurable_digital_out({n}, {value})"
    ),
    "tool_in": LineKind("TI[{n}]", "get_tool_digital_in({n})"),
    "tool_out": LineKind("TO[{n}]", "get_tool_digital_out({n})", "set_tool_digital_out({n}, {value})"),
    "analog_in": LineKind("AI[{n}]", "get_standard_analog_in({n})"),
    "analog_out": LineKind("AO[{n}]", "get_standard_analog_out({n})"),
    "GP_bool_in": LineKind("GP_bool_in[{n}]", "read_input_boolean_register({n})"),
    "GP_bool_out": LineKind(
        "GP_bool_out[{n}]",
        "read_output_boolean_register({n})",
        "write_output_boolean_register({n}, {value})",
    ),
    "GP_int_in": LineKind("GP_int_in[{n}]", "read_input_integer_register({n})"),
    "GP_int_out": LineKind("GP_int_out[{n}]", "read_output_integer_register({n})"),
    "GP_float_in": LineKind("GP_float_in[{n}]", "read_input_float_register({n})"),
    "GP_float_out": LineKind("GP_float_out[{n}]", "read_output_float_register({n})"),
}
_MODBUS = LineKind(
    "{n}", 'modbus_get_signal_status("{n}")', 'modbus_set_output_signal("{n}", {value}, False)'
)
_TOOL_ANALOG = LineKind("", "get_tool_analog_in({n})")
_OWN_NAME = re.compile(r"([A-Za-z_]+)\[(\d{1,3})\]")
_FIRST_TOOL_ANALOG = 2


@dataclass(frozen=True, slots=True)
class Line:
    """A line.

    Attributes:
        kind: what reads and sets it.
        n: its number, or the name of a Modbus signal.
        label: how labels call it.
    """

    kind: LineKind
    n: str
    label: str

    @property
    def read(self) -> str:
        """The call that reads it."""
        return self.kind.read.format(n=self.n)

    def write(self, value: str) -> str:
        """Return the call that sets it; "" for an input."""
        return self.kind.write.format(n=self.n, value=value)


def line_of(installation: Installation, name: str, file_name: str) -> Line:
    """Return the line that a program calls by a name.

    Raises:
        ProgramFileError: there is none of that name.
    """
    if any(signal.name == name for signal in installation.modbus):
        return Line(_MODBUS, name.replace('"', "'"), name)
    match = _OWN_NAME.fullmatch(installation.lines.get(name, name))
    if match is None or match[1] not in LINES:
        raise ProgramFileError(
            f"{file_name}: the installation has no line {name[:100]!r}: "
            "use one of its names, or a line's own, such as digital_in[0]"
        )
    kind, n = LINES[match[1]], int(match[2])
    label = name if name in installation.lines else kind.label.format(n=n)
    if match[1] == "analog_in" and n >= _FIRST_TOOL_ANALOG:
        kind, n = _TOOL_ANALOG, n - _FIRST_TOOL_ANALOG
    return Line(kind, str(n), label)
