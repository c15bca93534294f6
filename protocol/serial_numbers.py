"""Serial numbers: those of emulated boxes say that they are, which arm it is, and the seed."""

import re
from typing import NamedTuple

from protocol.errors import LocalProtocolError, RemoteProtocolError

__all__ = ["SIMULATED_SERIAL_PREFIX", "SerialNumber", "parse_serial", "simulated_serial"]

SIMULATED_SERIAL_PREFIX = "2099"
"""Serial numbers start with the year of make (seen: 2017...); no arm was made in 2099."""

_SIMULATED_SERIAL = re.compile(SIMULATED_SERIAL_PREFIX + r"([1-9])(\d{6})")
_SEED_MODULUS = 10**6


class SerialNumber(NamedTuple):
    """A serial number and its meaning: `seed` is None for a real arm."""

    text: str
    simulated: bool
    seed: int | None


def simulated_serial(robot_type: int, seed: int) -> str:
    """Serial number of a simulated box: prefix, robot type digit, six digits of the seed modulo 10**6.

    LocalProtocolError if the robot type (3 = UR3) is not one of 1..9.
    """
    if not 1 <= robot_type <= 9:
        raise LocalProtocolError(f"robot type {robot_type} has no digit in a serial number: use 1 to 9")
    return f"{SIMULATED_SERIAL_PREFIX}{robot_type:d}{seed % _SEED_MODULUS:06d}"


def parse_serial(text: str) -> SerialNumber:
    """Read what `get serial number` answers; RemoteProtocolError if it is not digits only."""
    text = text.strip()
    if not (text.isascii() and text.isdigit()):
        raise RemoteProtocolError(f"serial number {text!r} is not digits only")
    match = _SIMULATED_SERIAL.fullmatch(text)
    return SerialNumber(text, match is not None, int(match[2]) if match else None)
