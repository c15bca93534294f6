"""Lines of inputs and outputs in programs and installations, and the builtins that read and set them.

A program calls a line by the name that its installation gives it, else by its own name, such as
`digital_in[0]`; a Modbus signal by its name. Source: also public generators of program files.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

from ur_emulator.program_files.installation import Installation
from ur_emulator.program_files.reader import XmlTree


@dataclass(frozen=True, slots=True)
class LineKind:
    """A kind of lines.

    Attributes:
        name: own name of its lines, before the number.
        element: with what the elements of an installation begin that have names and actions of its lines.
        label: how labels call a line without a name of its own, before the number.
        group: as in the names of builtins.
        actions: how many of its lines can have an action in an installation.
        first: number of its first line in own names.
    """

    name: str
    element: str
    label: str
    group: str
    actions: int = 0
    first: int = 0

    @property
    def is_input(self) -> bool:
        """True for lines that a program cannot set."""
        return self.name.endswith("_in")

    def read(self, n: int) -> str:
        """Return the call that reads a line."""
        way = "in" if self.is_input else "out"
        if self.group.startswith("gp_"):
            return f"read_{way}put_{self.group.removeprefix('gp_')}_register({n})"
        return f"get_{self.group}_{way}({n})"

    def writes(self, n: int) -> dict[bool, str]:
        """Return the calls that set a line, by its level; none for inputs and for what is no digital line."""
        if self.is_input or not self.group.endswith(("_digital", "_boolean")):
            return {}
        call = "write_output_boolean_register" if self.group == "gp_boolean" else f"set_{self.group}_out"
        return {level: f"{call}({n}, {level})" for level in (False, True)}


# In the order in which names and actions of an installation are read.
LINE_KINDS = (
    LineKind("digital_in", "DigitalInput", "DI", "standard_digital", 8),
    LineKind("digital_out", "DigitalOutput", "DO", "standard_digital", 8),
    LineKind("config_in", "ConfigurableInput", "CI", "configurable_digital", 8),
    LineKind("config_out", "ConfigurableOutput", "CO", "configurable_digital", 8),
    LineKind("tool_in", "ToolDigitalInput", "TI", "tool_digital", 2),
    LineKind("tool_out", "ToolDigitalOutput", "TO", "tool_digital", 2),
    LineKind("analog_in", "AnalogInput", "AI", "standard_analog"),
    LineKind("analog_in", "ToolAnalogInput", "AI", "tool_analog", first=2),
    LineKind("analog_out", "AnalogOutput", "AO", "standard_analog", 2),
    LineKind("GP_bool_in", "GeneralPurposeBooleanRegisterInput", "GP_bool_in", "gp_boolean", 64),
    LineKind("GP_bool_out", "GeneralPurposeBooleanRegisterOutput", "GP_bool_out", "gp_boolean", 64),
    LineKind("GP_int_in", "GeneralPurposeIntRegisterInput", "GP_int_in", "gp_integer"),
    LineKind("GP_int_out", "GeneralPurposeIntRegisterOutput", "GP_int_out", "gp_integer", 24),
    LineKind("GP_float_in", "GeneralPurposeFloatRegisterInput", "GP_float_in", "gp_float"),
    LineKind("GP_float_out", "GeneralPurposeFloatRegisterOutput", "GP_float_out", "gp_float", 24),
)
_OWN_NAME = re.compile(r"([A-Za-z_]+)\[(\d{1,3})\]")


@dataclass(frozen=True, slots=True)
class Line:
    """A line.

    Attributes:
        label: how labels call it.
        read: the call that reads it.
        writes: the calls that set it, by its level; none for an input.
    """

    label: str
    read: str
    writes: Mapping[bool, str]


def line_of(installation: Installation, name: str, tree: XmlTree) -> Line:
    """Return the line that a program calls by a name; UndefinedError if there is none."""
    if any(signal.name == name for signal in installation.modbus):
        text = name.replace('"', "'")
        writes = {level: f'modbus_set_output_signal("{text}", {level}, False)' for level in (False, True)}
        return Line(name, f'modbus_get_signal_status("{text}")', writes)
    match = _OWN_NAME.fullmatch(installation.lines.get(name, name))
    n = int(match[2]) if match else 0
    kinds = [kind for kind in LINE_KINDS if match and kind.name == match[1] and kind.first <= n]
    if not kinds:
        raise tree.undefined(
            f"the installation has no line {name[:100]!r}: "
            "use one of its names, or a line's own, such as digital_in[0]"
        )
    kind = kinds[-1]
    label = name if name in installation.lines else f"{kind.label}[{n}]"
    return Line(label, kind.read(n - kind.first), kind.writes(n - kind.first))
