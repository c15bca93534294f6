"""Values in the nodes of a program: expressions, variables, pins, numbers."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.xml_tree import XmlTree

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# Signs of PolyScope's expression editor and what a script says for them; the first is seen in texts of users,
# the others are inferred.
_SIGNS = str.maketrans({"≟": "==", "≠": "!=", "≤": "<=", "≥": ">=", "≔": "=", "×": "*", "÷": "/"})
# Words of the editor for the levels of a line (manual of PolyScope).
_WORDS = {"HI": "True", "LO": "False"}
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_PIN = re.compile(r"([A-Za-z_]+)\[(\d{1,3})\]")

# Names of lines as PolyScope gives them until an installation renames them, and how a script reads and
# writes them. Source: public generators of program files; analogue inputs 2 and 3 are those of the tool.
PIN_READERS = {
    "digital_in": "get_standard_digital_in({n})",
    "digital_out": "get_standard_digital_out({n})",
    "config_in": "get_configurable_digital_in({n})",
    "config_out": "get_configurable_digital_out({n})",
    "tool_in": "get_tool_digital_in({n})",
    "tool_out": "get_tool_digital_out({n})",
    "analog_in": "get_standard_analog_in({n})",
    "GP_bool_in": "read_input_boolean_register({n})",
    "GP_bool_out": "read_output_boolean_register({n})",
    "GP_int_in": "read_input_integer_register({n})",
    "GP_float_in": "read_input_float_register({n})",
}
PIN_WRITERS = {
    "digital_out": "set_standard_digital_out({n}, {value})",
    "config_out": "set_configurable_digital_out({n}, {value})",
    "tool_out": "set_tool_digital_out({n}, {value})",
    "GP_bool_out": "write_output_boolean_register({n}, {value})",
}
_TOOL_ANALOG = "get_tool_analog_in({n})"
_FIRST_TOOL_ANALOG = 2


def expression_text(tree: XmlTree, element: Element | None, owner: Element) -> str:
    """Return an expression as a script has it.

    Args:
        tree: of the file.
        element: the `<expression>`.
        owner: the node that it belongs to.

    Raises:
        ProgramFileError: there is none, or it has parts that are not known.
    """
    if element is None:
        raise ProgramFileError(f"{tree.name}: a <{owner.tag}> node has no expression")
    text = "".join(_part(tree, child) for child in tree.resolve(element)).strip()
    if not text:
        raise ProgramFileError(f"{tree.name}: the expression of a <{owner.tag}> node is empty")
    return text


def _part(tree: XmlTree, element: Element) -> str:
    match element.tag:
        case "ExpressionChar":
            return element.get("character", "").translate(_SIGNS)
        case "ExpressionToken":
            token = element.get("token", "")
            return _WORDS.get(token.strip(), token).translate(_SIGNS)
        case "ExpressionVariable":
            if len(element):
                return variable_name(tree, element[0])
    pins = element.findall("pin")
    if len(pins) == 1:
        return pin_read(tree, pins[0])
    raise ProgramFileError(f"{tree.name}: <{element.tag}> in an expression cannot be turned into a script")


def variable_name(tree: XmlTree, element: Element | None) -> str:
    """Return the name of the variable that an element is, or stands for.

    Raises:
        ProgramFileError: it has none.
    """
    name = "" if element is None else tree.resolve(element).get("name", "")
    if not _IDENTIFIER.fullmatch(name):
        raise ProgramFileError(f"{tree.name}: {name!r} is not the name of a variable")
    return name


def identifier(name: str) -> str:
    """Return a name that a script can have: what is neither letter nor digit becomes `_`."""
    plain = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return plain if _IDENTIFIER.fullmatch(plain) else f"_{plain}"


def pin_read(tree: XmlTree, element: Element | None) -> str:
    """Return the call that reads a line."""
    kind, n = _pin(tree, element)
    if kind == "analog_in" and n >= _FIRST_TOOL_ANALOG:
        return _TOOL_ANALOG.format(n=n - _FIRST_TOOL_ANALOG)
    return _known(tree, PIN_READERS, kind).format(n=n)


def pin_write(tree: XmlTree, element: Element | None, value: str) -> str:
    """Return the call that sets a line."""
    kind, n = _pin(tree, element)
    return _known(tree, PIN_WRITERS, kind).format(n=n, value=value)


def _pin(tree: XmlTree, element: Element | None) -> tuple[str, int]:
    name = "" if element is None else tree.resolve(element).get("referencedName", "")
    match = _PIN.fullmatch(name)
    if match is None:
        raise ProgramFileError(
            f"{tree.name}: line {name!r} has a name of the installation's: use its own, such as digital_in[0]"
        )
    return match[1], int(match[2])


def _known(tree: XmlTree, table: dict[str, str], kind: str) -> str:
    if kind not in table:
        raise ProgramFileError(f"{tree.name}: line {kind}[...] cannot be used here: use {', '.join(table)}")
    return table[kind]


def digital_level(tree: XmlTree, element: Element) -> str:
    """Return the level that a node names, as a script has it."""
    text = (element.findtext("digitalValue") or "").strip().lower()
    if text not in ("0", "1", "true", "false"):
        raise ProgramFileError(f"{tree.name}: a <{element.tag}> node has the level {text!r}: it is 0 or 1")
    return "True" if text in ("1", "true") else "False"


def number(tree: XmlTree, text: str | None, what: str) -> float:
    """Read a finite number.

    Raises:
        ProgramFileError: it is not a finite number.
    """
    try:
        value = float(text or "")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ProgramFileError(f"{tree.name}: {what} is {text!r}, a number is needed")
    return value


def six_numbers(tree: XmlTree, text: str | None, what: str) -> str:
    """Read six numbers with commas between; return them as a script has them, without brackets.

    Raises:
        ProgramFileError: they are not six numbers.
    """
    parts = (text or "").split(",")
    if len(parts) != 6:
        raise ProgramFileError(f"{tree.name}: {what} has {len(parts)} values, it needs 6")
    return ", ".join(repr(number(tree, part, what)) for part in parts)
