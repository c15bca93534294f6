"""Records of the wire: a dataclass whose fields declare type, unit and first version.

    @dataclass(frozen=True, slots=True)
    class CartesianInfo(...):
        tcp_pose: tuple[float, ...] = wire("d", count=6, unit="m, rad", note="pose of the TCP in base")
        tcp_offset: tuple[float, ...] = wire("d", count=6, since=since((3, 1)))

`codec_for(CartesianInfo, version)` makes the encoder and decoder; everything is big-endian.
Field types are the letters of `struct`, and four of ours. Text: `p`, a byte with the length, then the text;
`t`, the same with a length of 32 bits; `s`, text up to the end of the record (last field only). Text travels
as Latin-1. `*`: records of another table, as many as there are up to the end (last field only).

The tables are in `primary.layout` and `primary.messages`.
"""

import dataclasses
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Any, Generic, TypeVar

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.ur_types import SoftwareVersion

__all__ = [
    "ALWAYS",
    "OLDEST",
    "Codec",
    "Since",
    "ValueOrigin",
    "WireField",
    "codec_for",
    "since",
    "wire",
    "wire_fields",
]


class ValueOrigin(Enum):
    """Where the emulated box takes a value from; every value of every port has one."""

    MEASURED = "measured"
    """From the simulated arm through its simulated sensors: delay, noise and dead band included."""
    MODELLED = "modelled"
    """Computed in the box: set-points, kinematics of measured joints, estimates, states of its machines."""
    PROPERTY = "of this arm"
    """From the numbers of the arm, its type or its calibration: the same as long as the box lives."""
    CONSTANT = "constant"
    """A plausible fixed value that is not simulated."""
    INTERNAL_ZERO = "internal, zero"
    """Meaning unpublished; always sent as 0, and clients ignore it."""


@dataclass(frozen=True, slots=True)
class Since:
    """First software version of each generation: CB3 is 3.x, e-Series 5.x; None means never.

    PolyScope X has what the e-Series software of its time has, see `SoftwareVersion.as_e_series`.
    """

    cb3: SoftwareVersion | None
    e_series: SoftwareVersion | None

    def covers(self, version: SoftwareVersion) -> bool:
        """Whether software `version` has it."""
        first = self.cb3 if version.major < 5 else self.e_series
        return first is not None and version.as_e_series >= first

    def __str__(self) -> str:
        return " / ".join(
            str(first).removesuffix(".0") if first else "-" for first in (self.cb3, self.e_series)
        )


def since(cb3: tuple[int, int] | None, e_series: tuple[int, int] | None = (5, 0)) -> Since:
    """Shorthand for table rows: `since((3, 10), (5, 4))`."""
    return Since(cb3 and SoftwareVersion(*cb3), e_series and SoftwareVersion(*e_series))


OLDEST = SoftwareVersion(3, 0)
"""First software with the present layouts; those before were others and are not in the tables."""

ALWAYS = since((3, 0))
"""As old as the present layouts."""


@dataclass(frozen=True, slots=True)
class WireField:
    """One row of a record's table.

    Attributes:
        code: `struct` letter, `p`, `t` or `s` for text, `*` for records.
        count: 1 for a scalar, else the value is a tuple of so many.
        interleaved: fields that follow one another with the same name here share their elements' places:
            first element of each, then second of each, and so on.
        only_if: name of an earlier field that must be true, or the field is absent.
        since: first versions that have the field.
        unit: SI unit, "enum", or "".
        record: table of the records of a `*`.
        origin: where the emulated box takes it from; None for fields of messages.
    """

    name: str
    code: str
    count: int
    interleaved: str
    only_if: str
    since: Since
    unit: str
    note: str
    record: type[Any] | None = None
    origin: ValueOrigin | None = None


_METADATA_KEY = "wire"
_ZEROS = {"?": False, "f": 0.0, "d": 0.0, "p": "", "t": "", "s": "", "*": ()}
"""Defaults of the types that are no whole numbers."""


def wire(
    code: str,
    note: str = "",
    *,
    default: Any = None,
    count: int = 1,
    unit: str = "",
    interleaved: str = "",
    only_if: str = "",
    since: Since = ALWAYS,
    record: type[Any] | None = None,
    origin: ValueOrigin | None = None,
) -> Any:
    """Declare a field of a record; see `WireField`.

    The default of a vector is `count` times `default`, which is the zero of the type if none is given.
    """
    row = WireField("", code, count, interleaved, only_if, since, unit, note, record, origin)
    if default is None:
        default = _ZEROS.get(code, 0)
    value = (default,) * count if count > 1 else default
    return dataclasses.field(default=value, metadata={_METADATA_KEY: row})


def wire_fields(record: type[Any]) -> tuple[WireField, ...]:
    """The table of a record class, in the order of the wire; fields that do not travel are left out."""
    return tuple(
        dataclasses.replace(field.metadata[_METADATA_KEY], name=field.name)
        for field in dataclasses.fields(record)
        if _METADATA_KEY in field.metadata
    )


# --- codecs: consecutive numeric fields are one `struct`, texts are encoded one by one


R = TypeVar("R")

_PREFIX_SIZES = {"p": 1, "t": 4}
"""Bytes of the length before a text; for a text without one the package ends it."""
_VARIABLE = frozenset("pts*")
"""Fields whose size depends on their value."""


class Codec(Generic[R]):
    """Encoder and decoder of one record class for one set of its fields.

    Attributes:
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

    `present` names the conditions (`only_if`) that hold. LocalProtocolError if the software is older than
    `OLDEST`.
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
