"""The name that the maker's drivers give to the calibration of an arm: a hash of its DH table.

Source: UR client library, `KinematicsInfo::toHash`: the numbers as a C++ stream writes them, without anything
between them, through `std::hash` of libstdc++ (MurmurHash64A, other in its last bytes).
"""

from __future__ import annotations

from collections.abc import Iterable

_SEED = 0xC70F6907
_MULTIPLIER = 0xC6A4A7935BD1E995
_MASK = 2**64 - 1


def calibration_hash(rows: Iterable[tuple[float, float, float, float]]) -> str:
    """Return the name of a calibration, "calib_12788084448423163542" for a nominal UR5e.

    Args:
        rows: theta [rad], d [m], a [m], alpha [rad] of each joint, the base first.
    """
    text = "".join(f"{value:.6g}" for row in rows for value in row)
    return f"calib_{_hash_bytes(text.encode())}"


def _hash_bytes(data: bytes) -> int:
    value = _SEED ^ (len(data) * _MULTIPLIER & _MASK)
    whole = len(data) & ~7
    for start in range(0, whole, 8):
        word = int.from_bytes(data[start : start + 8], "little") * _MULTIPLIER & _MASK
        value = (value ^ (_mixed(word) * _MULTIPLIER & _MASK)) * _MULTIPLIER & _MASK
    if len(data) > whole:
        value = (value ^ int.from_bytes(data[whole:], "little")) * _MULTIPLIER & _MASK
    return _mixed(_mixed(value) * _MULTIPLIER & _MASK)


def _mixed(value: int) -> int:
    return value ^ (value >> 47)
