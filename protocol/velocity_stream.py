"""The reverse channel of our velocity receiver: what the PC sends while the arm moves.

The robot's program dials the PC, says hello with one integer, and then reads seven integers at a time:

    PC -> robot   i32 mode | i32 qd0 ... qd5        big-endian, velocities in rad/s x 1e6, 28 bytes
    robot -> PC   i32 hello (= 1)                   once, when the program is ready to read

Scaled integers because CB3 scripts can only read integers in binary (`socket_read_binary_integer`).
Nothing here decides when to send, limits a speed or knows what the robot does with it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocol.errors import LocalProtocolError, RemoteProtocolError

__all__ = [
    "COMMAND_SIZE",
    "HELLO",
    "HELLO_SIZE",
    "VELOCITY_LIMIT",
    "VELOCITY_SCALE",
    "VelocityCommand",
    "VelocityMode",
    "decode_hello",
    "decode_velocity",
    "encode_hello",
    "encode_velocity",
]

HELLO = 1
"""What the robot's program sends once, when its sockets are open and its servo thread runs."""

VELOCITY_SCALE = 1_000_000
"""Integer steps for each rad/s. Source: the convention of UR's client library and of ur_modern_driver."""

VELOCITY_LIMIT = (2**31 - 1) / VELOCITY_SCALE
"""Largest velocity in rad/s that fits the integer (2147); far above any joint: only nonsense is refused."""

_COMMAND = struct.Struct(">7i")
_HELLO = struct.Struct(">i")
COMMAND_SIZE = _COMMAND.size
HELLO_SIZE = _HELLO.size


class VelocityMode(IntEnum):
    """The mode word, first of the seven integers."""

    STOP_PROGRAM = 0
    """Ramp to rest and end the robot's program."""
    VELOCITY = 1
    """Follow the six velocities."""
    HOLD = 2
    """Ramp to rest, keep the program; the velocities are ignored."""


class VelocityCommand(NamedTuple):
    """One decoded message: `qd` in rad/s, six floats."""

    mode: VelocityMode
    qd: tuple[float, ...]


_AT_REST = (0.0,) * 6


def encode_velocity(mode: VelocityMode, qd: Sequence[float] | NDArray[np.float64] = _AT_REST) -> bytes:
    """One message to the robot.

    Args:
        mode: the mode word.
        qd: six joint velocities [rad/s]; rounded to 1e-6 rad/s.

    Raises:
        LocalProtocolError: not six values, or one is NaN, infinite or beyond `VELOCITY_LIMIT`.
    """
    values = qd.tolist() if isinstance(qd, np.ndarray) else qd
    try:
        return _COMMAND.pack(mode, *[round(value * VELOCITY_SCALE) for value in values])
    except (ValueError, OverflowError, TypeError, struct.error):
        raise LocalProtocolError(
            f"velocities {list(values)!r} cannot be sent: give six finite numbers within "
            f"+-{VELOCITY_LIMIT:.0f} rad/s"
        ) from None


def decode_velocity(data: bytes) -> VelocityCommand:
    """The inverse of `encode_velocity`, for tests and tools: `qd` in rad/s.

    Raises:
        RemoteProtocolError: not 28 bytes, or an unknown mode word.
    """
    if len(data) != COMMAND_SIZE:
        raise RemoteProtocolError(f"a velocity message has {COMMAND_SIZE} bytes, this one {len(data)}")
    mode, *velocities = _COMMAND.unpack(data)
    if mode not in VelocityMode.__members__.values():
        raise RemoteProtocolError(f"unknown mode word {mode}: known are 0 stop, 1 velocity, 2 hold")
    return VelocityCommand(VelocityMode(mode), tuple(value / VELOCITY_SCALE for value in velocities))


def encode_hello() -> bytes:
    """What the robot's program sends when it is ready."""
    return _HELLO.pack(HELLO)


def decode_hello(data: bytes) -> None:
    """Check the robot's greeting.

    Raises:
        RemoteProtocolError: these four bytes are not the hello, so something else dialled us.
    """
    if data != _HELLO.pack(HELLO):
        raise RemoteProtocolError(
            f"the caller said {data[:16].hex(' ') or 'nothing'} instead of hello ({encode_hello().hex(' ')})"
        )
