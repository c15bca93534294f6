"""Captured bytes and the tables as lines of text: what `python -m protocol` prints.

A decoder takes the bytes that one side has sent on one connection, from its beginning, in parts of any size.
`feed` returns the lines of the complete packages, one line a field, `end` a line about remaining bytes.
"""

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any

from protocol.errors import RemoteProtocolError
from protocol.frame_buffer import FrameBuffer
from protocol.primary.framing import MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE, NO_TIME, PackageType
from protocol.primary.messages import MESSAGES, ThreadLabel, VersionMessage
from protocol.primary.packages import RobotState, decode_package, state_size, state_types
from protocol.primary.values import TypedValue, value_codes
from protocol.realtime.layout import MAX_FRAME_SIZE, layout_for_size, layout_for_version
from protocol.rtde import codec
from protocol.rtde.fields import INPUTS, OUTPUTS, RtdeField
from protocol.rtde.recipe import Recipe
from protocol.rtde.types import REFUSALS, RtdeType
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import WireField, wire_fields

__all__ = ["RtdeDecoder", "StreamDecoder", "describe_layouts", "type_name"]

_WIDTH = 28


class StreamDecoder:
    """Ports 30001 to 30003 and their read-only ports; the first bytes show which it is.

    Args:
        version: software of the controller, until its version message arrives.
    """

    def __init__(self, version: SoftwareVersion) -> None:
        self._version = version
        self._frames: FrameBuffer | None = None
        self._is_primary = False
        self._head = b""
        self._position = 0
        self.count = 0

    def feed(self, data: bytes) -> Iterator[str]:
        """Lines of the packages that these bytes complete.

        Raises:
            RemoteProtocolError: the bytes are not those of a realtime, primary or secondary port.
        """
        if self._frames is None:
            self._head += data
            if len(self._head) < MIN_PACKAGE_SIZE:
                return
            self._begin()
        else:
            self._frames.feed(data)
        assert self._frames is not None
        while (frame := self._frames.next_frame()) is not None:
            self.count += 1
            yield from self._primary(frame) if self._is_primary else self._realtime(frame)
            self._position += len(frame)

    def end(self) -> Iterator[str]:
        """A line about the remaining bytes."""
        if self._frames is None and self._head:
            self._begin()
            yield from self.feed(b"")  # raises: too short for a frame
        if self._frames is not None and self._frames.pending:
            yield f"byte {self._position}: {self._frames.pending} bytes of a package that is not complete"

    def _begin(self) -> None:
        head = self._head
        self._is_primary = len(head) >= MIN_PACKAGE_SIZE and head[4] in PackageType.__members__.values()
        self._frames = (
            FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE)
            if self._is_primary
            else FrameBuffer(MAX_FRAME_SIZE)
        )
        self._frames.feed(head)

    def _primary(self, frame: bytes) -> Iterator[str]:
        package = decode_package(frame, self._version)
        if isinstance(package, VersionMessage):
            self._version = SoftwareVersion(package.major, package.minor, package.bugfix)
        yield f"byte {self._position}: {type(package).__name__}, {len(frame)} bytes"
        yield from _describe(package)

    def _realtime(self, frame: bytes) -> Iterator[str]:
        realtime = layout_for_size(len(frame)).decode(frame)
        yield f"byte {self._position}: realtime frame, {len(frame)} bytes"
        for column in realtime.layout.columns:
            yield f"  {column.name:<{_WIDTH}} {_text(getattr(realtime, column.attribute))} {column.unit}"


class RtdeDecoder:
    """What a robot has sent on port 30004; it sends the types of variables without their names.

    Args:
        names: those that the client asked for; missing ones get numbers.

    Attributes:
        refused: refusals that the robot sent instead of types, by name.
    """

    def __init__(self, names: Sequence[str] = ()) -> None:
        self._names = tuple(names)
        self._buffer = bytearray()
        self._protocol = 1
        self._position = 0
        self._recipe: Recipe | None = None
        self.count = 0
        self.refused: dict[str, str] = {}

    def feed(self, data: bytes) -> Iterator[str]:
        """Lines of the packages that these bytes complete.

        Raises:
            RemoteProtocolError: the bytes are not those of a robot's RTDE port.
        """
        self._buffer += data
        while (package := codec.take_package(self._buffer, codec.MAX_SIZE)) is not None:
            kind, payload = package
            size = codec.HEADER_SIZE + len(payload)
            self.count += 1
            yield from self._package(kind, payload, size)
            self._position += size

    def end(self) -> Iterator[str]:
        """A line about the remaining bytes."""
        if self._buffer:
            yield f"byte {self._position}: {len(self._buffer)} bytes of a package that is not complete"

    def _package(self, kind: int, payload: bytes, size: int) -> Iterator[str]:
        message = codec.decode_message(kind, payload, codec.Role.ROBOT, self._protocol)
        if message is None:
            raise RemoteProtocolError(f"the robot sent an RTDE package of the unknown type {kind}")
        yield f"byte {self._position}: {type(message).__name__}, {size} bytes"
        match message:
            case codec.DataPackage(values, _) if self._recipe is not None:
                for name, value in zip(self._recipe.names, self._recipe.decode(values), strict=True):
                    yield f"  {name:<{_WIDTH}} {_text(value)}"
                return
            case codec.RequestProtocolVersionReply(True):
                self._protocol = 2  # version 1 needs no request
            case codec.SetupOutputsReply(types):
                self._take_types(types)
        yield from _describe(message)

    def _take_types(self, types: tuple[str, ...]) -> None:
        names = tuple(self._names[i] if i < len(self._names) else f"value {i + 1}" for i in range(len(types)))
        self.refused = {name: word for name, word in zip(names, types, strict=True) if word in REFUSALS}
        try:
            self._recipe = None if self.refused else Recipe(names, map(RtdeType, types))
        except ValueError as problem:
            raise RemoteProtocolError(f"the robot answered with an unknown type: {problem}") from None


def _describe(package: Any) -> Iterator[str]:
    if isinstance(package, RobotState):
        for sub_package in package.sub_packages:
            yield f"  {type(sub_package).__name__}"
            yield from (f"  {line}" for line in _describe(sub_package))
        return
    units = {field.name: field.unit for field in wire_fields(type(package))}
    for field in dataclasses.fields(package):
        value = getattr(package, field.name)
        text = "none" if value == NO_TIME else _text(value)
        yield f"  {field.name:<{_WIDTH}} {text} {units.get(field.name, '')}".rstrip()


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.hex(" ")
    if isinstance(value, str | bool):
        return repr(value)
    if isinstance(value, TypedValue):
        return f"{value.type.value} {value}"
    if isinstance(value, ThreadLabel):
        return f"{value.thread_name!r}: {value.label_id} {value.text!r}"
    if isinstance(value, SoftwareVersion):
        return str(value)
    if isinstance(value, float | int):
        return f"{value:.10g}" if isinstance(value, float) else str(value)
    if value is None:
        return "none"
    return "[" + ", ".join(_text(item) for item in list(value)) + "]"


# --- tables


def describe_layouts(version: SoftwareVersion, interface: str = "") -> Iterator[str]:
    """The tables of one software version as lines of text; of one interface, or of all."""
    layout_for_version(version)  # raises LocalProtocolError if there is no such software
    parts = {"realtime": _realtime_layout, "primary": _primary_layout, "rtde": _rtde_layout}
    chosen = [parts["primary" if interface == "secondary" else interface]] if interface else parts.values()
    for number, part in enumerate(chosen):
        if number:
            yield ""
        yield from part(version)


def _realtime_layout(version: SoftwareVersion) -> Iterator[str]:
    layout = layout_for_version(version)
    yield f"Realtime interface, port 30003, software {version}: {layout.size} bytes"
    yield f"{'byte':>5} {'floats':>6}  {'name':<28} {'unit':<12} {'box':<16} meaning"
    for column in layout.columns:
        yield (
            f"{layout.offset(column):>5} {column.count:>6}  {column.name:<28} {column.unit:<12} "
            f"{column.origin.value:<16} {column.meaning}"
        )


def _primary_layout(version: SoftwareVersion) -> Iterator[str]:
    yield (
        f"Robot state, ports 30001 and 30002, software {version}: "
        f"first {state_size(version, first=True)} bytes, later {state_size(version, first=False)}"
    )
    for record in state_types(version, first=True):
        yield f"  {record.SUB_TYPE} {record.__name__}{' (first state only)' * record.FIRST_STATE_ONLY}"
        yield from _describe_fields(record, version)
    yield ""
    yield "Robot messages, port 30001"
    for message in MESSAGES:
        yield f"  {message.MESSAGE_TYPE} {message.__name__}"
        yield from _describe_fields(message, version)
    yield ""
    yield "Types of global variables in program state messages, port 30001"
    for kind, code in value_codes(version).items():
        yield f"      {code:<8} {kind.value}"


def _rtde_layout(version: SoftwareVersion) -> Iterator[str]:
    tables: tuple[tuple[str, tuple[RtdeField, ...]], ...] = (("outputs", OUTPUTS), ("inputs", INPUTS))
    for number, (title, table) in enumerate(tables):
        fields = [field for field in table if field.since.covers(version)]
        if number:
            yield ""
        yield f"RTDE {title}, port 30004, software {version}: {len(fields)} variables"
        for field in fields:
            origin = field.origin.value if field.origin else ""
            yield (
                f"  {field.name:<36} {field.type.value:<14} {field.unit:<12} {origin:<16} {field.meaning}"
            ).rstrip()


def _describe_fields(record: type[Any], version: SoftwareVersion) -> Iterator[str]:
    for field in wire_fields(record):
        if field.since.covers(version):
            yield f"      {type_name(field):<8} {field.name:<36} {field.unit:<10} {field.note}".rstrip()
            if field.record is not None:
                yield from (f"  {line}" for line in _describe_fields(field.record, version))


_TYPE_NAMES = {
    "?": "bool", "b": "i8", "B": "u8", "H": "u16", "i": "i32", "I": "u32", "Q": "u64", "f": "f32", "d": "f64",
    "p": "u8+text", "t": "i32+text", "s": "text", "*": "records",
}  # fmt: skip


def type_name(field: WireField) -> str:
    """Type of a field, such as `f64 x6`."""
    return _TYPE_NAMES[field.code] + (f" x{field.count}" if field.count > 1 else "")
