"""Expressions in program files, as scripts and as labels have them.

Source: program files and the scripts that PolyScope saved beside them.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocol.pose import Pose, T_to_pose, pose_trans
from ur_emulator.errors import UndefinedError
from ur_emulator.machine.models.robot_model import Vector6, six
from ur_emulator.program_files.installation import Feature
from ur_emulator.program_files.lines import line_of
from ur_emulator.program_files.reader import CB3, XmlTree
from ur_emulator.program_files.script_writer import identifier, is_identifier
from ur_emulator.program_files.urp_maker import UrpMaker
from ur_emulator.program_files.urp_nodes import Node

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
    found = node.find("expression") if element is None else node.tree.resolve(element)
    if found is None:
        raise node.tree.undefined(f"a <{node.kind}> node has no expression")
    parts = [_part(maker, node, child) for child in found]
    expression = Expression("".join(part.script for part in parts), "".join(part.label for part in parts))
    if not expression.script.strip():
        raise node.tree.undefined(f"the expression of a <{node.kind}> node is empty")
    return expression


def _part(maker: UrpMaker, node: Node, element: Element) -> Expression:
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
            taught_feature(maker, node, name)
            return Expression(name, name)
        case "ExpressionWaypoint" if len(element):
            waypoint = tree.resolve(element[0])
            name = element[0].get("referenceName") or waypoint.get("name") or ""
            pose, _ = taught_waypoint(maker, node, waypoint.find("position"), name)
            if not pose:
                raise only_angles(node, name)
            return Expression(pose, name)
    pins = element.findall("pin")
    if len(pins) == 1:
        line = line_of(maker.installation, tree.resolve(pins[0]).get("referencedName", ""), tree)
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


def taught_feature(maker: UrpMaker, node: Node, name: str) -> Feature | None:
    """Return the feature of that name, if there is one; UndefinedError if it was never taught."""
    feature = maker.installation.features.get(name)
    if feature is not None and not feature.is_taught:
        raise node.tree.undefined(f"a <{node.kind}> node uses feature {name!r}, which was never taught")
    return feature


def taught_waypoint(maker: UrpMaker, node: Node, element: Element | None, name: str) -> tuple[str, str]:
    """Return pose and joint angles of a position that was taught, as a script has them.

    They are globals of its name, or in programs of CB3 the values themselves. The pose is in the base frame,
    of the tool it was taught with; "" if the file has only the joint angles. UndefinedError if there are no
    joint angles, or numbers are damaged.
    """
    q, pose = position_of(node.tree, element, f"waypoint {name[:100]!r}")
    if pose is None or node.tree.series == CB3:
        return "" if pose is None else pose_text(pose), q
    plain = identifier(name)
    maker.declare(f"waypoint {plain}", f"global {plain}_p={pose_text(pose)}", f"global {plain}_q={q}")
    return f"{plain}_p", f"{plain}_q"


def only_angles(node: Node, name: str) -> UndefinedError:
    """Return the error for a waypoint whose pose is needed, and not in the file."""
    return node.tree.undefined(f"the file has only the joint angles of waypoint {name[:100]!r}")


# --- positions in program files: joint angles, poses, and how a script writes them
#
# A waypoint of e-Series software has joint angles, a tool and the kinematics of the robot it was taught with:
# its pose is FK(angles) * tool. One of CB3 software has its pose beside the angles.

_GREATEST = 1e6
ZERO_POSE = "p[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"


def pose_of(tree: XmlTree, text: str | None, what: str) -> Pose:
    """Return the pose that six numbers with commas between are; UndefinedError if they are not."""
    return _moderate(tree, tree.vector6(text, what), what)


def _moderate(tree: XmlTree, values: Vector6, what: str) -> Vector6:
    """Return numbers that can be computed with: lengths [m] and angles [rad] of a robot."""
    if max(map(abs, values)) > _GREATEST:
        raise tree.error(f"{what} has a number beyond {_GREATEST:g}")
    return values


def pose_text(pose: Pose) -> str:
    """Return a pose as PolyScope writes it: 12 decimals, no zero before the point."""
    return f"p[{', '.join(_decimals(one) for one in pose)}]"


def _decimals(value: float) -> str:
    text = f"{value:.12f}"
    if text.startswith("0."):
        return text[1:]
    return f"-{text[2:]}" if text.startswith("-0.") else text


def position_of(tree: XmlTree, element: Element | None, what: str) -> tuple[str, Pose | None]:
    """Return the position in a `<position>` element, or in one like it.

    That is the list of the six joint angles [rad] as a script has it; and the pose of the tool centre point
    it was taught with, in the base frame [m, rad], None if the file has neither the pose nor what it is
    computed from. UndefinedError if there are no joint angles, or numbers are damaged.
    """
    if element is None:
        raise tree.undefined(f"{what} has no position")
    angles = element.find("JointAngles")
    joints = tree.number_texts(element.get("joints") if angles is None else angles.get("angles"), what)
    given = element.get("pose")
    pose = pose_of(tree, given, what) if given else _taught_pose(tree, element, joints, what)
    return f"[{', '.join(joints)}]", pose


def _taught_pose(tree: XmlTree, element: Element, joints: list[str], what: str) -> Pose | None:
    kinematics = element.find("Kinematics")
    offset = element.find("TCPOffset")
    if kinematics is None or offset is None:
        return None
    rows = []
    known = tree.resolve(kinematics)
    for name in ("deltaTheta", "a", "d", "alpha"):
        row = known.find(name)
        rows.append(pose_of(tree, None if row is None else row.get("value"), f"{name} of {what}"))
    flange = np.eye(4)
    q = _moderate(tree, six(list(map(float, joints))), what)
    for joint, delta, a, d, alpha in zip(q, *rows, strict=True):
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
