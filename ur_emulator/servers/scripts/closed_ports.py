"""Ports of this process that scripts must not reach: those of the control API of all its boxes.

A client that may send programs could otherwise do through a socket of its program what the control API allows
only to the users of this machine. Every connection of a box asks here with the address that it will use, so
names and other forms of an address change nothing.
"""

from __future__ import annotations

import errno
import socket
from typing import Final

_CLOSED: Final[dict[object, int]] = {}


def close_to_scripts(owner: object, port: int) -> None:
    """Let no script connect to a port of this machine, until `give_back`."""
    _CLOSED[owner] = port


def give_back(owner: object) -> None:
    """Take back `close_to_scripts`; harmless if there was none."""
    _CLOSED.pop(owner, None)


def is_closed(address: str, port: int) -> bool:
    """Whether scripts must not connect to a port.

    Args:
        address: IPv4, as `inet_ntoa` writes it.
        port: number.
    """
    # Boxes in other threads come and go: a copy is made at once, an iteration is not.
    return port in tuple(_CLOSED.values()) and _is_of_this_machine(address)


def _is_of_this_machine(address: str) -> bool:
    """Whether this machine has an address: a socket can be bound to no other. In doubt it has."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind((address, 0))
    except OSError as error:
        return error.errno != errno.EADDRNOTAVAIL
    return True
