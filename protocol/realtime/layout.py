"""Frames of the realtime interface, port 30003: encode them in the box, decode them in the client.

    i32 size of the frame, itself included | f64 | f64 | ...      big-endian, no type byte, no version

The size is the only hint at the layout. Both directions run once per control cycle, so both are prepared
from the table when a layout is first asked for: the encoder is one generated call of `struct.pack`, the
frame's attributes are slices.

A frame of a version is a prefix of `COLUMNS`. To add a column: add a row at the end with the frame size in
which it first appears, and a row to `VERSIONS`. Columns are named as in RTDE where RTDE has the value; Python
names are the same in lower case. Frames of CB2 controllers (software before 3.0) are not supported.

Source of names, order and sizes, unless a row says otherwise: UR "Realtime Client Interface" (2021,
chapters 5.9 and 5.10) and UR "Client_Interface" workbook (software up to 3.2); sizes between 3.5 and 3.13
from the layouts in sawUniversalRobot and the Robotics Library. The documents agree except for the digital
bits, see their row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.frame_buffer import LENGTH_SIZE
from protocol.packing import attribute, snapshot_packer
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import ValueOrigin

__all__ = [
    "COLUMNS",
    "MAX_FRAME_SIZE",
    "SNAPSHOT_FIELDS",
    "VERSIONS",
    "RealtimeColumn",
    "RealtimeFrame",
    "RealtimeLayout",
    "frame_size",
    "layout_for_size",
    "layout_for_version",
]


@dataclass(frozen=True, slots=True)
class RealtimeColumn:
    """One row of the table: a scalar or vector of 64-bit floats.

    Attributes:
        name: as in RTDE; internal columns are `internal_<first gnuplot column>`.
        count: number of floats.
        unit: SI unit, or "enum", "bits", "-".
        since_size: size in bytes of the shortest frame that has the column.
        origin: how the emulated box fills it.
        meaning: of the value, with its frame of reference.
        source: only where it is not the sheet named in the module's docstring.
    """

    name: str
    count: int
    unit: str
    since_size: int
    origin: ValueOrigin
    meaning: str
    source: str = "UR realtime client interface sheet"

    @property
    def attribute(self) -> str:
        """The Python name: `actual_TCP_pose` is `actual_tcp_pose`."""
        return self.name.lower()


_C = RealtimeColumn
_MEASURED, _MODELLED, _CONSTANT, _ZERO = (
    ValueOrigin.MEASURED,
    ValueOrigin.MODELLED,
    ValueOrigin.CONSTANT,
    ValueOrigin.INTERNAL_ZERO,
)

_DIGITAL_BITS = (
    "UR realtime sheet ('encoded as int64_t' but typed double); UR forum 1811: every field is a double"
)

COLUMNS: tuple[RealtimeColumn, ...] = (
    _C("timestamp", 1, "s", 1044, _MODELLED, "time since the controller started"),
    _C("target_q", 6, "rad", 1044, _MODELLED, "joint position set-point, not wrapped to +-pi"),
    _C("target_qd", 6, "rad/s", 1044, _MODELLED, "joint velocity set-point"),
    _C("target_qdd", 6, "rad/s2", 1044, _MODELLED, "joint acceleration set-point"),
    _C("target_current", 6, "A", 1044, _MODELLED, "joint current that the controller's model expects"),
    _C("target_moment", 6, "Nm", 1044, _MODELLED, "joint torque that the controller's model expects"),
    _C("actual_q", 6, "rad", 1044, _MEASURED, "joint position, not wrapped to +-pi"),
    _C("actual_qd", 6, "rad/s", 1044, _MEASURED, "joint velocity"),
    _C("actual_current", 6, "A", 1044, _MEASURED, "joint motor current"),
    _C("joint_control_output", 6, "A", 1044, _MEASURED, "joint control current, output of the servo"),
    _C("actual_TCP_pose", 6, "m, rad", 1044, _MODELLED, "pose of the TCP in base, from actual_q"),
    _C("actual_TCP_speed", 6, "m/s, rad/s", 1044, _MODELLED, "twist of the TCP in base axes, from actual_qd"),
    _C("actual_TCP_force", 6, "N, Nm", 1044, _MODELLED, "external wrench in base axes, from currents on CB3"),
    _C("target_TCP_pose", 6, "m, rad", 1044, _MODELLED, "pose of the TCP in base, from target_q"),
    _C("target_TCP_speed", 6, "m/s, rad/s", 1044, _MODELLED, "twist of the TCP in base axes, from target_qd"),
    _C("actual_digital_input_bits", 1, "bits", 1044, _MODELLED,
       "0-7 standard, 8-15 configurable, 16-17 tool; sent as the double 5.0 for bits 0 and 2", _DIGITAL_BITS),
    _C("joint_temperatures", 6, "degC", 1044, _MEASURED, "motor temperatures"),
    _C("actual_execution_time", 1, "-", 1044, _MODELLED,
       "controller timer, run time of a cycle in ms, by the work of programs; 0 on CB3"),
    _C("test_value", 1, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("robot_mode", 1, "enum", 1044, _MODELLED, "RobotMode"),
    _C("joint_mode", 6, "enum", 1044, _MODELLED, "JointMode"),
    _C("safety_mode", 1, "enum", 1044, _MODELLED, "SafetyMode"),
    _C("internal_103", 6, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("actual_tool_accelerometer", 3, "m/s2", 1044, _MEASURED, "x y z at the tool; sign is undocumented"),
    _C("internal_112", 6, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("speed_scaling", 1, "-", 1044, _MODELLED, "0 to 1, of the trajectory limiter"),
    _C("actual_momentum", 1, "kg m/s", 1044, _MODELLED, "norm of the linear momentum"),
    _C("internal_120", 1, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("internal_121", 1, "-", 1044, _ZERO, "used by UR's own software only"),
    _C("actual_main_voltage", 1, "V", 1044, _CONSTANT, "main voltage at the masterboard"),
    _C("actual_robot_voltage", 1, "V", 1044, _MODELLED, "48 V bus of the arm, 0 without power"),
    _C("actual_robot_current", 1, "A", 1044, _MODELLED, "current into the arm"),
    _C("actual_joint_voltage", 6, "V", 1044, _MEASURED, "bus voltage at each joint"),
    _C("actual_digital_output_bits", 1, "bits", 1060, _MODELLED, "numbered and sent as the input bits",
       _DIGITAL_BITS),
    _C("runtime_state", 1, "enum", 1060, _MODELLED, "ProgramState"),
    _C("elbow_position", 3, "m", 1108, _MODELLED, "x y z in base"),
    _C("elbow_velocity", 3, "m/s", 1108, _MODELLED, "x y z in base axes"),
    _C("safety_status", 1, "enum", 1116, _MODELLED, "SafetyStatus"),
    _C("internal_140", 1, "-", 1140, _ZERO, "used by UR's own software only"),
    _C("internal_141", 1, "-", 1140, _ZERO, "used by UR's own software only"),
    _C("internal_142", 1, "-", 1140, _ZERO, "used by UR's own software only"),
    _C("payload", 1, "kg", 1220, _MODELLED, "mass of the payload"),
    _C("payload_cog", 3, "m", 1220, _MODELLED, "x y z of its centre of gravity in the flange frame"),
    _C("payload_inertia", 6, "kg m2", 1220, _MODELLED, "Ixx Iyy Izz Ixy Ixz Iyz, as stated; else 0"),
)  # fmt: skip
"""A frame of n bytes holds the rows with `since_size` <= n."""

VERSIONS: tuple[tuple[SoftwareVersion, int], ...] = (
    (SoftwareVersion(3, 0), 1044),
    (SoftwareVersion(3, 2), 1060),
    (SoftwareVersion(3, 5), 1108),
    (SoftwareVersion(3, 10), 1116),
    (SoftwareVersion(3, 14), 1140),
    (SoftwareVersion(5, 0), 1108),
    (SoftwareVersion(5, 4), 1116),
    (SoftwareVersion(5, 9), 1140),
    (SoftwareVersion(5, 10), 1220),
)
"""First software version of each frame size in bytes, ascending. Major 4 was never released."""


_FLOAT_SIZE = 8

MAX_FRAME_SIZE = max(size for _, size in VERSIONS)
"""Longest frame of any version in bytes: the limit to give to a `FrameBuffer`."""

SNAPSHOT_FIELDS: tuple[str, ...] = tuple(
    column.attribute for column in COLUMNS if column.origin is not ValueOrigin.INTERNAL_ZERO
)
"""Attributes that an object must have to be encoded in any layout: vectors as tuples of floats, scalars as
numbers. An encoder of an older version reads only those that its frames carry."""


class RealtimeFrame:
    """One decoded frame; attributes are the columns' names in lower case.

    A scalar column is a float, a vector column a read-only array view, shape (count,). Asking for a column
    that the frame's version does not have raises AttributeError.

    Attributes:
        values: all columns one after another, float64, native byte order, read-only.
        layout: the table that gives the values their names.
    """

    __slots__ = ("values",)
    layout: RealtimeLayout
    names: tuple[str, ...]

    def __init__(self, values: NDArray[np.float64]) -> None:
        self.values = values

    def __getattr__(self, name: str) -> Any:  # only called for what is not a column of this layout
        kind = type(self)
        raise AttributeError(
            f"a frame of {kind.layout.size} bytes has no {name!r}; it has {', '.join(kind.names)}"
        )

    def __repr__(self) -> str:
        return f"<RealtimeFrame {self.layout.size} bytes, timestamp {self.timestamp:.3f} s>"


class RealtimeLayout:
    """The columns of one frame size, and the codec made from them. Get one by `layout_for_version`.

    Attributes:
        size: bytes of a frame, length prefix included.
        columns: rows of the table, in the order of the wire.
        slices: place of each column in `RealtimeFrame.values`, by lower-case name.
    """

    __slots__ = ("_frame_type", "_prefix", "columns", "size", "slices")

    size: int
    columns: tuple[RealtimeColumn, ...]
    slices: Mapping[str, slice]

    def __init__(self, columns: tuple[RealtimeColumn, ...]) -> None:
        self.columns = columns
        places = {}
        start = 0
        for column in columns:
            places[column.attribute] = slice(start, start + column.count)
            start += column.count
        self.slices = MappingProxyType(places)
        self.size = LENGTH_SIZE + _FLOAT_SIZE * start
        self._prefix = self.size.to_bytes(LENGTH_SIZE, "big")
        self._frame_type = _make_frame_type(self)

    def offset(self, column: RealtimeColumn) -> int:
        """First byte of a column in the frame."""
        return LENGTH_SIZE + _FLOAT_SIZE * int(self.slices[column.attribute].start)

    def decode(self, frame: bytes) -> RealtimeFrame:
        """Read one whole frame, length prefix included; RemoteProtocolError if its size is another."""
        if len(frame) != self.size or not frame.startswith(self._prefix):
            raise RemoteProtocolError(
                f"a realtime frame of this robot has {self.size} bytes, this one {len(frame)} "
                f"and says {int.from_bytes(frame[:LENGTH_SIZE], 'big', signed=True)}"
            )
        values = np.frombuffer(frame, ">f8", -1, LENGTH_SIZE).astype(np.float64)
        values.flags.writeable = False
        return self._frame_type(values)

    def encoder(self) -> Callable[[Any], bytes]:
        """Make a function from snapshot to frame.

        The function reads the attributes named in `SNAPSHOT_FIELDS` that this layout carries and writes 0 in
        internal columns. It raises `LocalProtocolError` when a vector has the wrong length or a value is not
        a number, and `AttributeError` when the object lacks a column.
        """
        arguments = [
            ", ".join(["0.0"] * column.count)
            if column.origin is ValueOrigin.INTERNAL_ZERO
            else attribute(column.attribute, column.count)
            for column in self.columns
        ]
        letters = "d" * sum(column.count for column in self.columns)
        return snapshot_packer(self._prefix, letters, arguments, self._explain)

    def _explain(self, snapshot: Any, problem: Exception) -> LocalProtocolError:
        for column in self.columns:
            if column.origin is ValueOrigin.INTERNAL_ZERO:
                continue
            value = getattr(snapshot, column.attribute)
            try:
                values = [float(item) for item in value] if column.count > 1 else [float(value)]
            except (TypeError, ValueError):
                values = []
            if len(values) != column.count:
                return LocalProtocolError(
                    f"{column.attribute} is {value!r}: give {column.count} number{'s' * (column.count > 1)}"
                )
        return LocalProtocolError(f"this snapshot cannot be encoded: {problem}")


def _scalar(index: int) -> property:
    def get(frame: RealtimeFrame) -> float:
        return frame.values.item(index)

    return property(get)


def _vector(place: slice) -> property:
    def get(frame: RealtimeFrame) -> NDArray[np.float64]:
        return frame.values[place]

    return property(get)


def _make_frame_type(layout: RealtimeLayout) -> type[RealtimeFrame]:
    """A subclass of RealtimeFrame with one property a column, so that an access costs one slice."""
    members: dict[str, Any] = {"__slots__": (), "layout": layout, "names": tuple(layout.slices)}
    for name, place in layout.slices.items():
        members[name] = _scalar(place.start) if place.stop - place.start == 1 else _vector(place)
    return type("RealtimeFrame", (RealtimeFrame,), members)


@cache
def layout_for_size(size: int) -> RealtimeLayout:
    """The layout of frames of `size` bytes; RemoteProtocolError if no software sends such frames."""
    known = sorted({known_size for _, known_size in VERSIONS})
    if size not in known:
        raise RemoteProtocolError(
            f"no realtime frame of software 3.0 or later has {size} bytes: known sizes are "
            f"{', '.join(map(str, known))}"
        )
    return RealtimeLayout(tuple(column for column in COLUMNS if column.since_size <= size))


def layout_for_version(version: SoftwareVersion) -> RealtimeLayout:
    """The layout of a controller with this software; LocalProtocolError if there is no such software."""
    return layout_for_size(frame_size(version))


def frame_size(version: SoftwareVersion, sizes: Sequence[tuple[SoftwareVersion, int]] = VERSIONS) -> int:
    """Bytes of the frames that a controller with this software sends.

    Raises:
        LocalProtocolError: no controller software has that version.
    """
    known = [size for first, size in sizes if first <= version]
    released = {first.major for first, _ in sizes}
    if not known or (version.major not in released and version.major < max(released)):
        raise LocalProtocolError(f"no controller software {version}: use 3.0 to 3.15, 5.0 or later")
    return known[-1]
