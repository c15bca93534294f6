"""Features and taught positions in program files, as scripts have them.

A waypoint of e-Series software has joint angles, a tool and the kinematics of the robot it was taught with:
its pose is FK(angles) * tool. One of CB3 software has its pose beside the angles.
"""

import math
import re
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from protocol.pose import Pose, T_to_pose, pose_trans
from ur_emulator.errors import UndefinedError
from ur_emulator.program_files.installation import Feature
from ur_emulator.program_files.names import identifier
from ur_emulator.program_files.reader import XmlTree
from ur_emulator.program_files.script_writer import ScriptWriter
from ur_emulator.program_files.urp_nodes import Node

BASE, TOOL = "Joint_0_name", "Joint_6_name"  # names of the base and the tool as features
_ZERO_POSE = "p[0.0, 0.0, 0.0, 0.0, 0.0, 0.0]"
_GREATEST = 1e6
_ZERO_BEFORE_POINT = re.compile(r"\b0\.")


def feature_name(node: Node) -> str:
    """Return the name of the feature that a node names; "" for none."""
    return node.value("feature", "referencedName") or node.value("feature", "featureName")


def taught_feature(writer: ScriptWriter, node: Node, name: str) -> Feature | None:
    """Return the feature of that name, if there is one; UndefinedError if it was never taught."""
    feature = writer.installation.features.get(name)
    if feature is not None and not feature.is_taught:
        raise node.tree.undefined(f"a <{node.kind}> node uses feature {name!r}, which was never taught")
    return feature


def variable_feature(writer: ScriptWriter, move: Node) -> str:
    """Return the variable of the feature that a move follows; "" for base, tool, or a fixed feature."""
    name = feature_name(move)
    feature = taught_feature(writer, move, name)
    return name if feature is not None and feature.is_variable else ""


def frame_of(writer: ScriptWriter, node: Node, tool: str) -> str:
    """Return the pose of the feature that a node names, in the base frame, as a script has it.

    `tool` is what a script has for the tool. UndefinedError if there is no such feature, or it is not taught.
    """
    name = feature_name(node)
    if name in ("", BASE):
        return _ZERO_POSE
    if name == TOOL:
        return tool
    feature = taught_feature(writer, node, name)
    if feature is None:
        raise node.tree.undefined(f"the installation has no feature {name[:100]!r}")
    return name if feature.is_variable else pose_text(feature.pose)


def taught_waypoint(writer: ScriptWriter, node: Node, element: Element | None, name: str) -> tuple[str, str]:
    """Return pose and joint angles of a position that was taught, as a script has them.

    They are globals of its name, or in programs of CB3 the values themselves. The pose is in the base frame,
    of the tool it was taught with; "" if the file has only the joint angles. UndefinedError if there are no
    joint angles, or numbers are damaged.
    """
    q, pose = position_of(node.tree, element, f"waypoint {name[:100]!r}")
    if pose is None or node.tree.is_cb3:
        return "" if pose is None else pose_text(pose), q
    plain = identifier(name)
    writer.declare(f"waypoint {plain}", f"global {plain}_p={pose_text(pose)}", f"global {plain}_q={q}")
    return f"{plain}_p", f"{plain}_q"


def only_angles(node: Node, name: str) -> UndefinedError:
    """Return the error for a waypoint whose pose is needed, and not in the file."""
    return node.tree.undefined(f"the file has only the joint angles of waypoint {name[:100]!r}")


def pose_of(tree: XmlTree, text: str | None, what: str) -> Pose:
    """Return six numbers with commas between, in m and rad; UndefinedError if they are not."""
    pose = tree.vector6(text, what)
    if max(map(abs, pose)) > _GREATEST:
        raise tree.error(f"{what} has a number beyond {_GREATEST:g}")
    return pose


def pose_text(pose: Pose) -> str:
    """Return a pose as PolyScope writes it: 12 decimals, no zero before the point."""
    text = ", ".join(f"{one:.12f}" for one in pose)
    return f"p[{_ZERO_BEFORE_POINT.sub('.', text)}]"


def position_of(tree: XmlTree, element: Element | None, what: str) -> tuple[str, Pose | None]:
    """Return the position in a `<position>` element, or in one like it.

    That is the list of the six joint angles [rad] as a script has it; and the pose of the tool centre point
    it was taught with, in the base frame [m, rad], None if the file has neither the pose nor what it is
    computed from. UndefinedError if there are no joint angles, or numbers are damaged.
    """
    if element is None:
        raise tree.undefined(f"{what} has no position")
    inside = element.find("JointAngles")
    angles = element.get("joints") if inside is None else inside.get("angles")
    q = f"[{', '.join(tree.number_texts(angles, what))}]"
    if given := element.get("pose"):
        return q, pose_of(tree, given, what)
    kinematics = element.find("Kinematics")
    offset = element.find("TCPOffset")
    if kinematics is None or offset is None:
        return q, None
    known = tree.resolve(kinematics)
    rows = []
    for name in ("deltaTheta", "a", "d", "alpha"):
        row = known.find(name)
        rows.append(pose_of(tree, None if row is None else row.get("value"), f"{name} of {what}"))
    flange = np.eye(4)
    for joint, delta, a, d, alpha in zip(pose_of(tree, angles, what), *rows, strict=True):
        flange = flange @ _link(joint + delta, a, d, alpha)
    tool = pose_of(tree, tree.resolve(offset).get("pose"), f"the tool of {what}")
    return q, pose_trans(T_to_pose(flange), tool)


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
