"""The ROS 2 messages that viewers know: their definitions, and how their values lie in CDR.

Source: ROS 2 common_interfaces, geometry2 (fields only); OMG CDR (XCDR1) alignment rules.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"

JOINT_STATE = "sensor_msgs/msg/JointState"
POSE = "geometry_msgs/msg/PoseStamped"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
TEXT = "std_msgs/msg/String"

_FIELDS = {
    JOINT_STATE: (
        "std_msgs/Header header",
        *("string[] name", "float64[] position", "float64[] velocity", "float64[] effort"),
    ),
    POSE: ("std_msgs/Header header", "geometry_msgs/Pose pose"),
    TRANSFORMS: ("geometry_msgs/TransformStamped[] transforms",),
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


def cdr_layout(values: Sequence[Value]) -> Struct:
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
