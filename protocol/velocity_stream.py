"""The reverse channel of our velocity receiver: what the PC sends while the arm moves.

The robot's program connects to the PC, sends one integer as hello, and then reads seven integers at a time:

    PC -> robot   i32 mode | i32 qd0 ... qd5        big-endian, velocities in rad/s x 1e6, 28 bytes
    robot -> PC   i32 hello (= 1)                   once, when the program is ready to read

Scaled integers because CB3 scripts can only read integers in binary (`socket_read_binary_integer`).
This module neither decides when to send nor limits a speed.
"""

import struct
from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from protocol.errors import LocalProtocolError, RemoteProtocolError

__all__ = ["HELLO_SIZE", "VelocityMode", "check_hello", "encode_velocity"]

_HELLO = (1).to_bytes(4, "big")

_VELOCITY_SCALE = 1_000_000
"""Integer steps for each rad/s. Source: the convention of UR's client library and of ur_modern_driver."""

_VELOCITY_LIMIT = (2**31 - 1) / _VELOCITY_SCALE
"""Largest velocity [rad/s] that fits the integer (2147), far above the limit of any joint."""

_COMMAND = struct.Struct(">7i")
HELLO_SIZE = len(_HELLO)


class VelocityMode(IntEnum):
    """The mode word, first of the seven integers."""

    STOP_PROGRAM = 0
    """Ramp to rest and end the robot's program."""
    VELOCITY = 1
    """Follow the six velocities."""
    HOLD = 2
    """Ramp to rest, keep the program; the velocities are ignored."""


_AT_REST = (0.0,) * 6


def encode_velocity(mode: VelocityMode, qd: Sequence[float] | NDArray[np.float64] = _AT_REST) -> bytes:
    """One message to the robot: the mode word and six joint velocities [rad/s], rounded to 1e-6 rad/s.

    Raises:
        LocalProtocolError: not six values, or one is NaN, infinite or too large for the integer.
    """
    values = qd.tolist() if isinstance(qd, np.ndarray) else qd
    try:
        return _COMMAND.pack(mode, *[round(value * _VELOCITY_SCALE) for value in values])
    except (ValueError, OverflowError, TypeError, struct.error):
        raise LocalProtocolError(
            f"velocities {list(values)!r} cannot be sent: give six finite numbers within "
            f"+-{_VELOCITY_LIMIT:.0f} rad/s"
        ) from None


def check_hello(data: bytes) -> None:
    """Raise RemoteProtocolError for bytes that are not the hello: something else has connected."""
    if data != _HELLO:
        raise RemoteProtocolError(
            f"the caller sent {data[:16].hex(' ') or 'nothing'} instead of hello ({_HELLO.hex(' ')})"
        )
