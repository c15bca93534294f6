"""A moving arm for viewers: its links and joints as a URDF, and the topics of a recording that show it.

The topics make a recording a moving arm in Foxglove, Rerun and ROS, beside the measured signals. They are
written 25 times a second, whatever the control cycle, so that a file grows little by them; every cycle is in
`/robot_state`. The transforms move the arm also in viewers that read no URDF.

    /robot_description   the URDF, once
    /tf_static           base_link to base, wrist_3_link to tool0, once
    /tf                  the six links; in `base`: `actual_tcp` as reported, `desired_tcp` as the reference
    /joint_states        actual_q, actual_qd under the names of the URDF
    /tcp_pose            reported TCP pose in `base`
    /desired_tcp_pose    the reference's position, with the orientation of ref_q, in `base`

Frames: `base_link` is the root, `base` is UR's frame (`base_link` turned by pi about z), `tool0` the flange.
Quaternions are (x, y, z, w).

`mcap_ros2` takes three times as long to encode the messages as all of `show` does: it asks for each field of
each message, where one `Struct` packs a message whose texts and counts stay the same.

Source of the messages: ROS 2 common_interfaces, geometry2 (fields only); OMG CDR (XCDR1) alignment rules.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, isfinite
from struct import Struct
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin
from mcap.writer import Writer

from pc_client.arrays import Array
from pc_client.kinematics.arms import RobotDescription

_LINKS = (
    *("base_link", "shoulder_link", "upper_arm_link", "forearm_link"),
    *("wrist_1_link", "wrist_2_link", "wrist_3_link"),
)
"""The links that carry a body; each turns against the one before."""

_FIXED = (("base_link", "base"), ("wrist_3_link", "tool0"))
"""Frames without a body, and what they are fixed to."""

_THICKNESS = 0.05
"""Radius of a tube over the reach of the arm. A choice: it looks like the real arms."""

PERIOD = 0.04
"""Time between two views of the arm [s]."""


@dataclass(frozen=True, slots=True)
class ArmTree:
    """The links and joints of one arm.

    Attributes:
        name: of the arm, e.g. `ur3`.
        model: of Pinocchio; its root is `base_link`.
        urdf: the same as a URDF, with simple bodies.
    """

    name: str
    model: Any
    urdf: str


def arm_tree(description: RobotDescription) -> ArmTree:
    """Read the tree of an arm; PlanningError if example-robot-data is not installed."""
    source = description.urdf
    return ArmTree(description.name, pin.buildModelFromXML(source), _urdf(description, source))


def _urdf(description: RobotDescription, source: str) -> str:
    """The joints of a URDF of example-robot-data, with bodies and limits of our own.

    Its meshes are addresses that only an installation with the same package resolves, and its limits are
    wrong (see `kinematics.arms`). There are no masses and no torques.
    """
    radius, limits = _THICKNESS * description.reach, description.limits
    robot = Element("robot", name=description.name)
    links = {name: SubElement(robot, "link", name=name) for name in (*_LINKS, *dict(_FIXED).values())}
    for joint in ElementTree.fromstring(source).findall("joint"):
        parts = {part.tag: part for part in joint}
        parent, child = (str(parts[end].get("link")) for end in ("parent", "child"))
        if parent not in links or child not in links:  # `world` and `ee_link` hold no body
            continue
        element = SubElement(robot, "joint", name=str(joint.get("name")), type=str(joint.get("type")))
        element.extend(parts[tag] for tag in ("parent", "child", "origin"))
        _add_tubes(links[parent], _numbers(parts["origin"]), radius)
        if joint.get("type") != "fixed":
            k = _LINKS.index(child) - 1
            bounds = {"lower": limits.q_min[k], "upper": limits.q_max[k], "velocity": limits.qd_max[k]}
            element.append(parts["axis"])
            # URDF demands an effort, and 0 says that none is given.
            SubElement(element, "limit", {name: f"{x:.6g}" for name, x in bounds.items()} | {"effort": "0"})
            along = int(np.abs(_numbers(parts["axis"])).argmax())
            _add_cylinder(links[child], np.zeros(3), along, 2.6 * radius, 1.2 * radius, is_joint=True)
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding="unicode") + "\n"


def _numbers(part: Element) -> Array:
    return np.array(str(part.get("xyz")).split(), dtype=np.float64)


def _add_tubes(link: Element, end: Array, radius: float) -> None:
    """Add a tube along each axis, z first, from the frame of a link to the frame of the next one."""
    corner = np.zeros(3)
    for axis in (2, 1, 0):
        if abs(end[axis]) > 1e-9:
            step = end * (np.arange(3) == axis)
            _add_cylinder(link, corner + step / 2, axis, abs(end[axis]), radius, is_joint=False)
            corner += step


def _add_cylinder(
    link: Element, centre: Array, axis: int, length: float, radius: float, *, is_joint: bool
) -> None:
    xyz = " ".join(f"{round(number, 9) + 0.0:.10g}" for number in centre)
    rpy = ("0 1.570796327 0", "1.570796327 0 0", "0 0 0")[axis]
    name, colour = ("joint", "0.35 0.55 0.75 1") if is_joint else ("tube", "0.75 0.77 0.8 1")
    visual = SubElement(link, "visual")
    SubElement(visual, "origin", xyz=xyz, rpy=rpy)
    geometry = SubElement(visual, "geometry")
    SubElement(geometry, "cylinder", length=f"{length:.6g}", radius=f"{radius:.6g}")
    SubElement(SubElement(visual, "material", name=name), "color", rgba=colour)


CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"

_STRING, _POSE = "std_msgs/msg/String", "geometry_msgs/msg/PoseStamped"
_JOINT_STATE, _TRANSFORMS = "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"

_JOINT_FIELDS = ("string[] name", "float64[] position", "float64[] velocity", "float64[] effort")
_XYZ = ("float64 x", "float64 y", "float64 z")
_FIELDS: dict[str, tuple[str, ...]] = {
    _STRING: ("string data",),
    _POSE: ("std_msgs/Header header", "geometry_msgs/Pose pose"),
    _JOINT_STATE: ("std_msgs/Header header", *_JOINT_FIELDS),
    _TRANSFORMS: ("geometry_msgs/TransformStamped[] transforms",),
    "std_msgs/Header": ("builtin_interfaces/Time stamp", "string frame_id"),
    "builtin_interfaces/Time": ("int32 sec", "uint32 nanosec"),
    "geometry_msgs/Pose": ("geometry_msgs/Point position", "geometry_msgs/Quaternion orientation"),
    "geometry_msgs/Point": _XYZ,
    "geometry_msgs/Vector3": _XYZ,
    "geometry_msgs/Quaternion": (*_XYZ, "float64 w"),
    "geometry_msgs/Transform": ("geometry_msgs/Vector3 translation", "geometry_msgs/Quaternion rotation"),
    "geometry_msgs/TransformStamped": (
        *("std_msgs/Header header", "string child_frame_id", "geometry_msgs/Transform transform"),
    ),
}


def _definition(message: str) -> str:
    """The definition of a message with those of all messages inside it, as `ros2msg` schemas have them."""
    needed = [message]
    for name in needed:
        inside = (field.split()[0].removesuffix("[]") for field in _FIELDS[name])
        needed += [part for part in inside if part in _FIELDS and part not in needed]
    texts = ["\n".join(_FIELDS[name]) + "\n" for name in needed]
    parts = (f"{'=' * 80}\nMSG: {name}\n{text}" for name, text in zip(needed[1:], texts[1:], strict=True))
    return texts[0] + "".join(parts)


_Value = int | float | bytes
"""An int is a uint32 (also a length, and the two halves of a time), a float a float64, bytes a text."""


def _texts(*texts: str) -> tuple[_Value, ...]:
    return tuple(value for text in texts for value in (len(text.encode()) + 1, text.encode() + b"\0"))


def _layout(values: Sequence[_Value]) -> Struct:
    """How a message with values of these types and lengths lies behind the head of CDR.

    There, as in C, a number begins at a multiple of its size.
    """
    letters = (f"{len(v)}s" if isinstance(v, bytes) else "d" if isinstance(v, float) else "I" for v in values)
    return Struct("".join(letters))


# `ros2 bag play` publishes such a topic so that a node that starts later gets its last message, too.
_LATCHED = """\
- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 2147483647, nsec: 4294967295}
  lifespan: {sec: 2147483647, nsec: 4294967295}
  liveliness: 1
  liveliness_lease_duration: {sec: 2147483647, nsec: 4294967295}
  avoid_ros_namespace_conventions: false
"""

_TOPICS = {
    "/robot_description": (_STRING, {"offered_qos_profiles": _LATCHED}),
    "/tf_static": (_TRANSFORMS, {"offered_qos_profiles": _LATCHED}),
    "/tf": (_TRANSFORMS, {}),
    "/joint_states": (_JOINT_STATE, {}),
    "/tcp_pose": (_POSE, {}),
    "/desired_tcp_pose": (_POSE, {}),
}

_BASE = _texts("base")
_ACTUAL_TCP, _DESIRED_TCP = _texts("base", "actual_tcp"), _texts("base", "desired_tcp")
_MOVING_ENDS = [_texts(*ends) for ends in pairwise(_LINKS)]


class ArmView:
    """Writes the view of one recording; the columns are the names of the numbers of a frame, in order."""

    def __init__(self, arm: ArmTree, writer: Writer, columns: Sequence[str], cycle_time: float) -> None:
        self._arm, self._data = arm, arm.model.createData()
        self._base, self._flange = (arm.model.getFrameId(child) for _, child in _FIXED)
        self._writer = writer
        self._every = max(1, round(PERIOD / cycle_time))
        self._names = _texts(*list(arm.model.names)[1:])
        self._q, self._qd, self._pose = (
            slice(columns.index(name), columns.index(name) + 6)
            for name in ("actual_q", "actual_qd", "actual_TCP_pose")
        )
        schemas = {
            message: writer.register_schema(message, "ros2msg", _definition(message).encode())
            for message in (_STRING, _TRANSFORMS, _JOINT_STATE, _POSE)
        }
        self._channels = {
            topic: writer.register_channel(topic, "cdr", schemas[message], metadata)
            for topic, (message, metadata) in _TOPICS.items()
        }
        self._layouts: dict[str, Struct] = {}
        self._n_shown = 0

    def show(
        self, row: int, log_time: int, frame: Array, ref_q: Iterable[float], ref_p: Iterable[float]
    ) -> None:
        """Write what shows the arm in one row, if its turn has come.

        Args:
            row: counts from 0.
            log_time: of the row [ns].
            frame: (n,) all columns of the frame.
            ref_q: (6,) desired joint angles [rad].
            ref_p: (3,) desired TCP position in `base` [m].
        """
        stamp = divmod(log_time, 10**9)
        if row == 0:
            self._begin(log_time, stamp)
        if row % self._every:
            return
        q, qd, (*p, rx, ry, rz) = (frame[part].tolist() for part in (self._q, self._qd, self._pose))
        if not all(map(isfinite, (*q, *p, hypot(rx, ry, rz)))):
            return
        model, data = self._arm.model, self._data
        tcp = pin.SE3ToXYZQUATtuple(pin.SE3(pin.exp3(np.array((rx, ry, rz))), np.array(p)))
        pin.framesForwardKinematics(model, data, np.fromiter(ref_q, np.float64, 6))
        T_base_flange = data.oMf[self._base].actInv(data.oMf[self._flange])
        desired = (*ref_p, *pin.SE3ToXYZQUATtuple(T_base_flange)[3:])
        pin.forwardKinematics(model, data, frame[self._q])
        values: list[_Value] = [len(_MOVING_ENDS) + 2]
        for joint, ends in enumerate(_MOVING_ENDS, 1):
            values += [*stamp, *ends, *pin.SE3ToXYZQUATtuple(data.liMi[joint])]
        values += [*stamp, *_ACTUAL_TCP, *tcp, *stamp, *_DESIRED_TCP, *desired]
        self._write("/tf", log_time, values)
        self._write("/joint_states", log_time, [*stamp, *_texts(""), 6, *self._names, 6, *q, 6, *qd, 0])
        self._write("/tcp_pose", log_time, [*stamp, *_BASE, *tcp])
        self._write("/desired_tcp_pose", log_time, [*stamp, *_BASE, *desired])
        self._n_shown += 1

    def _begin(self, log_time: int, stamp: tuple[int, int]) -> None:
        """Write what is written once."""
        urdf, frames = self._arm.urdf, self._arm.model.frames
        name = f"{self._arm.name}.urdf"
        self._writer.add_attachment(log_time, log_time, name, "application/xml", urdf.encode())
        self._write("/robot_description", log_time, _texts(urdf))
        values: list[_Value] = [len(_FIXED)]
        for ends, frame in zip(_FIXED, (self._base, self._flange), strict=True):
            values += [*stamp, *_texts(*ends), *pin.SE3ToXYZQUATtuple(frames[frame].placement)]
        self._write("/tf_static", log_time, values)

    def _write(self, topic: str, log_time: int, values: Sequence[_Value]) -> None:
        """Write a message; the texts in those of one topic and their counts stay the same."""
        if topic not in self._layouts:
            self._layouts[topic] = _layout(values)
        data = CDR_LITTLE_ENDIAN + self._layouts[topic].pack(*values)
        self._writer.add_message(self._channels[topic], log_time, data, log_time, self._n_shown)
