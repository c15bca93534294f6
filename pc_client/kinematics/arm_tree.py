"""Links and joints of an arm under their ROS names, and a URDF of simple bodies that any viewer can show.

Names, origins and axes are those of the arm's URDF. In example-robot-data its meshes are addresses that only
an installation with the same package resolves, and its limits are wrong (see `robot_model`), so the URDF made
here has cylinders and the client's own limits. It has no masses and no torques: it is for viewers.

Frames: `base_link` is the root, `base` is UR's frame (`base_link` turned by pi about z), `tool0` the flange.
Quaternions are (x, y, z, w).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import cos, sin
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from pc_client.kinematics.arms import RobotDescription

Three = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]

_LEFT_OUT = ("world", "ee_link")
"""Links of the source that hold no body and that nothing here refers to."""

_THICKNESS = 0.05
"""Radius of a tube over the reach of the arm. A choice: it looks like the real arms."""


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between two links.

    Attributes:
        name: as ROS drivers of UR arms call it, e.g. `shoulder_pan_joint`.
        parent: the link that it is fixed to.
        child: the link that it moves.
        origin: where the child's frame begins, in the parent's frame [m].
        rpy: roll, pitch, yaw of the child's frame against the parent's at angle 0 [rad].
        rotation: the same as a quaternion.
        axis: that it turns about, in the child's frame; None of a fixed one.
    """

    name: str
    parent: str
    child: str
    origin: Three
    rpy: Three
    rotation: Quaternion
    axis: Three | None

    def rotation_at(self, angle: float) -> Quaternion:
        """Rotation of the child's frame against the parent's at an angle [rad]."""
        if self.axis is None:
            return self.rotation
        x, y, z = self.axis
        s = sin(angle / 2.0)
        return multiply(self.rotation, (s * x, s * y, s * z, cos(angle / 2.0)))


@dataclass(frozen=True, slots=True)
class ArmTree:
    """The links and joints of one arm.

    Attributes:
        name: of the arm, e.g. `ur3`.
        moving: the six joints that turn, base to wrist 3.
        fixed: `base_link` to `base`, and `wrist_3_link` to `tool0`.
        urdf: the same as a URDF, with simple bodies.
    """

    name: str
    moving: tuple[Joint, ...]
    fixed: tuple[Joint, ...]
    urdf: str

    def flange_rotation(self, q: Iterable[float]) -> Quaternion:
        """Rotation of `tool0` in `base` at joint angles (6,) [rad]; the quaternion with w >= 0."""
        base, flange = self.fixed
        x, y, z, w = base.rotation
        rotation = (-x, -y, -z, w)
        for joint, angle in zip(self.moving, q, strict=True):
            rotation = multiply(rotation, joint.rotation_at(angle))
        x, y, z, w = multiply(rotation, flange.rotation)
        return (x, y, z, w) if w >= 0.0 else (-x, -y, -z, -w)


def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation b followed by the rotation a."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def arm_tree(description: RobotDescription) -> ArmTree:
    """Read the tree of an arm; PlanningError if example-robot-data is not installed."""
    source = ElementTree.fromstring(description.urdf)
    joints = [_joint(element) for element in source.findall("joint")]
    joints = [joint for joint in joints if not {joint.parent, joint.child} & set(_LEFT_OUT)]
    moving = tuple(joint for joint in joints if joint.axis is not None)
    fixed = tuple(joint for joint in joints if joint.axis is None)
    return ArmTree(description.name, moving, fixed, _urdf(description, moving, fixed))


def _link(joint: Element, end: str) -> str:
    return str(joint.find(end).get("link"))  # type: ignore[union-attr]


def _joint(element: Element) -> Joint:
    origin, axis = element.find("origin"), element.find("axis")
    assert origin is not None
    rpy = _numbers(origin.get("rpy"))
    x, y, z, w = Rotation.from_euler("xyz", rpy).as_quat().tolist()
    return Joint(
        str(element.get("name")),
        _link(element, "parent"),
        _link(element, "child"),
        _numbers(origin.get("xyz")),
        rpy,
        (x, y, z, w),
        None if element.get("type") == "fixed" or axis is None else _numbers(axis.get("xyz")),
    )


def _numbers(text: str | None) -> Three:
    x, y, z = map(float, str(text).split())
    return (x, y, z)


def _urdf(description: RobotDescription, moving: Sequence[Joint], fixed: Sequence[Joint]) -> str:
    radius = _THICKNESS * description.reach
    robot = Element("robot", name=description.name)
    links = {"base_link": SubElement(robot, "link", name="base_link")}
    for joint in (*moving, *fixed):
        links[joint.child] = SubElement(robot, "link", name=joint.child)
    for k, joint in enumerate((*moving, *fixed)):
        element = SubElement(
            robot, "joint", name=joint.name, type="fixed" if joint.axis is None else "revolute"
        )
        SubElement(element, "parent", link=joint.parent)
        SubElement(element, "child", link=joint.child)
        SubElement(element, "origin", xyz=_text(joint.origin), rpy=_text(joint.rpy))
        if joint.axis is None:
            if joint.child == "tool0":
                _tubes(links[joint.parent], joint.origin, radius)
            continue
        SubElement(element, "axis", xyz=_text(joint.axis))
        limits = description.limits
        bounds = {"lower": limits.q_min[k], "upper": limits.q_max[k], "velocity": limits.qd_max[k]}
        # URDF demands an effort, and 0 says that none is given.
        SubElement(element, "limit", {name: f"{x:.6g}" for name, x in bounds.items()} | {"effort": "0"})
        _tubes(links[joint.parent], joint.origin, radius)
        _cylinder(links[joint.child], (0.0, 0.0, 0.0), np.array(joint.axis), 2.6 * radius, 1.2 * radius, True)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode") + "\n"


def _tubes(link: Element, end: Three, radius: float) -> None:
    """A tube along each axis, z first, from the frame of a link to the frame of the next one."""
    corner = np.zeros(3)
    for axis in (2, 1, 0):
        if abs(end[axis]) > 1e-9:
            step = np.zeros(3)
            step[axis] = end[axis]
            _cylinder(link, tuple(corner + step / 2), step, abs(end[axis]), radius, False)
            corner += step


def _cylinder(
    link: Element, centre: Sequence[float], along: np.ndarray, length: float, radius: float, is_joint: bool
) -> None:
    rpy = {0: (0.0, np.pi / 2, 0.0), 1: (np.pi / 2, 0.0, 0.0), 2: (0.0, 0.0, 0.0)}[
        int(np.abs(along).argmax())
    ]
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz=_text(centre), rpy=_text(rpy))
    geometry = SubElement(visual, "geometry")
    SubElement(geometry, "cylinder", length=f"{length:.6g}", radius=f"{radius:.6g}")
    material = SubElement(visual, "material", name="joint" if is_joint else "tube")
    SubElement(material, "color", rgba="0.35 0.55 0.75 1" if is_joint else "0.75 0.77 0.8 1")


def _text(numbers: Sequence[float]) -> str:
    return " ".join(f"{round(number, 9) + 0.0:.10g}" for number in numbers)
