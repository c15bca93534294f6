"""Frames of the realtime interface, port 30003: encode them in the box, decode them in the client.

    i32 size of the frame, itself included | f64 | f64 | ...      big-endian, no type byte, no version

The size is the only hint at the layout. Both directions run once per control cycle, so both are prepared
from the table when a layout is first asked for: the encoder is one generated call of `struct.pack`, the
frame's attributes are slices. The meaning of the values is in `realtime.columns`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.frame_buffer import LENGTH_SIZE
from protocol.realtime.columns import COLUMNS, VERSIONS, RealtimeColumn
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import ValueOrigin

__all__ = [
    "MAX_FRAME_SIZE",
    "SNAPSHOT_FIELDS",
    "RealtimeFrame",
    "RealtimeLayout",
    "frame_size",
    "layout_for_size",
    "layout_for_version",
]

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
        """Read one whole frame, length prefix included.

        Raises:
            RemoteProtocolError: the frame is not of this layout's size, by its length or by its prefix.
        """
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
        # One expression, all columns flattened into one call: this runs every cycle.
        arguments = ", ".join(
            "0.0, " * (column.count - 1) + "0.0"
            if column.origin is ValueOrigin.INTERNAL_ZERO
            else f"{'*' if column.count > 1 else ''}s.{column.attribute}"
            for column in self.columns
        )
        count = (self.size - LENGTH_SIZE) // _FLOAT_SIZE
        source = (
            "def encode(s):\n"
            "    try:\n"
            f"        return pack({self.size}, {arguments})\n"
            "    except (error, TypeError) as problem:\n"
            "        raise explain(s, problem) from None\n"
        )
        names: dict[str, Any] = {
            "pack": struct.Struct(f">i{count}d").pack,
            "error": struct.error,
            "explain": self._explain,
        }
        exec(compile(source, f"<realtime encoder, {self.size} bytes>", "exec"), names)
        encode: Callable[[Any], bytes] = names["encode"]
        return encode

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
    """The layout of frames of `size` bytes.

    Raises:
        RemoteProtocolError: no software sends frames of that size.
    """
    known = sorted({known_size for _, known_size in VERSIONS})
    if size not in known:
        raise RemoteProtocolError(
            f"no realtime frame of software 3.0 or later has {size} bytes: known sizes are "
            f"{', '.join(map(str, known))}"
        )
    return RealtimeLayout(tuple(column for column in COLUMNS if column.since_size <= size))


def layout_for_version(version: SoftwareVersion) -> RealtimeLayout:
    """The layout that a controller with this software sends.

    Raises:
        LocalProtocolError: no controller software has that version.
    """
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
