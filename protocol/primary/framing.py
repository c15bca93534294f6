"""What all packages and sub-packages of the primary and secondary ports have in common.

    package     = i32 size, itself included | u8 package type | body
    sub-package = i32 size, itself included | u8 sub-type | fields; tables in `primary.layout`

Cut a received stream with `FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE)`.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

from protocol.wire_record import ALWAYS, Since

__all__ = [
    "HEADER",
    "MAX_PACKAGE_SIZE",
    "MIN_PACKAGE_SIZE",
    "NO_TIME",
    "PackageType",
    "SubPackage",
    "encode_package",
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


HEADER = struct.Struct(">iB")
"""Size and type."""

MIN_PACKAGE_SIZE = HEADER.size
MAX_PACKAGE_SIZE = 1 << 20
"""Beyond any package: states stay below 2000 bytes, a message carries one text."""


NO_TIME = 2**64 - 1
"""Timestamp of a package that has none: all ones."""


@dataclass(frozen=True, slots=True)
class SubPackage:
    """What all sub-packages share; software of SINCE was the first to send it.

    Attributes:
        SUB_TYPE: number on the wire.
        FIRST_STATE_ONLY: sent in the first state of a connection and when the configuration changes.
    """

    SUB_TYPE: ClassVar[int]
    SINCE: ClassVar[Since] = ALWAYS
    FIRST_STATE_ONLY: ClassVar[bool] = False


def encode_package(package_type: int, body: bytes) -> bytes:
    """Put the header before a body."""
    return HEADER.pack(HEADER.size + len(body), package_type) + body
