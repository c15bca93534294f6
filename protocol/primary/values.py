"""Values of script variables on the primary port: a code for the type, then the value.

The codes changed twice; the encodings did not. A list is a count and its typed elements, a matrix has two
counts and its typed elements row by row. Floats have 32 bits.

Sources: UR "Primary/Secondary Client Interface" (2021), section "variable values"; that CB3 3.14 has the
codes of 5.9: a public client (Hirebotics/urscript-tools).
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import cache
from typing import Any

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.ur_types import SoftwareVersion

__all__ = [
    "MAX_NESTING",
    "VALUE_CODES",
    "TypedValue",
    "ValueType",
    "decode_value",
    "encode_value",
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
        type: what it is.
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

    Raises:
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

    Raises:
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
