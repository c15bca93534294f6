"""One value from the RTDE port, for what no other port reports. An absent port is no error."""

from __future__ import annotations

from pc_client.driver.transport import Network, Transport
from pc_client.errors import DriverError
from protocol.errors import RemoteProtocolError
from protocol.rtde.client_connection import ClientEvent, DataReceived, RtdeClientConnection
from protocol.rtde.messages import (
    RequestProtocolVersion,
    RequestProtocolVersionReply,
    RtdeTextMessage,
    SetupOutputs,
    SetupOutputsReply,
    Start,
    StartReply,
)
from protocol.rtde.types import REFUSALS, RtdeValue

CONNECT_TIMEOUT = 2.0
REPLY_TIMEOUT = 1.0
"""Longest wait for one package [s]. Source: UR's RTDE client in Python."""

_MOST_PACKAGES = 100
"""Packages that are read before the first one with data."""

_RATE = 125.0
"""Packages a second: as many as every generation sends, the first one is enough."""


def ask_rtde(network: Network, host: str, port: int, name: str) -> RtdeValue | None:
    """Ask for an output variable.

    Args:
        network: makes the connection.
        host: the robot.
        port: its RTDE port.
        name: of the variable.

    Returns:
        Its value now; None when there is no RTDE port, or this software does not know the variable.
    """
    try:
        connection = network.connect(host, port, CONNECT_TIMEOUT)
    except DriverError:
        return None
    try:
        return _first_value(_Events(connection, network), name)
    except (DriverError, RemoteProtocolError):
        return None
    finally:
        connection.close()


def _first_value(events: _Events, name: str) -> RtdeValue | None:
    for request in (RequestProtocolVersion(2), SetupOutputs((name,), _RATE), Start()):
        match events.reply(request):
            case RequestProtocolVersionReply(False) | StartReply(False):
                return None
            case SetupOutputsReply(types) if not REFUSALS.isdisjoint(types):
                return None
    for _ in range(_MOST_PACKAGES):
        if isinstance(event := events.next(), DataReceived):
            return event.values[0]
    return None


class _Events:
    """What the robot says on one connection."""

    def __init__(self, connection: Transport, network: Network) -> None:
        self._connection = connection
        self._network = network
        self._rtde = RtdeClientConnection()

    def reply(self, request: RequestProtocolVersion | SetupOutputs | Start) -> ClientEvent:
        """Ask, and wait for the answer."""
        self._connection.send(self._rtde.send(request))
        return self.next()

    def next(self) -> ClientEvent:
        """The next package; texts for the log are passed over.

        Raises:
            DriverError: none comes in time, or the connection ended.
            RemoteProtocolError: this is no RTDE.
        """
        deadline = self._network.now() + REPLY_TIMEOUT
        while self._network.now() <= deadline:
            event = self._rtde.next_event()
            if event is not None and not isinstance(event, RtdeTextMessage):
                return event
            if event is None:
                data = self._connection.receive(REPLY_TIMEOUT)
                if not data:
                    break
                self._rtde.receive_data(data)
        raise DriverError("the RTDE port sends no usable answer")
