"""Expressions in program files, as scripts and as labels have them.

Source: program files and the scripts that PolyScope saved beside them.
"""

from typing import NamedTuple
from xml.etree.ElementTree import Element

from ur_emulator.program_files.lines import line_of
from ur_emulator.program_files.names import is_identifier
from ur_emulator.program_files.script_writer import ScriptWriter
from ur_emulator.program_files.urp_nodes import Node
from ur_emulator.program_files.urp_positions import only_angles, taught_feature, taught_waypoint

# Signs of PolyScope's expression editor and what a script says for them; labels keep them. The last three are
# inferred.
_SIGNS = str.maketrans({"≟": " == ", "≠": " != ", "≤": " <= ", "≥": " >= "} | {"≔": "=", "×": "*", "÷": "/"})
# Words of the editor for the levels of a line (manual of PolyScope).
_WORDS = {"HI": "True", "LO": "False"}


class Expression(NamedTuple):
    """An expression."""

    script: str
    label: str


def expression_of(writer: ScriptWriter, node: Node, element: Element | None = None) -> Expression:
    """Return the expression that an element is, or that of a node.

    UndefinedError if there is none, UnknownNodeError if it has parts that are not known.
    """
    found = node.find("expression") if element is None else node.tree.resolve(element)
    if found is None:
        raise node.tree.undefined(f"a <{node.kind}> node has no expression")
    parts = [_part(writer, node, child) for child in found]
    expression = Expression("".join(part.script for part in parts), "".join(part.label for part in parts))
    if not expression.script.strip():
        raise node.tree.undefined(f"the expression of a <{node.kind}> node is empty")
    return expression


def _part(writer: ScriptWriter, node: Node, element: Element) -> Expression:
    tree = node.tree
    match element.tag:
        case "ExpressionChar":
            character = element.get("character", "")
            return Expression(character.translate(_SIGNS), character)
        case "ExpressionToken":
            token = element.get("token", "")
            return Expression(f" {_WORDS.get(token.strip(), token).translate(_SIGNS)} ", token)
        case "ExpressionVariable" if len(element):
            name = variable_name(node, element[0])
            taught_feature(writer, node, name)
            return Expression(name, name)
        case "ExpressionWaypoint" if len(element):
            waypoint = tree.resolve(element[0])
            name = element[0].get("referenceName") or waypoint.get("name") or ""
            pose, _ = taught_waypoint(writer, node, waypoint.find("position"), name)
            if not pose:
                raise only_angles(node, name)
            return Expression(pose, name)
    pins = element.findall("pin")
    if len(pins) == 1:
        line = line_of(writer.installation, tree.resolve(pins[0]).get("referencedName", ""), tree)
        return Expression(line.read, line.label)
    raise node.tree.unknown(f"<{element.tag}> in an expression")


def variable_name(node: Node, element: Element | None = None) -> str:
    """Return the name of the variable or feature that an element is, or stands for; else UndefinedError.

    Without an element: of the variable of the node.
    """
    given = node.element.find("variable") if element is None else element
    found = None if given is None else node.tree.resolve(given)
    name = "" if found is None else found.get("name") or found.get("featureName") or ""
    if not is_identifier(name):
        raise node.tree.undefined(f"{name[:100]!r} of a <{node.kind}> node is not the name of a variable")
    return name
