"""The arguments of a box, and what is allowed."""

from __future__ import annotations

import math
from collections.abc import Collection
from ipaddress import ip_address
from os import PathLike
from pathlib import Path
from typing import TypedDict

from protocol.errors import ProtocolError
from protocol.ur_types import Ports
from ur_emulator.control.token import check_token
from ur_emulator.errors import EmulatorError
from ur_emulator.realtime.pacing import Pace

MAX_PORT = 65535


class BoxOptions(TypedDict, total=False):
    """Arguments of one `ControlBox`."""

    robot: str
    version: str | None
    host: str
    pace: str | Pace
    speed: float
    seed: int
    fidelity: str
    port_base: int | None
    programs: str | PathLike[str] | None
    control_port: int | None
    control_token: str | None
    skip_unknown_nodes: bool
    remote_control: bool
    services: Collection[str]


def check_options(
    host: str,
    speed: float,
    seed: int,
    programs: str | PathLike[str] | None,
    control_port: int | None,
    control_token: str | None,
) -> None:
    """Check the arguments that need no table.

    Raises:
        EmulatorError: one is not allowed.
    """
    if not 0.0 < speed < math.inf:
        raise EmulatorError(f"speed {speed:g} given: it must be above 0 and finite, 1 is real time")
    if seed < 0:
        raise EmulatorError(f"seed {seed} given: it must be 0 or above")
    if not host:
        raise EmulatorError("no host given: name an address, 127.0.0.1 keeps other machines out")
    if programs is not None and not Path(programs).is_dir():
        raise EmulatorError(f"programs folder {programs} given: there is no such folder, make it first")
    if not 0 <= (control_port or 0) <= MAX_PORT:
        raise EmulatorError(
            f"control port {control_port} given: 1 to {MAX_PORT} are ports, 0 takes a free one"
        )
    check_token(control_token)
    if control_port is not None and control_token is None and not is_loopback(host):
        raise EmulatorError(
            f"control port on {host}, which other machines can reach: give it a token "
            "(--token, control_token), or listen on a loopback address"
        )


def is_loopback(host: str) -> bool:
    """Return whether an address is one that only this machine reaches; other names than localhost are not."""
    try:
        return host.lower() == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def standard_ports(base: int) -> Ports:
    """Return the standard ports, moved by an offset.

    Raises:
        EmulatorError: they are not all ports of TCP.
    """
    try:
        return Ports.standard(base)
    except ProtocolError as error:
        raise EmulatorError(str(error)) from None


def parse_pace(pace: str | Pace) -> Pace:
    """Return the pace of that name.

    Raises:
        EmulatorError: there is none.
    """
    try:
        return Pace(pace)
    except ValueError:
        raise EmulatorError(
            f"unknown pace {pace!r}: choose one of {', '.join(p.value for p in Pace)}"
        ) from None
