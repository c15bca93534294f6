"""Expressions in program files, as scripts and as labels have them.

Source: program files and the scripts that PolyScope saved beside them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from ur_emulator.programs.script_names import identifier, is_identifier
from ur_emulator.programs.urp_lines import line_of
from ur_emulator.programs.urp_maker import UrpMaker
from ur_emulator.programs.urp_nodes import CB3, Node
from ur_emulator.programs.urp_positions import pose_text, position_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

# Signs of PolyScope's expression editor and what a script says for them; labels keep them. The last three are
# inferred.
_SIGNS = str.maketrans(
    {"≟": " == ", "≠": " != ", "≤": " <= ", "≥": " >= "} | {"≔": "=", "×": "*", "÷": "/"},
)
# Words of the editor for the levels of a line (manual of PolyScope).
_WORDS = {"HI": "True", "LO": "False"}


class Expression(NamedTuple):
    """An expression.

    Attributes:
        script: its text in a script.
        label: its text in a label.
    """

    script: str
    label: str


def expression_of(maker: UrpMaker, node: Node, element: Element | None = None) -> Expression:
    """Return the expression of a node.

    Args:
        maker: writes the program.
        node: that the expression belongs to.
        element: the expression; if it is not given, that of the node.

    Raises:
        ProgramFileError: there is none, or it has parts that are not known.
    """
    found = node.find("expression") if element is None else node.source.tree.resolve(element)
    if found is None:
        raise node.source.error(f"a <{node.kind}> node has no expression")
    parts = [_part(maker, node, child) for child in found]
    expression = Expression("".join(part.script for part in parts), "".join(part.label for part in parts))
    if not expression.script.strip():
        raise node.source.error(f"the expression of a <{node.kind}> node is empty")
    return expression


def _part(maker: UrpMaker, node: Node, element: Element) -> Expression:
    tree = node.source.tree
    match element.tag:
        case "ExpressionChar":
            character = element.get("character", "")
            return Expression(character.translate(_SIGNS), character)
        case "ExpressionToken":
            token = element.get("token", "")
            return Expression(f" {_WORDS.get(token.strip(), token).translate(_SIGNS)} ", token)
        case "ExpressionVariable" if len(element):
            name = variable_name(node, element[0])
            return Expression(name, name)
        case "ExpressionWaypoint" if len(element):
            waypoint = tree.resolve(element[0])
            name = element[0].get("referenceName") or waypoint.get("name") or ""
            pose = taught_waypoint(maker, node, waypoint.find("position"), name).pose
            if not pose:
                raise node.source.error(f"the file has only the joint angles of waypoint {name[:100]!r}")
            return Expression(pose, name)
    pins = element.findall("pin")
    if len(pins) == 1:
        line = line_of(maker.installation, tree.resolve(pins[0]).get("referencedName", ""), tree.name)
        return Expression(line.read, line.label)
    raise node.source.unknown(f"<{element.tag}> in an expression")


def variable_name(node: Node, element: Element | None) -> str:
    """Return the name of the variable or feature that an element is, or stands for.

    Raises:
        ProgramFileError: it has none.
    """
    name = ""
    if element is not None:
        found = node.source.tree.resolve(element)
        name = found.get("name") or found.get("featureName") or ""
    if not is_identifier(name):
        raise node.source.error(f"{name[:100]!r} is not the name of a variable")
    return name


class TaughtWaypoint(NamedTuple):
    """A fixed waypoint as a script has it.

    Attributes:
        pose: of the tool it was taught with, in the base frame; "" if the file has only the joint angles.
        q: joint angles.
    """

    pose: str
    q: str


def taught_waypoint(maker: UrpMaker, node: Node, element: Element | None, name: str) -> TaughtWaypoint:
    """Return a position that was taught: globals of its name, or in programs of CB3 the values themselves.

    Args:
        maker: writes the program.
        node: that names the position.
        element: the position.
        name: of the waypoint.

    Raises:
        ProgramFileError: there are no joint angles, or numbers are damaged.
    """
    position = position_of(node.source.tree, element, f"waypoint {name[:100]!r}")
    if position.pose is None:
        return TaughtWaypoint("", position.q)
    pose = pose_text(position.pose)
    if node.source.series == CB3:
        return TaughtWaypoint(pose, position.q)
    plain = identifier(name)
    written = TaughtWaypoint(f"{plain}_p", f"{plain}_q")
    maker.declare(f"waypoint {plain}", f"global {written.pose}={pose}", f"global {written.q}={position.q}")
    return written
