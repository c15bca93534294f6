"""The frame around everything on the primary and secondary ports.

    package = i32 size, itself included | u8 package type | body

Cut a received stream with `FrameBuffer(MAX_PACKAGE_SIZE, MIN_PACKAGE_SIZE)`.
"""

from __future__ import annotations

import struct
from enum import IntEnum

__all__ = ["HEADER", "MAX_PACKAGE_SIZE", "MIN_PACKAGE_SIZE", "PackageType", "encode_package"]


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
"""Size and type; sub-packages of a state have the same header."""

MIN_PACKAGE_SIZE = HEADER.size
MAX_PACKAGE_SIZE = 1 << 20
"""Beyond any package: states stay below 2000 bytes, a message carries one text."""


def encode_package(package_type: int, body: bytes) -> bytes:
    """Put the header before a body."""
    return HEADER.pack(HEADER.size + len(body), package_type) + body
