"""Expressions in program files, as scripts and as labels have them.

Source: program files and the scripts that PolyScope saved beside them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocol.pose import Pose, T_to_pose, pose_trans
from ur_emulator.errors import ProgramFileError, UndefinedError
from ur_emulator.program_files.installation import Feature, Installation
from ur_emulator.program_files.reader import XmlTree, number_texts
from ur_emulator.program_files.script_writer import identifier, is_identifier
from ur_emulator.program_files.urp_maker import UrpMaker
from ur_emulator.program_files.urp_nodes import CB3, Node

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element


# Signs of PolyScope's expression editor and what a script says for them; labels keep them. The last three are
# inferred.
_SIGNS = str.maketrans({"≟": " == ", "≠": " != ", "≤": " <= ", "≥": " >= "} | {"≔": "=", "×": "*", "÷": "/"})
# Words of the editor for the levels of a line (manual of PolyScope).
_WORDS = {"HI": "True", "LO": "False"}


class Expression(NamedTuple):
    """An expression."""

    script: str
    label: str


def expression_of(maker: UrpMaker, node: Node, element: Element | None = None) -> Expression:
    """Return the expression that an element is, or that of a node.

    UndefinedError if there is none, UnknownNodeError if it has parts that are not known.
    """
    found = node.find("expression") if element is None else node.source.tree.resolve(element)
    if found is None:
        raise node.source.undefined(f"a <{node.kind}> node has no expression")
    parts = [_part(maker, node, child) for child in found]
    expression = Expression("".join(part.script for part in parts), "".join(part.label for part in parts))
    if not expression.script.strip():
        raise node.source.undefined(f"the expression of a <{node.kind}> node is empty")
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
            taught_feature(maker, node, name)
            return Expression(name, name)
        case "ExpressionWaypoint" if len(element):
            waypoint = tree.resolve(element[0])
            name = element[0].get("referenceName") or waypoint.get("name") or ""
            pose = taught_waypoint(maker, node, waypoint.find("position"), name).pose
            if not pose:
                raise node.source.undefined(f"the file has only the joint angles of waypoint {name[:100]!r}")
            return Expression(pose, name)
    pins = element.findall("pin")
    if len(pins) == 1:
        line = line_of(maker.installation, tree.resolve(pins[0]).get("referencedName", ""), tree.name)
        return Expression(line.read, line.label)
    raise node.source.unknown(f"<{element.tag}> in an expression")


def variable_name(node: Node, element: Element | None) -> str:
    """Return the name of the variable or feature that an element is, or stands for; else UndefinedError."""
    name = ""
    if element is not None:
        found = node.source.tree.resolve(element)
        name = found.get("name") or found.get("featureName") or ""
    if not is_identifier(name):
        raise node.source.undefined(f"{name[:100]!r} of a <{node.kind}> node is not the name of a variable")
    return name


def taught_feature(maker: UrpMaker, node: Node, name: str) -> Feature | None:
    """Return the feature of that name, if there is one; UndefinedError if it was never taught."""
    feature = maker.installation.features.get(name)
    if feature is not None and not feature.is_taught:
        raise node.source.undefined(f"a <{node.kind}> node uses feature {name!r}, which was never taught")
    return feature


class TaughtWaypoint(NamedTuple):
    """A fixed waypoint as a script has it: the pose of the tool it was taught with, and the joint angles.

    The pose is in the base frame; "" if the file has only the joint angles.
    """

    pose: str
    q: str


def taught_waypoint(maker: UrpMaker, node: Node, element: Element | None, name: str) -> TaughtWaypoint:
    """Return a position that was taught: globals of its name, or in programs of CB3 the values themselves.

    UndefinedError if there are no joint angles, or numbers are damaged.
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


# --- lines of inputs and outputs in program files: which builtins read and set them
#
# A program calls a line by the name that its installation gives it, else by its own name, such as
# `digital_in[0]`; a Modbus signal by its name. Analogue inputs 2 and 3 are those of the tool. Source: also
# public generators of program files.


@dataclass(frozen=True, slots=True)
class LineKind:
    """A kind of lines.

    Attributes:
        label: how labels call a line without a name of its own, `{n}` being its number.
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
        "GP_bool_out[{n}]", "read_output_boolean_register({n})", "write_output_boolean_register({n}, {value})"
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
    """A line; `n` is its number, or the name of a Modbus signal, and `label` how labels call it."""

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
    """Return the line that a program calls by a name; UndefinedError if there is none."""
    if any(signal.name == name for signal in installation.modbus):
        return Line(_MODBUS, name.replace('"', "'"), name)
    match = _OWN_NAME.fullmatch(installation.lines.get(name, name))
    if match is None or match[1] not in LINES:
        raise UndefinedError(
            f"{file_name}: the installation has no line {name[:100]!r}: "
            "use one of its names, or a line's own, such as digital_in[0]"
        )
    kind, n = LINES[match[1]], int(match[2])
    label = name if name in installation.lines else kind.label.format(n=n)
    if match[1] == "analog_in" and n >= _FIRST_TOOL_ANALOG:
        kind, n = _TOOL_ANALOG, n - _FIRST_TOOL_ANALOG
    return Line(kind, str(n), label)


# --- positions in program files: joint angles, poses, and how a script writes them
#
# A waypoint of e-Series software has joint angles, a tool and the kinematics of the robot it was taught with:
# its pose is FK(angles) * tool. One of CB3 software has its pose beside the angles.

_GREATEST = 1e6
ZERO_POSE = "p[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"


@dataclass(frozen=True, slots=True)
class Position:
    """Where a waypoint is.

    Attributes:
        q: list of the six joint angles [rad] as a script has it.
        pose: of the tool centre point it was taught with, in the base frame [m, rad]; None if the file has
            neither the pose nor what it is computed from.
    """

    q: str
    pose: Pose | None


def pose_of(tree: XmlTree, text: str | None, what: str) -> Pose:
    """Return the pose that six numbers with commas between are; UndefinedError if they are not."""
    x, y, z, rx, ry, rz = _moderate(tree, number_texts(tree, text, what), what)
    return (x, y, z, rx, ry, rz)


def _moderate(tree: XmlTree, texts: list[str], what: str) -> list[float]:
    """Return numbers that can be computed with: lengths [m] and angles [rad] of a robot."""
    values = list(map(float, texts))
    if max(map(abs, values)) > _GREATEST:
        raise ProgramFileError(f"{tree.name}: {what} has a number beyond {_GREATEST:g}")
    return values


def pose_text(pose: Pose) -> str:
    """Return a pose as PolyScope writes it: 12 decimals, no zero before the point."""
    return f"p[{', '.join(_decimals(one) for one in pose)}]"


def _decimals(value: float) -> str:
    text = f"{value:.12f}"
    if text.startswith("0."):
        return text[1:]
    return f"-{text[2:]}" if text.startswith("-0.") else text


def position_of(tree: XmlTree, element: Element | None, what: str) -> Position:
    """Return the position in a `<position>` element, or in one like it.

    UndefinedError if there are no joint angles, or numbers are damaged.
    """
    if element is None:
        raise UndefinedError(f"{tree.name}: {what} has no position")
    angles = element.find("JointAngles")
    joints = number_texts(tree, element.get("joints") if angles is None else angles.get("angles"), what)
    given = element.get("pose")
    pose = pose_of(tree, given, what) if given else _taught_pose(tree, element, joints, what)
    return Position(f"[{', '.join(joints)}]", pose)


def _taught_pose(tree: XmlTree, element: Element, joints: list[str], what: str) -> Pose | None:
    kinematics = element.find("Kinematics")
    offset = element.find("TCPOffset")
    if kinematics is None or offset is None:
        return None
    rows = {}
    known = tree.resolve(kinematics)
    for name in ("deltaTheta", "a", "d", "alpha"):
        row = known.find(name)
        rows[name] = pose_of(tree, None if row is None else row.get("value"), f"{name} of {what}")
    flange = np.eye(4)
    for joint, delta, a, d, alpha in zip(_moderate(tree, joints, what), *rows.values(), strict=True):
        flange = flange @ _link(joint + delta, a, d, alpha)
    return pose_trans(
        T_to_pose(flange), pose_of(tree, tree.resolve(offset).get("pose"), f"the tool of {what}")
    )


def _link(theta: float, a: float, d: float, alpha: float) -> NDArray[np.float64]:
    """Return the transform of a link by its Denavit-Hartenberg parameters."""
    ct, st, ca, sa = math.cos(theta), math.sin(theta), math.cos(alpha), math.sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, a * ct],
            [st, ct * ca, -ct * sa, a * st],
            [0.0, sa, ca, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
