"""The arguments of a box, what is allowed, and where a box is served."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from ipaddress import ip_address
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from protocol.ur_types import Ports
from ur_emulator.errors import EmulatorError
from ur_emulator.host.pacing import Pace

if TYPE_CHECKING:
    from ur_emulator.machine.models.robot_generation import RobotGeneration

# Environment variable with the token: what stands on a command line is seen by all users of a machine.
TOKEN_VARIABLE = "UR_EMULATOR_TOKEN"
# Likewise of the page of a window.
PAGE_TOKEN_VARIABLE = "UR_PENDANT_TOKEN"
MAX_TOKEN = 200
# Printed ASCII without the blank: it goes through HTTP as it is.
_TOKEN_CHARACTERS = frozenset(map(chr, range(0x21, 0x7F)))
MAX_PORT = 65535
# A typing error must not fill the memory: each box takes some 15 MB.
MAX_BOXES = 200


@dataclass(frozen=True, slots=True)
class BoxOptions:
    """Arguments of a box, as `ur_emulator.emulator.ControlBox` describes them.

    `generation` is that of the box in place of the arm's own.
    """

    robot: str | PathLike[str] = "ur3"
    version: str | None = None
    host: str = "127.0.0.1"
    pace: str | Pace = Pace.REALTIME
    speed: float = 1.0
    seed: int = 0
    fidelity: str = "typical"
    port_base: int | None = 0
    programs: str | PathLike[str] | None = None
    control_port: int | None = None
    control_token: str | None = None
    skip_unknown_nodes: bool = False
    remote_control: bool = True
    services: Collection[str] = ()
    generation: RobotGeneration | None = None
    tool: str | PathLike[str] = "none"
    scene: str | PathLike[str] | None = None
    journal: str | PathLike[str] | None = None

    def check(self) -> None:
        """Check the arguments that need no table; EmulatorError for one that is not allowed."""
        try:
            Pace(self.pace)
        except ValueError:
            raise EmulatorError(f"unknown pace {self.pace!r}: choose one of {', '.join(Pace)}") from None
        if not 0.0 < self.speed < math.inf:
            raise EmulatorError(f"speed {self.speed:g} given: it must be above 0 and finite, 1 is real time")
        if self.seed < 0:
            raise EmulatorError(f"seed {self.seed} given: it must be 0 or above")
        if not self.host:
            raise EmulatorError("no host given: name an address, 127.0.0.1 keeps other machines out")
        if self.programs is not None and not Path(self.programs).is_dir():
            raise EmulatorError(
                f"programs folder {self.programs} given: there is no such folder, make it first"
            )
        if not 0 <= (self.control_port or 0) <= MAX_PORT:
            raise EmulatorError(
                f"control port {self.control_port} given: 1 to {MAX_PORT} are ports, 0 takes a free one"
            )
        check_token(self.control_token)
        if self.control_port is not None and self.control_token is None and not is_loopback(self.host):
            raise EmulatorError(
                f"control port on {self.host}, which other machines can reach: give it a token "
                "(--token, control_token), or listen on a loopback address"
            )


@dataclass(frozen=True, slots=True)
class ServedAt:
    """Where clients find a box, and as what.

    Attributes:
        title: arm, generation and software.
        serial_number: as the dashboard gives it; simulated boxes are recognisable by it.
        host: address that it listens on.
        ports: numbers of its ports; 0 for one that it does not have.
        port_base: what was added to the standard ones.
        control_port: number of the port for the control API over HTTP, 0 if it is not open.
        notices: warnings for the user, one line each; the box runs all the same.
    """

    title: str
    serial_number: str
    host: str
    ports: Ports
    port_base: int = 0
    control_port: int = 0
    notices: tuple[str, ...] = ()


def check_token(token: str | None) -> None:
    """Raise EmulatorError for a token that cannot stand in a header of HTTP; None is no token."""
    if token is not None and not (0 < len(token) <= MAX_TOKEN and set(token) <= _TOKEN_CHARACTERS):
        raise EmulatorError(
            f"a token of {len(token)} characters given: it has 1 to {MAX_TOKEN} printed characters of ASCII, "
            "no blanks"
        )


def is_loopback(host: str) -> bool:
    """Return whether an address is one that only this machine reaches; other names than localhost are not."""
    try:
        return host.lower() == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def check_count(count: int) -> None:
    """Raise EmulatorError if that many boxes cannot share a loop."""
    if not 1 <= count <= MAX_BOXES:
        raise EmulatorError(f"{count} boxes asked for: 1 to {MAX_BOXES} are possible")


def counted_up(count: int, first: BoxOptions) -> list[BoxOptions]:
    """Return the options of `count` boxes: hosts and seeds are counted up from those of the first.

    With free ports (`port_base` None) one host is enough for all.

    Raises:
        EmulatorError: the host is not an address from which `count` can be counted.
    """
    check_count(count)
    if count > 1 and first.journal is not None:
        raise EmulatorError(f"a journal given for {count} boxes: it is that of one box")
    one_host = count == 1 or first.port_base is None
    hosts = [first.host] * count if one_host else _hosts_from(first.host, count)
    return [replace(first, host=host, seed=first.seed + k) for k, host in enumerate(hosts)]


def _hosts_from(host: str, count: int) -> list[str]:
    try:
        first = ip_address(host)
        if first.is_unspecified:
            raise ValueError
        return [str(first + k) for k in range(count)]
    except ValueError:
        raise EmulatorError(
            f"host {host!r} given for {count} boxes: name the address of the first one, such as 127.0.0.2; "
            "the others get the next ones"
        ) from None
