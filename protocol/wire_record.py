"""Records of the wire: a dataclass whose fields declare type, unit and first version.

    @dataclass(frozen=True, slots=True)
    class CartesianInfo(...):
        tcp_pose: tuple[float, ...] = wire("d", count=6, unit="m, rad", note="pose of the TCP in base")
        tcp_offset: tuple[float, ...] = wire("d", count=6, since=since((3, 1)))

`wire_codec.codec_for(CartesianInfo, version)` makes the encoder and decoder; everything is big-endian.
Field types are the letters of `struct`, and four of ours. Text: `p`, a byte with the length, then the text;
`t`, the same with a length of 32 bits; `s`, text up to the end of the record (last field only). Text travels
as Latin-1. `*`: records of another table, as many as there are up to the end (last field only).

The tables are in `primary.layout` and `primary.messages`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from enum import Enum
from typing import Any

from protocol.ur_types import SoftwareVersion

__all__ = ["ALWAYS", "OLDEST", "Since", "ValueOrigin", "WireField", "since", "wire", "wire_fields"]


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
        name: attribute of the record.
        code: `struct` letter, `p`, `t` or `s` for text, `*` for records.
        count: 1 for a scalar, else the value is a tuple of so many.
        interleaved: fields that follow one another with the same name here share their elements' places:
            first element of each, then second of each, and so on.
        only_if: name of an earlier field that must be true, or the field is absent.
        since: first versions that have the field.
        unit: SI unit, "enum", or "".
        note: meaning.
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


def wire(
    code: str,
    note: str = "",
    *,
    default: Any = 0,
    count: int = 1,
    unit: str = "",
    interleaved: str = "",
    only_if: str = "",
    since: Since = ALWAYS,
    record: type[Any] | None = None,
    origin: ValueOrigin | None = None,
) -> Any:
    """Declare a field of a record; see `WireField`. The default of a vector is `count` times `default`."""
    row = WireField("", code, count, interleaved, only_if, since, unit, note, record, origin)
    value = (default,) * count if count > 1 else default
    return dataclasses.field(default=value, metadata={_METADATA_KEY: row})


def wire_fields(record: type[Any]) -> tuple[WireField, ...]:
    """The table of a record class, in the order of the wire; fields that do not travel are left out."""
    return tuple(
        dataclasses.replace(field.metadata[_METADATA_KEY], name=field.name)
        for field in dataclasses.fields(record)
        if _METADATA_KEY in field.metadata
    )
