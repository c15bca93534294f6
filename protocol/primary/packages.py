"""Whole packages of the primary and secondary ports, for either end.

A new connection gets the version message (its own segment: some clients read it from a single `recv`),
then the startup message, then states at 10 Hz; the first state holds all sub-packages. On the secondary
port only the messages in `SECONDARY_MESSAGES` are sent. A reader gets unknown packages as they are.

Sources: UR "Primary/Secondary Client Interface" (2021); captures of 3.3, 3.10, 5.4, 5.8 and 5.11.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from protocol.errors import RemoteProtocolError
from protocol.primary.framing import HEADER, PackageType, encode_package
from protocol.primary.messages import (
    RobotMessage,
    StartupMessage,
    VersionMessage,
    decode_message,
    encode_message,
)
from protocol.primary.state import RobotState, decode_state
from protocol.primary.values import ProgramStateMessage, decode_program_state
from protocol.ur_types import SoftwareVersion
from protocol.wire_record import Since, since

__all__ = [
    "SECONDARY_MESSAGES",
    "Package",
    "SafetyTolerances",
    "UnknownPackage",
    "decode_package",
    "encode_message_package",
    "encode_safety_tolerances",
    "sends_safety_tolerances",
]

SECONDARY_MESSAGES: tuple[type[RobotMessage], ...] = (VersionMessage, StartupMessage)
"""The only robot messages that the secondary port carries."""

_SAFETY_TOLERANCES = (
    0.15, 25.0, 0.0, 3.0, *(0.2,) * 6, *(0.052359878,) * 6, 0.0, 0.0, 0.0, 0.01745329, 0.001, 0.01,
)  # fmt: skip
"""Body of package type 24; undocumented. Source: a byte capture of a CB3 3.10; 3.3 did not send the
package."""

_TOLERANCES = struct.Struct(f">{len(_SAFETY_TOLERANCES)}d")


@dataclass(frozen=True, slots=True)
class SafetyTolerances:
    """Package type 24: 22 numbers of undocumented meaning.

    Attributes:
        SINCE: the first software seen to send it. Source: captures of 3.3 (absent) and 3.10 (present).
        UNTIL: the first software that no longer sends it. Source: captures of 5.4 (present), 5.11 (absent).
    """

    SINCE: ClassVar[Since] = since((3, 10))
    UNTIL: ClassVar[SoftwareVersion] = SoftwareVersion(5, 11)

    values: tuple[float, ...] = _SAFETY_TOLERANCES


@dataclass(frozen=True, slots=True)
class UnknownPackage:
    """A package that has no table here; `body` follows its five-byte header."""

    package_type: int
    body: bytes


Package: TypeAlias = RobotState | RobotMessage | ProgramStateMessage | SafetyTolerances | UnknownPackage


# --- sending ---


def sends_safety_tolerances(version: SoftwareVersion) -> bool:
    """Whether software `version` sends `SafetyTolerances` to new clients."""
    return SafetyTolerances.SINCE.covers(version) and version < SafetyTolerances.UNTIL


def encode_message_package(message: RobotMessage, version: SoftwareVersion) -> bytes:
    """A whole message package as software `version` sends it; raises as `encode_message`."""
    return encode_package(PackageType.ROBOT_MESSAGE, encode_message(message, version))


def encode_safety_tolerances() -> bytes:
    """A whole package of type 24."""
    return encode_package(PackageType.SAFETY_COMPLIANCE_TOLERANCES, _TOLERANCES.pack(*_SAFETY_TOLERANCES))


# --- receiving ---


def decode_package(frame: bytes, version: SoftwareVersion) -> Package:
    """Read one whole package, as `FrameBuffer` cuts it.

    Args:
        frame: header and body.
        version: software of the controller, from its version message (which itself may be read with any);
            only messages and values of variables depend on it.

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
