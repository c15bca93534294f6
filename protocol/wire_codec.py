"""Encoder and decoder made from a record's table (see `wire_record`), for one software version.

Consecutive numeric fields are one `struct`, texts are encoded one by one.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Generic, TypeVar

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import OLDEST, WireField, wire_fields

__all__ = ["Codec", "codec_for"]

R = TypeVar("R")

_PREFIX_SIZES = {"p": 1, "t": 4}
"""Bytes of the length before a text; for a text without one the package ends it."""
_VARIABLE = frozenset("pts*")
"""Fields whose size depends on their value."""


class Codec(Generic[R]):
    """Encoder and decoder of one record class for one set of its fields.

    Attributes:
        record: the class.
        fields: the rows that are on the wire.
        size: bytes of the fixed part; the whole record unless it has text.
    """

    __slots__ = ("_parts", "_version", "fields", "record", "size")

    def __init__(self, record: type[R], fields: tuple[WireField, ...], version: SoftwareVersion) -> None:
        self.record = record
        self.fields = fields
        self._version = version
        self._parts = _make_parts(fields)
        self.size = sum(
            part.size if isinstance(part, _Numbers) else _PREFIX_SIZES.get(part.code, 0)
            for part in self._parts
        )

    def encode(self, source: Any) -> bytes:
        """Bytes of a record, or of any object or mapping that has its fields.

        Raises:
            LocalProtocolError: a field is missing or its value does not fit its type.
        """
        get = source.__getitem__ if isinstance(source, Mapping) else partial(getattr, source)
        try:
            return b"".join(
                self._encode_field(part, get(part.name)) if isinstance(part, WireField) else part.encode(get)
                for part in self._parts
            )
        except (KeyError, AttributeError) as problem:
            raise LocalProtocolError(f"{self.record.__name__} needs the field {problem}") from None
        except (struct.error, TypeError, ValueError, IndexError, OverflowError) as problem:
            raise LocalProtocolError(f"{self.record.__name__} cannot be sent: {problem}") from None

    def decode(self, data: bytes) -> R:
        """Record from bytes; fields that are not on the wire get their defaults. See `decode_fields`."""
        return self.record(**self.decode_fields(data))

    def decode_fields(self, data: bytes) -> dict[str, Any]:
        """Values by field name; surplus bytes at the end are skipped, as the vendor asks of clients.

        Raises:
            RemoteProtocolError: the bytes end before the fields do.
        """
        return self._decode_from(data, 0)[0]

    def _encode_field(self, field: WireField, value: Any) -> bytes:
        if field.record is None:
            return _encode_text(field, value)
        codec = codec_for(field.record, self._version)
        return b"".join(map(codec.encode, value))

    def _decode_from(self, data: bytes, position: int) -> tuple[dict[str, Any], int]:
        """The fields that begin at `position`, and where they end."""
        values: dict[str, Any] = {}
        for part in self._parts:
            if isinstance(part, WireField) and part.record is not None:
                codec = codec_for(part.record, self._version)
                records: list[Any] = []
                while position < len(data):
                    fields, position = codec._decode_from(data, position)
                    records.append(part.record(**fields))
                values[part.name] = tuple(records)
            elif isinstance(part, WireField):
                values[part.name], position = _decode_text(part, data, position)
            elif len(data) - position < part.size:
                raise RemoteProtocolError(
                    f"{self.record.__name__} needs {self.size} bytes or more, these are {len(data)}"
                )
            else:
                part.decode(data, position, values)
                position += part.size
        return values, position


class _Numbers:
    """A run of numeric fields: one `struct` for all of them."""

    __slots__ = ("_places", "_struct", "size")

    def __init__(self, fields: list[WireField]) -> None:
        letters: list[str] = []
        places: list[tuple[WireField, list[int]]] = []
        while fields:
            group = [fields[0]]
            while (
                group[0].interleaved
                and len(group) < len(fields)
                and fields[len(group)].interleaved == group[0].interleaved
            ):
                group.append(fields[len(group)])
            fields = fields[len(group) :]
            start, step = len(letters), len(group)
            for k, field in enumerate(group):
                places.append((field, [start + k + i * step for i in range(field.count)]))
            letters += [field.code for _ in range(group[0].count) for field in group]
        self._places = places
        self._struct = struct.Struct(">" + "".join(letters))
        self.size = self._struct.size

    def encode(self, get: Callable[[str], Any]) -> bytes:
        flat: list[Any] = [0] * sum(len(places) for _, places in self._places)
        for field, places in self._places:
            value = get(field.name)
            if field.count == 1:
                flat[places[0]] = value
            elif len(value) != field.count:
                raise ValueError(f"{field.name} has {len(value)} values instead of {field.count}")
            else:
                flat[places[0] : places[-1] + 1 : places[1] - places[0]] = value
        try:
            return self._struct.pack(*flat)
        except (struct.error, OverflowError):
            raise self._explain(get) from None

    def _explain(self, get: Callable[[str], Any]) -> ValueError:
        for field, _ in self._places:
            value = get(field.name)
            for item in value if field.count > 1 else (value,):
                try:
                    struct.pack(">" + field.code, item)
                except (struct.error, OverflowError) as problem:
                    return ValueError(f"{field.name} is {item!r}: {problem}")
        return ValueError("no single field is wrong")

    def decode(self, data: bytes, position: int, values: dict[str, Any]) -> None:
        flat = self._struct.unpack_from(data, position)
        for field, places in self._places:
            if field.count == 1:
                values[field.name] = flat[places[0]]
            else:
                values[field.name] = flat[places[0] : places[-1] + 1 : places[1] - places[0]]


def _make_parts(fields: tuple[WireField, ...]) -> tuple[_Numbers | WireField, ...]:
    parts: list[_Numbers | WireField] = []
    run: list[WireField] = []
    for field in fields:
        if field.code in _VARIABLE:
            if run:
                parts.append(_Numbers(run))
                run = []
            parts.append(field)
        else:
            run.append(field)
    if run:
        parts.append(_Numbers(run))
    return tuple(parts)


def _encode_text(field: WireField, text: str) -> bytes:
    data = text.encode("latin-1", "replace")
    if field.code == "s":
        return data
    if field.code == "t":
        return struct.pack(">i", len(data)) + data
    if len(data) > 255:
        raise ValueError(f"{field.name} has {len(data)} characters, 255 fit")
    return bytes((len(data),)) + data


def _decode_text(field: WireField, data: bytes, position: int) -> tuple[str, int]:
    if field.code == "s":
        return data[position:].decode("latin-1"), len(data)
    begin = position + _PREFIX_SIZES[field.code]
    length = int.from_bytes(data[position:begin], "big")
    if begin + length > len(data):
        raise RemoteProtocolError(f"the text {field.name} is cut off by the end of its package")
    return data[begin : begin + length].decode("latin-1"), begin + length


_codecs: dict[Any, Codec[Any]] = {}


def codec_for(record: type[R], version: SoftwareVersion, present: tuple[str, ...] = ()) -> Codec[R]:
    """The codec of a record class as software `version` sends it; made once.

    Args:
        record: a dataclass with `wire` fields.
        version: software of the controller.
        present: names of the `only_if` conditions that hold.

    Raises:
        LocalProtocolError: the software is older than `OLDEST`.
    """
    if version < OLDEST:
        raise LocalProtocolError(
            f"software {version} had other layouts on the primary ports: use {OLDEST} or later"
        )
    key = (record, version, present)
    codec = _codecs.get(key)
    if codec is None:
        fields = tuple(
            field
            for field in wire_fields(record)
            if field.since.covers(version) and (not field.only_if or field.only_if in present)
        )
        codec = _codecs[key] = Codec(record, fields, version)
    return codec
