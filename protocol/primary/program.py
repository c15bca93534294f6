"""Program state messages (package type 25) of the primary port: the global variables of a program.

    i32 size | u8 25 | u64 timestamp | u8 sub-type | fields
    0 setup:   u16 index of the first name  | names, each ended by a line feed
    1 update:  u16 index of the first value | values, each u8 type, value, line feed
    2 one variable (deprecated): u8 title size | title | text

A variable is known by its index: names come once, values when they change. A value may contain the byte
of a line feed itself, so the end of a value follows from its type.

Sources: UR "Primary/Secondary Client Interface" (2021); the codes of 3.14 from a public client
(Hirebotics/urscript-tools).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import ClassVar

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.primary.framing import NO_TIME, PackageType, encode_package
from protocol.primary.values import TypedValue, decode_value, encode_value
from protocol.ur_types import SoftwareVersion

__all__ = [
    "GlobalVariablesSetup",
    "GlobalVariablesUpdate",
    "ProgramStateMessage",
    "UnknownProgramState",
    "VariableUpdate",
    "decode_program_state",
    "encode_program_state",
    "encode_values",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramStateMessage:
    """What all program state messages share.

    Attributes:
        SUB_TYPE: number on the wire.
        timestamp: microseconds since controller start, or NO_TIME.
    """

    SUB_TYPE: ClassVar[int]

    timestamp: int = NO_TIME


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalVariablesSetup(ProgramStateMessage):
    """Names of global variables.

    Attributes:
        start_index: of the first name.
        names: they count on from there.
    """

    SUB_TYPE: ClassVar[int] = 0

    start_index: int = 0
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalVariablesUpdate(ProgramStateMessage):
    """Values of global variables.

    Attributes:
        start_index: of the first value.
        values: those of the variables from there on.
    """

    SUB_TYPE: ClassVar[int] = 1

    start_index: int = 0
    values: tuple[TypedValue, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableUpdate(ProgramStateMessage):
    """One variable as text; deprecated."""

    SUB_TYPE: ClassVar[int] = 2

    title: str = ""
    text: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnknownProgramState(ProgramStateMessage):
    """A sub-type that has no table here; `body` is what follows it."""

    SUB_TYPE: ClassVar[int] = -1

    sub_type: int
    body: bytes


_HEADER = struct.Struct(">QB")  # timestamp, sub-type
_INDEX = struct.Struct(">H")
_END = b"\n"


def encode_program_state(message: ProgramStateMessage, version: SoftwareVersion) -> bytes:
    """A whole package of type 25 as software `version` sends it.

    Raises:
        LocalProtocolError: a value does not fit, or the message has no table.
    """
    match message:
        case GlobalVariablesSetup(start_index=start, names=names):
            if any("\n" in name for name in names):
                raise LocalProtocolError(f"a variable name holds no line feed: {names!r}")
            body = _index(start) + b"".join(name.encode("latin-1", "replace") + _END for name in names)
        case GlobalVariablesUpdate(start_index=start, values=values):
            return encode_values(message.timestamp, start, [encode_value(item, version) for item in values])
        case VariableUpdate(title=title, text=text):
            data = title.encode("latin-1", "replace")
            if len(data) > 255:
                raise LocalProtocolError(f"title has {len(data)} characters, 255 fit")
            body = bytes((len(data),)) + data + text.encode("latin-1", "replace")
        case _:
            raise LocalProtocolError(f"{type(message).__name__} has no table and cannot be sent")
    return _package(message.timestamp, message.SUB_TYPE, body)


def encode_values(timestamp: int, start_index: int, values: list[bytes]) -> bytes:
    """The package of a `GlobalVariablesUpdate` whose values are encoded already.

    Raises:
        LocalProtocolError: the index does not fit.
    """
    body = _index(start_index) + b"".join(value + _END for value in values)
    return _package(timestamp, GlobalVariablesUpdate.SUB_TYPE, body)


def _index(start: int) -> bytes:
    try:
        return _INDEX.pack(start)
    except struct.error:
        raise LocalProtocolError(f"start index {start} cannot be sent: 0 to 65535 fit") from None


def _package(timestamp: int, sub_type: int, body: bytes) -> bytes:
    try:
        header = _HEADER.pack(timestamp, sub_type)
    except struct.error as problem:
        raise LocalProtocolError(f"timestamp {timestamp} cannot be sent: {problem}") from None
    return encode_package(PackageType.PROGRAM_STATE, header + body)


def decode_program_state(body: bytes, version: SoftwareVersion) -> ProgramStateMessage:
    """Read the body of a package of type 25, from the timestamp on.

    Args:
        body: what follows the package header.
        version: software of the controller: its codes of value types are not those of another.

    Raises:
        RemoteProtocolError: the body ends before its fields do, or a value has no known type.
    """
    if len(body) < _HEADER.size:
        raise RemoteProtocolError(f"a program state message of {len(body)} bytes is shorter than its header")
    timestamp, sub_type = _HEADER.unpack_from(body)
    data = body[_HEADER.size :]
    if sub_type == VariableUpdate.SUB_TYPE:
        end = 1 + data[0] if data else 1
        if end > len(data):
            raise RemoteProtocolError("the title of a variable is cut off by the end of its package")
        return VariableUpdate(
            timestamp=timestamp, title=data[1:end].decode("latin-1"), text=data[end:].decode("latin-1")
        )
    if sub_type not in (GlobalVariablesSetup.SUB_TYPE, GlobalVariablesUpdate.SUB_TYPE):
        return UnknownProgramState(timestamp=timestamp, sub_type=sub_type, body=data)
    if len(data) < _INDEX.size:
        raise RemoteProtocolError("a global variables message ends before its start index")
    (start,) = _INDEX.unpack_from(data)
    if sub_type == GlobalVariablesSetup.SUB_TYPE:
        *names, rest = data[_INDEX.size :].split(_END)
        if rest:
            raise RemoteProtocolError("the last variable name is not ended by a line feed")
        return GlobalVariablesSetup(
            timestamp=timestamp, start_index=start, names=tuple(name.decode("latin-1") for name in names)
        )
    values: list[TypedValue] = []
    position = _INDEX.size
    while position < len(data):
        value, position = decode_value(data, position, version)
        if data[position : position + 1] != _END:
            raise RemoteProtocolError(f"no line feed ends the value of variable {start + len(values)}")
        values.append(value)
        position += 1
    return GlobalVariablesUpdate(timestamp=timestamp, start_index=start, values=tuple(values))
