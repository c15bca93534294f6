"""Positions in program files: joint angles, poses, and how a script writes them.

A waypoint of e-Series software has joint angles, a tool and the kinematics of the robot it was taught with:
its pose is FK(angles) * tool. One of CB3 software has its pose beside the angles.
Source: program files and the scripts that PolyScope saved beside them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from protocol.pose import Pose, T_to_pose, pose_trans
from ur_emulator.errors import ProgramFileError
from ur_emulator.programs.urp_values import number_texts
from ur_emulator.programs.xml_tree import XmlTree

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

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
    """Return the pose that six numbers with commas between are.

    Raises:
        ProgramFileError: they are not six numbers.
    """
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

    Raises:
        ProgramFileError: there are no joint angles, or numbers are damaged.
    """
    if element is None:
        raise ProgramFileError(f"{tree.name}: {what} has no position")
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
