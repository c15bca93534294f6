"""Whole packages of the primary and secondary ports, for either end; the robot state among them.

    state body  = sub-package*
    sub-package = i32 size, itself included | u8 sub-type | fields

A new connection gets the version message (its own segment: some clients read it from a single `recv`),
then the startup message, then states at 10 Hz; the first state holds all sub-packages. On the secondary
port only the messages in `SECONDARY_MESSAGES` are sent.

The encoder uses the software version. The decoder of a state uses the sizes, as the vendor asks of clients:
surplus bytes at the end of a sub-package are skipped. Unknown packages and sub-packages are returned as they
are.

Sources: UR "Primary/Secondary Client Interface" (2021); order, sizes and what is sent from captures of 3.3,
3.10, 5.4, 5.8 and 5.11.
"""

import struct
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, TypeVar

from protocol.errors import LocalProtocolError, RemoteProtocolError
from protocol.primary.framing import HEADER, PackageType, SubPackage, encode_package
from protocol.primary.layout import SUB_PACKAGES
from protocol.primary.messages import (
    RobotMessage,
    StartupMessage,
    VersionMessage,
    decode_message,
    encode_message,
)
from protocol.primary.values import ProgramStateMessage, decode_program_state
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import OLDEST, Codec, Since, codec_for, since, wire_fields

__all__ = [
    "SECONDARY_MESSAGES",
    "Package",
    "RobotState",
    "SafetyTolerances",
    "UnknownPackage",
    "UnknownSubPackage",
    "decode_package",
    "decode_state",
    "decode_sub_package",
    "encode_message_package",
    "encode_safety_tolerances",
    "encode_state",
    "encode_sub_package",
    "sends_safety_tolerances",
    "split_state",
    "state_size",
    "state_types",
]

_S = TypeVar("_S", bound=SubPackage)


@dataclass(frozen=True, slots=True)
class UnknownSubPackage:
    """A sub-package without a table here; `body` follows its five-byte header."""

    sub_type: int
    body: bytes


@dataclass(frozen=True, slots=True)
class RobotState:
    """One decoded state; `sub_packages` in the order of the wire."""

    sub_packages: tuple[SubPackage | UnknownSubPackage, ...]

    def find(self, record: type[_S]) -> _S | None:
        """The sub-package of a type, or None: `state.find(RobotModeData)`."""
        for sub_package in self.sub_packages:
            if isinstance(sub_package, record):
                return sub_package
        return None


def encode_sub_package(record: type[SubPackage], source: Any, version: SoftwareVersion) -> bytes:
    """One sub-package, header included, as software `version` sends it.

    `source` is an instance of `record`, or any object or mapping with fields of these names.
    LocalProtocolError: a field is missing or its value does not fit its type.
    """
    present = tuple(
        condition
        for condition in _CONDITIONS[record]
        if (source[condition] if isinstance(source, Mapping) else getattr(source, condition))
    )
    return encode_package(record.SUB_TYPE, codec_for(record, version, present).encode(source))


def encode_state(
    records: Iterable[SubPackage],
    version: SoftwareVersion,
    sub_packages: Sequence[type[SubPackage]] = SUB_PACKAGES,
) -> bytes:
    """A whole robot state package.

    Records may come in any order; those that software `version` does not have are left out, and those that
    its generation does not have: `sub_packages` are in the order of the wire. For the sub-packages that
    belong into a state see `state_types`.

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
            for record in sub_packages
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
    return HEADER.size + sum(
        HEADER.size + codec_for(record, version).size for record in state_types(version, first=first)
    )


def decode_state(body: bytes) -> RobotState:
    """Read the body of a state package.

    RemoteProtocolError: sub-package sizes do not add up, or one is shorter than its oldest form.
    """
    return RobotState(tuple(decode_sub_package(*part) for part in split_state(body)))


def split_state(body: bytes) -> Iterator[tuple[int, bytes]]:
    """Cut the body of a state package into sub-packages: sub-type and what follows the five-byte header.

    RemoteProtocolError: their sizes do not add up.
    """
    position = 0
    while position < len(body):
        left = len(body) - position
        size, sub_type = HEADER.unpack_from(body, position) if left >= HEADER.size else (0, 0)
        if not HEADER.size <= size <= left:
            raise RemoteProtocolError(
                f"sub-package at byte {position + HEADER.size} of a state says {size} bytes, {left} are left"
            )
        yield sub_type, body[position + HEADER.size : position + size]
        position += size


def decode_sub_package(sub_type: int, data: bytes) -> SubPackage | UnknownSubPackage:
    """Read the fields of one sub-package; its size determines the software version of its form.

    RemoteProtocolError: it is shorter than the oldest form.
    """
    record = _BY_SUB_TYPE.get(sub_type)
    if record is None:
        return UnknownSubPackage(sub_type, data)
    oldest = _forms(sub_type, ())[0]
    fields = oldest.decode_fields(data)  # conditions have the same place in every form
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


# --- whole packages


SECONDARY_MESSAGES: tuple[type[RobotMessage], ...] = (VersionMessage, StartupMessage)
"""The only robot messages that the secondary port carries."""


@dataclass(frozen=True, slots=True)
class SafetyTolerances:
    """Package type 24: 22 numbers of undocumented meaning. Source: a byte capture of a CB3 3.10.

    Attributes:
        SINCE: the first software seen to send it. Source: captures of 3.3 (absent) and 3.10 (present).
        UNTIL: the first software that no longer sends it. Source: captures of 5.4 (present), 5.11 (absent).
    """

    SINCE: ClassVar[Since] = since((3, 10))
    UNTIL: ClassVar[SoftwareVersion] = SoftwareVersion(5, 11)

    values: tuple[float, ...] = (
        0.15, 25.0, 0.0, 3.0, *(0.2,) * 6, *(0.052359878,) * 6, 0.0, 0.0, 0.0, 0.01745329, 0.001, 0.01,
    )  # fmt: skip


_TOLERANCES = struct.Struct(">22d")


@dataclass(frozen=True, slots=True)
class UnknownPackage:
    """A package that has no table here; `body` follows its five-byte header."""

    package_type: int
    body: bytes


Package = RobotState | RobotMessage | ProgramStateMessage | SafetyTolerances | UnknownPackage


def sends_safety_tolerances(version: SoftwareVersion) -> bool:
    """Whether software `version` sends `SafetyTolerances` to new clients."""
    return SafetyTolerances.SINCE.covers(version) and version < SafetyTolerances.UNTIL


def encode_message_package(message: RobotMessage, version: SoftwareVersion) -> bytes:
    """A whole message package as software `version` sends it; raises as `encode_message`."""
    return encode_package(PackageType.ROBOT_MESSAGE, encode_message(message, version))


def encode_safety_tolerances() -> bytes:
    """A whole package of type 24."""
    return encode_package(
        PackageType.SAFETY_COMPLIANCE_TOLERANCES, _TOLERANCES.pack(*SafetyTolerances().values)
    )


def decode_package(frame: bytes, version: SoftwareVersion) -> Package:
    """Read one whole package, as `FrameBuffer` cuts it.

    The version is that of the controller's version message, which itself may be read with any; only messages
    and values of variables depend on it.

    Raises:
        RemoteProtocolError: the body ends before its fields do, or sub-package sizes do not add up.
    """
    if len(frame) < HEADER.size:
        raise RemoteProtocolError(f"a package of {len(frame)} bytes is shorter than its header")
    _, package_type = HEADER.unpack_from(frame)
    body = frame[HEADER.size :]
    if package_type == PackageType.ROBOT_STATE:
        return decode_state(body)
    if package_type == PackageType.ROBOT_MESSAGE:
        return decode_message(body, version)
    if package_type == PackageType.PROGRAM_STATE:
        return decode_program_state(body, version)
    if package_type == PackageType.SAFETY_COMPLIANCE_TOLERANCES and len(body) >= _TOLERANCES.size:
        return SafetyTolerances(_TOLERANCES.unpack_from(body))
    return UnknownPackage(package_type, body)
