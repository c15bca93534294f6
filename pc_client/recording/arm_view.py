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

Names, origins and axes are those of the arm's URDF. In example-robot-data its meshes are addresses that only
an installation with the same package resolves, and its limits are wrong (see `kinematics.arms`), so the URDF
made here has cylinders and the client's own limits. It has no masses and no torques.

Frames: `base_link` is the root, `base` is UR's frame (`base_link` turned by pi about z), `tool0` the flange.
Quaternions are (x, y, z, w).

Source of the messages: ROS 2 common_interfaces, geometry2 (fields only); OMG CDR (XCDR1) alignment rules.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import cos, hypot, isfinite, sin
from struct import Struct
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from mcap.writer import Writer
from scipy.spatial.transform import Rotation

from pc_client.arrays import Array
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


CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"

_JOINT_STATE = "sensor_msgs/msg/JointState"
POSE = "geometry_msgs/msg/PoseStamped"
_TRANSFORMS = "tf2_msgs/msg/TFMessage"
TEXT = "std_msgs/msg/String"

_FIELDS = {
    _JOINT_STATE: (
        "std_msgs/Header header",
        *("string[] name", "float64[] position", "float64[] velocity", "float64[] effort"),
    ),
    POSE: ("std_msgs/Header header", "geometry_msgs/Pose pose"),
    _TRANSFORMS: ("geometry_msgs/TransformStamped[] transforms",),
    TEXT: ("string data",),
    "std_msgs/Header": ("builtin_interfaces/Time stamp", "string frame_id"),
    "builtin_interfaces/Time": ("int32 sec", "uint32 nanosec"),
    "geometry_msgs/Pose": ("geometry_msgs/Point position", "geometry_msgs/Quaternion orientation"),
    "geometry_msgs/Point": ("float64 x", "float64 y", "float64 z"),
    "geometry_msgs/Vector3": ("float64 x", "float64 y", "float64 z"),
    "geometry_msgs/Quaternion": ("float64 x", "float64 y", "float64 z", "float64 w"),
    "geometry_msgs/Transform": ("geometry_msgs/Vector3 translation", "geometry_msgs/Quaternion rotation"),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header",
        *("string child_frame_id", "geometry_msgs/Transform transform"),
    ),
}

Value = int | float | bytes
"""An int is a uint32 (also a length, and the two halves of a time), a float a float64, bytes a text."""


def definition(message: str) -> str:
    """The definition of a message with those of all messages inside it, as `ros2msg` schemas have them."""
    needed = [message]
    for name in needed:
        inside = (field.split()[0].removesuffix("[]") for field in _FIELDS[name])
        needed += [part for part in inside if part in _FIELDS and part not in needed]
    head = "\n".join(_FIELDS[message]) + "\n"
    parts = ("=" * 80 + f"\nMSG: {name}\n" + "\n".join(_FIELDS[name]) + "\n" for name in needed[1:])
    return head + "".join(parts)


def text(value: str) -> tuple[Value, ...]:
    """The values of a text."""
    data = value.encode() + b"\0"
    return len(data), data


def _cdr_layout(values: Sequence[Value]) -> Struct:
    """How a message with values of these types and lengths lies in CDR; packs the head and the values."""
    code, size = "<4s", 0
    for value in values:
        if isinstance(value, bytes):
            letter, width, alignment = f"{len(value)}s", len(value), 1
        else:
            letter, width = ("d", 8) if isinstance(value, float) else ("I", 4)
            alignment = width
        gap = -size % alignment
        code += f"{gap}x{letter}"
        size += gap + width
    return Struct(code)


PERIOD = 0.04
"""Time between two views of the arm [s]."""

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

_BASE, _ACTUAL_TCP, _DESIRED_TCP = text("base"), text("actual_tcp"), text("desired_tcp")


class _Publisher:
    """Writes the messages of one topic; the texts in them and their counts stay the same.

    A latched topic has one message only.
    """

    def __init__(
        self, writer: Writer, topic: str, message: str, schema_id: int, *, is_latched: bool = False
    ) -> None:
        self._writer = writer
        self._layout: Struct | None = None
        self._n_written = 0
        metadata = {"offered_qos_profiles": _LATCHED} if is_latched else {}
        self._channel = writer.register_channel(topic, "cdr", schema_id, metadata)

    def write(self, log_time: int, values: Sequence[Value]) -> None:
        """Write a message."""
        if self._layout is None:
            self._layout = _cdr_layout(values)
        data = self._layout.pack(CDR_LITTLE_ENDIAN, *values)
        self._writer.add_message(self._channel, log_time, data, log_time, self._n_written)
        self._n_written += 1


class ArmView:
    """Writes the view of one recording; the columns are the names of the numbers of a frame, in order."""

    def __init__(self, arm: ArmTree, writer: Writer, columns: Sequence[str], cycle_time: float) -> None:
        self._arm = arm
        self._writer = writer
        self._every = max(1, round(PERIOD / cycle_time))
        self._names = [part for joint in arm.moving for part in text(joint.name)]
        self._ends = [_ends(joint) for joint in arm.moving]
        self._q, self._qd, self._pose = (
            slice(columns.index(name), columns.index(name) + 6)
            for name in ("actual_q", "actual_qd", "actual_TCP_pose")
        )
        schemas = {
            message: writer.register_schema(message, "ros2msg", definition(message).encode())
            for message in (TEXT, _TRANSFORMS, _JOINT_STATE, POSE)
        }

        def publisher(topic: str, message: str, *, is_latched: bool = False) -> _Publisher:
            return _Publisher(writer, topic, message, schemas[message], is_latched=is_latched)

        self._description = publisher("/robot_description", TEXT, is_latched=True)
        self._static = publisher("/tf_static", _TRANSFORMS, is_latched=True)
        self._transforms = publisher("/tf", _TRANSFORMS)
        self._joints = publisher("/joint_states", _JOINT_STATE)
        self._tcp = publisher("/tcp_pose", POSE)
        self._desired_tcp = publisher("/desired_tcp_pose", POSE)

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
        if row == 0:
            self._begin(log_time)
        if row % self._every:
            return
        q, qd, pose = (frame[part].tolist() for part in (self._q, self._qd, self._pose))
        if not all(map(isfinite, (*q, *pose, hypot(*pose[3:])))):
            return
        stamp = divmod(log_time, 10**9)
        tcp = (*pose[:3], *_quaternion(*pose[3:]))
        desired = (*ref_p, *self._arm.flange_rotation(ref_q))
        values: list[Value] = [len(self._arm.moving) + 2]
        for joint, ends, angle in zip(self._arm.moving, self._ends, q, strict=True):
            values += [*stamp, *ends, *joint.origin, *joint.rotation_at(angle)]
        values += [*stamp, *_BASE, *_ACTUAL_TCP, *tcp, *stamp, *_BASE, *_DESIRED_TCP, *desired]
        self._transforms.write(log_time, values)
        self._joints.write(log_time, [*stamp, *text(""), 6, *self._names, 6, *q, 6, *qd, 0])
        self._tcp.write(log_time, [*stamp, *_BASE, *tcp])
        self._desired_tcp.write(log_time, [*stamp, *_BASE, *desired])

    def _begin(self, log_time: int) -> None:
        """Write what is written once."""
        urdf = self._arm.urdf
        self._writer.add_attachment(
            log_time, log_time, f"{self._arm.name}.urdf", "application/xml", urdf.encode()
        )
        self._description.write(log_time, text(urdf))
        values: list[Value] = [len(self._arm.fixed)]
        for joint in self._arm.fixed:
            values += [*divmod(log_time, 10**9), *_ends(joint), *joint.origin, *joint.rotation]
        self._static.write(log_time, values)


def _ends(joint: Joint) -> tuple[Value, ...]:
    return (*text(joint.parent), *text(joint.child))


def _quaternion(x: float, y: float, z: float) -> Quaternion:
    angle = hypot(x, y, z)
    scale = sin(angle / 2.0) / angle if angle else 0.5
    return (x * scale, y * scale, z * scale, cos(angle / 2.0))
