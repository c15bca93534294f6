"""Script variables on the primary port: a value is a code for the type, then its bytes.

The codes changed twice; the encodings did not. A list is a count and its typed elements, a matrix has two
counts and its typed elements row by row. Floats have 32 bits.

Sources: UR "Primary/Secondary Client Interface" (2021), section "variable values"; that CB3 3.14 has the
codes of 5.9: a public client (Hirebotics/urscript-tools).
"""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Any, ClassVar

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.primary.framing import NO_TIME, PackageType, encode_package
from protocol.ur_types import SoftwareVersion

__all__ = [
    "MAX_NESTING",
    "VALUE_CODES",
    "GlobalVariablesSetup",
    "GlobalVariablesUpdate",
    "ProgramStateMessage",
    "TypedValue",
    "UnknownProgramState",
    "ValueType",
    "VariableUpdate",
    "decode_program_state",
    "decode_value",
    "encode_names",
    "encode_program_state",
    "encode_value",
    "encode_values",
    "value_codes",
]


class ValueType(Enum):
    """What a variable holds; the words are those of the documents."""

    NONE = "none"
    CONST_STRING = "const string"
    VAR_STRING = "var string"
    LIST = "list"
    POSE = "pose"
    BOOL = "bool"
    NUM = "num"
    INT = "int"
    FLOAT = "float"
    MATRIX = "matrix"


VALUE_CODES: tuple[tuple[ValueType, int | None, int | None, int | None], ...] = (
    # type                  3.0    3.3   3.14  and later; 5.0 and 5.9 pair with the last two
    (ValueType.NONE,           0,    0,    0),
    (ValueType.CONST_STRING,   3,    3,    3),
    (ValueType.VAR_STRING,  None,    4,    4),
    (ValueType.LIST,           4,    5,   17),
    (ValueType.POSE,           9,   10,   12),
    (ValueType.BOOL,          11,   12,   13),
    (ValueType.NUM,           12,   13,   14),
    (ValueType.INT,           13,   14,   15),
    (ValueType.FLOAT,         14,   15,   16),
    (ValueType.MATRIX,      None, None,   18),
)  # fmt: skip
"""Codes by software version; None where a version does not have the type."""

MAX_NESTING = 32
"""Lists within lists are read and written to this depth; no program is known to have more than two."""


@dataclass(frozen=True, slots=True)
class TypedValue:
    """One value.

    Attributes:
        value: None, bool, int, float or str; six floats (m, rad) for a pose; a tuple of TypedValue for a
            list; a tuple of such tuples, all equally long, for a matrix.
    """

    type: ValueType
    value: Any = None

    def __str__(self) -> str:
        match self.type:
            case ValueType.LIST:
                return _listed(self.value)
            case ValueType.MATRIX:
                return f"[{', '.join(map(_listed, self.value))}]"
            case ValueType.POSE:
                return f"p[{', '.join(f'{number:.6g}' for number in self.value)}]"
            case ValueType.FLOAT | ValueType.NUM:
                return f"{self.value:.6g}"
        return repr(self.value)


def _listed(values: tuple[TypedValue, ...]) -> str:
    return f"[{', '.join(map(str, values))}]"


def _column(version: SoftwareVersion) -> int:
    if version.major >= 5:
        return 3 if version >= SoftwareVersion(5, 9) else 2
    return 3 if version >= SoftwareVersion(3, 14) else 2 if version >= SoftwareVersion(3, 3) else 1


@cache
def _codes(column: int) -> Mapping[ValueType, int]:
    found: dict[ValueType, int] = {}
    for row in VALUE_CODES:
        code = row[column]
        if isinstance(code, int):
            found[row[0]] = code
    return found


def value_codes(version: SoftwareVersion) -> Mapping[ValueType, int]:
    """The codes that software `version` sends."""
    return _codes(_column(version))


@cache
def _types(column: int) -> Mapping[int, ValueType]:
    return {code: kind for kind, code in _codes(column).items()}


# --- sending ---


def encode_value(value: TypedValue, version: SoftwareVersion) -> bytes:
    """Code and value as software `version` sends them; a float beyond 32 bits becomes infinite.

    LocalProtocolError: this software does not have the type, or the value is not one of it.
    """
    try:
        return _encode(value, value_codes(version), 0)
    except (struct.error, TypeError, ValueError, AttributeError, OverflowError) as problem:
        raise LocalProtocolError(f"{value!r} cannot be sent: {problem}") from None


def _encode(value: TypedValue, codes: Mapping[ValueType, int], depth: int) -> bytes:
    if depth > MAX_NESTING:
        raise ValueError(f"lists are nested deeper than {MAX_NESTING}")
    code = codes.get(value.type)
    if code is None:
        raise ValueError(f"this software has no variables of type {value.type.value}")
    head, content = bytes((code,)), value.value
    match value.type:
        case ValueType.LIST:
            items = b"".join(_encode(item, codes, depth + 1) for item in content)
            return head + struct.pack(">h", len(content)) + items
        case ValueType.MATRIX:
            columns = {len(row) for row in content} or {0}
            if len(columns) > 1:
                raise ValueError("the rows of a matrix are equally long")
            items = b"".join(_encode(item, codes, depth + 1) for row in content for item in row)
            return head + struct.pack(">hh", len(content), columns.pop()) + items
    return head + _SIMPLE[value.type][0](content)


def _encode_text(text: str) -> bytes:
    data = text.encode("latin-1", "replace")
    return struct.pack(">h", len(data)) + data


def _encode_floats(numbers: tuple[float, ...]) -> bytes:
    if len(numbers) != 6:
        raise ValueError(f"a pose has 6 numbers, not {len(numbers)}")
    return b"".join(map(_encode_float, numbers))


def _encode_float(number: float) -> bytes:
    try:
        return struct.pack(">f", number)
    except OverflowError:
        return struct.pack(">f", math.copysign(math.inf, number))


# --- receiving ---


def decode_value(data: bytes, position: int, version: SoftwareVersion) -> tuple[TypedValue, int]:
    """Read the value that begins at `position`; returns it and where it ends.

    RemoteProtocolError: the data end before the value does, or its type is unknown.
    """
    try:
        return _decode(data, position, _types(_column(version)), 0)
    except (struct.error, IndexError):
        raise RemoteProtocolError(
            f"the value at byte {position} is cut off by the end of the package"
        ) from None


def _decode(data: bytes, position: int, types: Mapping[int, ValueType], depth: int) -> tuple[TypedValue, int]:
    kind = types.get(data[position])
    if kind is None:
        raise RemoteProtocolError(f"{data[position]} at byte {position} is not a type of a variable")
    if depth > MAX_NESTING:
        raise RemoteProtocolError(f"lists are nested deeper than {MAX_NESTING}")
    position += 1
    if kind in (ValueType.LIST, ValueType.MATRIX):
        size = 1 if kind is ValueType.LIST else 2
        counts = struct.unpack_from(">hh"[: size + 1], data, position)
        if min(counts) < 0:
            raise RemoteProtocolError(f"a {kind.value} at byte {position} has {min(counts)} elements")
        position += 2 * size
        items: list[TypedValue] = []
        for _ in range(math.prod(counts)):
            item, position = _decode(data, position, types, depth + 1)
            items.append(item)
        if kind is ValueType.LIST:
            return TypedValue(kind, tuple(items)), position
        rows, columns = counts
        return TypedValue(
            kind, tuple(tuple(items[i * columns : (i + 1) * columns]) for i in range(rows))
        ), position
    content, size = _SIMPLE[kind][1](data, position)
    return TypedValue(kind, content), position + size


def _decode_text(data: bytes, position: int) -> tuple[str, int]:
    (length,) = struct.unpack_from(">h", data, position)
    text = data[position + 2 : position + 2 + length] if length >= 0 else b""
    if len(text) != length:
        raise RemoteProtocolError(f"the text at byte {position} is cut off by the end of its package")
    return text.decode("latin-1"), 2 + length


def _number(code: str) -> tuple[Callable[[Any], bytes], Callable[[bytes, int], tuple[Any, int]]]:
    form = struct.Struct(">" + code)
    return form.pack, lambda data, position: (form.unpack_from(data, position)[0], form.size)


_TEXT = (_encode_text, _decode_text)
_FLOAT = (_encode_float, _number("f")[1])
_SIMPLE: dict[ValueType, tuple[Callable[[Any], bytes], Callable[[bytes, int], tuple[Any, int]]]] = {
    ValueType.NONE: (lambda _: b"", lambda _data, _position: (None, 0)),
    ValueType.CONST_STRING: _TEXT,
    ValueType.VAR_STRING: _TEXT,
    ValueType.POSE: (_encode_floats, lambda data, position: (struct.unpack_from(">6f", data, position), 24)),
    ValueType.BOOL: _number("?"),
    ValueType.NUM: _FLOAT,
    ValueType.INT: _number("i"),
    ValueType.FLOAT: _FLOAT,
}
"""How each type without elements is written, and read: its content and its size."""


# --- program state messages (package type 25): the global variables of a program
#
#     i32 size | u8 25 | u64 timestamp | u8 sub-type | fields
#     0 setup:   u16 index of the first name  | names, each ended by a line feed
#     1 update:  u16 index of the first value | values, each u8 type, value, line feed
#     2 one variable (deprecated): u8 title size | title | text
#
# A variable is known by its index: names come once, values when they change. A value may contain the byte
# of a line feed itself, so the end of a value follows from its type.


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramStateMessage:
    """What all program state messages share.

    The time stamp is in microseconds since controller start, or NO_TIME; SUB_TYPE is the number on the wire.
    """

    SUB_TYPE: ClassVar[int]

    timestamp: int = NO_TIME


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalVariablesSetup(ProgramStateMessage):
    """Names of global variables; they count on from the index of the first."""

    SUB_TYPE: ClassVar[int] = 0

    start_index: int = 0
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class GlobalVariablesUpdate(ProgramStateMessage):
    """Values of global variables, from the index of the first one on."""

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

    LocalProtocolError: a value does not fit, or the message has no table.
    """
    match message:
        case GlobalVariablesSetup(start_index=start, names=names):
            if any("\n" in name for name in names):
                raise LocalProtocolError(f"a variable name holds no line feed: {names!r}")
            return encode_names(
                message.timestamp, start, [name.encode("latin-1", "replace") for name in names]
            )
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


def encode_names(timestamp: int, start_index: int, names: list[bytes]) -> bytes:
    """The package of a `GlobalVariablesSetup` whose names are encoded already."""
    return _variables(timestamp, GlobalVariablesSetup.SUB_TYPE, start_index, names)


def encode_values(timestamp: int, start_index: int, values: list[bytes]) -> bytes:
    """The package of a `GlobalVariablesUpdate` whose values are encoded already."""
    return _variables(timestamp, GlobalVariablesUpdate.SUB_TYPE, start_index, values)


def _variables(timestamp: int, sub_type: int, start: int, items: list[bytes]) -> bytes:
    try:
        index = _INDEX.pack(start)
    except struct.error:
        raise LocalProtocolError(f"start index {start} cannot be sent: 0 to 65535 fit") from None
    return _package(timestamp, sub_type, index + _END.join([*items, b""]))


def _package(timestamp: int, sub_type: int, body: bytes) -> bytes:
    try:
        header = _HEADER.pack(timestamp, sub_type)
    except struct.error as problem:
        raise LocalProtocolError(f"timestamp {timestamp} cannot be sent: {problem}") from None
    return encode_package(PackageType.PROGRAM_STATE, header + body)


def decode_program_state(body: bytes, version: SoftwareVersion) -> ProgramStateMessage:
    """Read the body of a package of type 25, from the timestamp on.

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
