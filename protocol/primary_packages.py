"""Packages of the primary and secondary ports: framing, robot state, messages; both directions.

    package    = i32 size, itself included | u8 package type | body
    state body = sub-package*      sub-package = i32 size, itself included | u8 sub-type | fields

A new connection gets the version message (its own segment: some clients read it from a single `recv`), then
the startup message, then states at 10 Hz, of which the first holds all sub-packages. On the secondary port
only the messages in `SECONDARY_MESSAGES` are sent. Cut a received stream with
`FrameBuffer(MAX_PACKAGE_SIZE, MIN_...)`.

A reader goes by sizes, as the vendor tells clients to: unknown packages and sub-packages come out as they
are, surplus bytes at the end of a known one are skipped.

Sources: UR "Primary/Secondary Client Interface" (2021); order and sizes from captures of 3.3, 3.10, 5.4 and
5.8.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Any, TypeAlias, TypeVar

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.primary_layout import SUB_PACKAGES, SubPackage
from protocol.primary_messages import (
    RobotMessage,
    StartupMessage,
    VersionMessage,
    decode_message,
    encode_message,
)
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import OLDEST, Codec, codec_for, wire_fields

__all__ = [
    "MAX_PACKAGE_SIZE",
    "MIN_PACKAGE_SIZE",
    "SAFETY_TOLERANCES",
    "SECONDARY_MESSAGES",
    "Package",
    "PackageType",
    "RobotState",
    "SafetyTolerances",
    "UnknownPackage",
    "UnknownSubPackage",
    "decode_package",
    "decode_sub_package",
    "encode_message_package",
    "encode_package",
    "encode_safety_tolerances",
    "encode_state",
    "encode_sub_package",
    "state_size",
    "state_types",
]


class PackageType(IntEnum):
    """The byte after the size. Source: UR client library, `package_header.h`."""

    MODBUS_INFO = 5
    ROBOT_STATE = 16
    ROBOT_MESSAGE = 20
    HMC_MESSAGE = 22
    SAFETY_SETUP_BROADCAST = 23
    SAFETY_COMPLIANCE_TOLERANCES = 24
    PROGRAM_STATE = 25
    DISCONNECT = 255


_HEADER = struct.Struct(">iB")
MIN_PACKAGE_SIZE = _HEADER.size
MAX_PACKAGE_SIZE = 1 << 20
"""Beyond any package: states stay below 2000 bytes, a message carries one text."""

SECONDARY_MESSAGES: tuple[type[RobotMessage], ...] = (VersionMessage, StartupMessage)
"""The only robot messages that the secondary port carries."""

SAFETY_TOLERANCES = (
    0.15,
    25.0,
    0.0,
    3.0,
    *(0.2,) * 6,
    *(0.052359878,) * 6,
    0.0,
    0.0,
    0.0,
    0.01745329,
    0.001,
    0.01,
)
"""Body of package type 24; undocumented. Source: a byte capture of a CB3 3.10; 3.3 did not send the
package."""

_TOLERANCES = struct.Struct(f">{len(SAFETY_TOLERANCES)}d")

S = TypeVar("S", bound=SubPackage)


@dataclass(frozen=True, slots=True)
class UnknownSubPackage:
    """A part of a state that has no table here; `body` follows its five-byte header."""

    sub_type: int
    body: bytes


@dataclass(frozen=True, slots=True)
class RobotState:
    """One decoded state; `sub_packages` in the order of the wire."""

    sub_packages: tuple[SubPackage | UnknownSubPackage, ...]

    def find(self, record: type[S]) -> S | None:
        """The sub-package of a type, or None: `state.find(RobotModeData)`."""
        for sub_package in self.sub_packages:
            if isinstance(sub_package, record):
                return sub_package
        return None


@dataclass(frozen=True, slots=True)
class SafetyTolerances:
    """Package type 24: 22 numbers of undocumented meaning."""

    values: tuple[float, ...] = SAFETY_TOLERANCES


@dataclass(frozen=True, slots=True)
class UnknownPackage:
    """A package that has no table here; `body` follows its five-byte header."""

    package_type: int
    body: bytes


Package: TypeAlias = RobotState | RobotMessage | SafetyTolerances | UnknownPackage


# --- sending ---


def encode_package(package_type: int, body: bytes) -> bytes:
    """Put the header before a body."""
    return _HEADER.pack(_HEADER.size + len(body), package_type) + body


def encode_message_package(message: RobotMessage, version: SoftwareVersion) -> bytes:
    """A whole message package as software `version` sends it; raises as `encode_message`."""
    return encode_package(PackageType.ROBOT_MESSAGE, encode_message(message, version))


def encode_safety_tolerances(tolerances: SafetyTolerances | None = None) -> bytes:
    """A whole package of type 24."""
    values = (tolerances or SafetyTolerances()).values
    try:
        return encode_package(PackageType.SAFETY_COMPLIANCE_TOLERANCES, _TOLERANCES.pack(*values))
    except struct.error:
        raise LocalProtocolError(
            f"safety tolerances are {len(SAFETY_TOLERANCES)} numbers, not {values!r}"
        ) from None


def encode_sub_package(record: type[SubPackage], source: Any, version: SoftwareVersion) -> bytes:
    """One sub-package, header included, as software `version` sends it.

    Args:
        record: the sub-package's class, which is its table.
        source: an instance of it, or any object or mapping with fields of these names.
        version: software of the controller.

    Raises:
        LocalProtocolError: a field is missing or its value does not fit its type.
    """
    present = tuple(
        condition
        for condition in _CONDITIONS[record]
        if (source[condition] if isinstance(source, Mapping) else getattr(source, condition))
    )
    return encode_package(record.SUB_TYPE, codec_for(record, version, present).encode(source))


def encode_state(records: Iterable[SubPackage], version: SoftwareVersion) -> bytes:
    """A whole robot state package.

    Records may come in any order; those that software `version` does not have are left out. For the
    sub-packages that belong into a state see `state_types`.

    Raises:
        LocalProtocolError: two records of one type, a record without table, a value that does not fit, or
            software before 3.0.
    """
    if version < OLDEST:
        raise LocalProtocolError(f"no table for the robot state of software {version}: use {OLDEST} or later")
    given = {}
    for record in records:
        if type(record) in given or type(record) not in _ORDER:
            raise LocalProtocolError(
                f"a state takes every known sub-package once: {type(record).__name__} is unknown or repeated"
            )
        given[type(record)] = record
    return encode_package(
        PackageType.ROBOT_STATE,
        b"".join(
            encode_sub_package(record, given[record], version)
            for record in SUB_PACKAGES
            if record in given and record.SINCE.covers(version)
        ),
    )


def state_types(version: SoftwareVersion, *, first: bool) -> tuple[type[SubPackage], ...]:
    """The sub-packages of a state, in order: all in the first of a connection, fewer in the later ones.

    Software before 3.0 has none that we know.
    """
    return tuple(
        record
        for record in SUB_PACKAGES
        if record.SINCE.covers(version) and (first or not record.FIRST_STATE_ONLY)
    )


def state_size(version: SoftwareVersion, *, first: bool) -> int:
    """Bytes of a state package without Euromap67."""
    return _HEADER.size + sum(
        _HEADER.size + codec_for(record, version).size for record in state_types(version, first=first)
    )


# --- receiving ---


def decode_package(frame: bytes, version: SoftwareVersion) -> Package:
    """Read one whole package, as `FrameBuffer` cuts it.

    Args:
        frame: header and body.
        version: software of the controller, from its version message (which itself may be read with any);
            only messages depend on it.

    Raises:
        RemoteProtocolError: the body ends before its fields do, or sub-package sizes do not add up.
    """
    if len(frame) < _HEADER.size:
        raise RemoteProtocolError(f"a package of {len(frame)} bytes is shorter than its header")
    _, package_type = _HEADER.unpack_from(frame)
    body = frame[_HEADER.size :]
    if package_type == PackageType.ROBOT_STATE:
        return RobotState(tuple(_decode_state(body)))
    if package_type == PackageType.ROBOT_MESSAGE:
        return decode_message(body, version)
    if package_type == PackageType.SAFETY_COMPLIANCE_TOLERANCES and len(body) >= _TOLERANCES.size:
        return SafetyTolerances(_TOLERANCES.unpack_from(body))
    return UnknownPackage(package_type, body)


def _decode_state(body: bytes) -> Iterable[SubPackage | UnknownSubPackage]:
    position = 0
    while position < len(body):
        left = len(body) - position
        size, sub_type = _HEADER.unpack_from(body, position) if left >= _HEADER.size else (0, 0)
        if not _HEADER.size <= size <= left:
            raise RemoteProtocolError(
                f"sub-package at byte {position + _HEADER.size} of a state says {size} bytes, {left} are left"
            )
        yield decode_sub_package(sub_type, body[position + _HEADER.size : position + size])
        position += size


def decode_sub_package(sub_type: int, data: bytes) -> SubPackage | UnknownSubPackage:
    """Read the fields of one sub-package; its size tells which software's form it is.

    Raises:
        RemoteProtocolError: shorter than the oldest form.
    """
    record = _BY_SUB_TYPE.get(sub_type)
    if record is None:
        return UnknownSubPackage(sub_type, data)
    oldest = _forms(sub_type, ())[0]
    fields = oldest.decode_fields(data)  # conditions stand where every form has them
    forms = _forms(sub_type, tuple(condition for condition in _CONDITIONS[record] if fields[condition]))
    best = oldest
    for form in forms:
        if form.size <= len(data):
            best = form
    return best.decode(data)


_ORDER = frozenset(SUB_PACKAGES)
_BY_SUB_TYPE = {record.SUB_TYPE: record for record in SUB_PACKAGES}
_CONDITIONS = {
    record: tuple(dict.fromkeys(field.only_if for field in wire_fields(record) if field.only_if))
    for record in SUB_PACKAGES
}


@cache
def _forms(sub_type: int, present: tuple[str, ...]) -> list[Codec[SubPackage]]:
    """All forms of a sub-package that some software sends under these conditions, shortest first."""
    record = _BY_SUB_TYPE[sub_type]
    firsts = {
        first
        for field in wire_fields(record)
        for first in (field.since.cb3, field.since.e_series)
        if first is not None
    }
    by_size = {codec.size: codec for codec in (codec_for(record, first, present) for first in sorted(firsts))}
    return [by_size[size] for size in sorted(by_size)]
