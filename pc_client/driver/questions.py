"""Single questions to a robot, each on a connection of its own; an absent server is no error.

The dashboard server gets one line and answers one line. RTDE tells its software and values of variables.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pc_client.driver.rtde import RtdeStream
from pc_client.driver.transport import TcpNetwork, TcpTransport
from pc_client.errors import DriverError
from protocol.rtde.types import RtdeValue
from protocol.ur_types import SoftwareVersion
from ur_hil.patience import LONGEST_STEP, Patience

_CONNECT_TIMEOUT = 2.0
_DASHBOARD_TIMEOUT = 60.0
"""A server that takes the connection answers within milliseconds; one that is stopped is waited for, or the
recording would call the serial number unknown."""

_LINE_TIMEOUT = 5.0
"""Once its first byte is there, the rest of a line comes within this [s]."""

LONGEST_LINE = 4096
"""Most bytes of a line; answers have less than a hundred."""

_GREETING = "Universal Robots Dashboard Server"


def ask_dashboard(network: TcpNetwork, host: str, port: int, questions: tuple[str, ...]) -> dict[str, str]:
    """Ask what the dashboard server knows by commands that only ask, e.g. `get serial number`.

    The answers that came are returned; none when there is no dashboard server.

    Raises:
        DriverError: the server sends what are no lines.
    """
    try:
        connection = network.connect(host, port, _CONNECT_TIMEOUT)
    except DriverError:
        return {}
    answers: dict[str, str] = {}
    try:
        lines = _Lines(connection, network)
        if _GREETING not in (lines.read() or ""):
            return {}
        for question in questions:
            connection.send(question.encode("latin-1") + b"\n")
            answer = lines.read()
            if answer is None:
                break
            answers[question] = answer
        connection.send(b"quit\n")
    except _NoLineError:
        raise
    except DriverError:
        pass  # what was answered until then is still true
    finally:
        connection.close()
    return answers


class _NoLineError(DriverError):
    """What comes is no line."""


class _Lines:
    """Cuts a connection's bytes into lines."""

    def __init__(self, connection: TcpTransport, network: TcpNetwork) -> None:
        self._connection = connection
        self._network = network
        self._pending = b""

    def read(self) -> str | None:
        """The next line, or None when none comes; DriverError if the line has no end."""
        begun = Patience()
        while b"\n" not in self._pending:
            late = bool(self._pending) and begun.spent(self._network.now()) > _LINE_TIMEOUT
            if late or len(self._pending) > LONGEST_LINE:
                raise _NoLineError(
                    f"the dashboard server sends {len(self._pending)} bytes without the end of a line; one "
                    f"has at most {LONGEST_LINE}, and comes within {_LINE_TIMEOUT:g} s: "
                    "is this a control box?"
                )
            data = self._connection.receive(LONGEST_STEP if self._pending else _DASHBOARD_TIMEOUT)
            if data == b"" or (data is None and not self._pending):
                return None
            self._pending += data or b""
        line, _, self._pending = self._pending.partition(b"\n")
        return line.decode("latin-1").strip()


_RATE = 125.0
"""Packages a second: as many as every generation sends, the first one is enough."""


@dataclass(frozen=True, slots=True)
class RtdeAnswer:
    """What the RTDE port says.

    Attributes:
        values: of the variables that this software knows, all of one cycle.
    """

    version: SoftwareVersion
    values: Mapping[str, RtdeValue]


def ask_rtde(network: TcpNetwork, host: str, port: int, names: tuple[str, ...]) -> RtdeAnswer | None:
    """Ask for the software and for output variables; None when there is no RTDE at the port.

    Variables that the software does not know are left out.
    """
    try:
        with RtdeStream(network, host, port, names, _RATE) as stream:
            return RtdeAnswer(stream.version, stream.receive())
    except DriverError:
        return None
