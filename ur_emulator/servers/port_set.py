"""All ports of one box: opened together, closed together with their connections."""

from __future__ import annotations

from collections.abc import Mapping

from ur_emulator.errors import PortPermissionError
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.realtime.served_box import ServedBox
from ur_emulator.servers.tcp.client_lines import ClientLines
from ur_emulator.servers.tcp.listener import Listener, Places, Port, SpareDescriptor

CONTROL, MODBUS, ROBOT_API = "control", "modbus", "robot_api"
# Ports whose numbers need privileges, and what the box lacks without them.
_PRIVILEGED = {MODBUS: "Modbus server", ROBOT_API: "Robot API"}
# Ports of web servers.
_WEB = frozenset({CONTROL, ROBOT_API})


class PortSet:
    """The ports of a box by name.

    Args:
        loop: watches their sockets.
        host: address to listen on.
        box: what they belong to.
        ports: by name.

    Attributes:
        notices: warnings for the user, one line each; the box runs all the same.
    """

    def __init__(self, loop: EventLoop, host: str, box: ServedBox, ports: Mapping[str, Port]) -> None:
        self._loop = loop
        self._host = host
        self._box = box
        self._ports = dict(ports)
        self._listeners: dict[str, Listener] = {}
        self._spare = SpareDescriptor()
        self._places = Places()
        self._lines = ClientLines(box.notice)
        self.notices: list[str] = []

    @property
    def is_open(self) -> bool:
        """True once the ports listen."""
        return bool(self._listeners)

    def open(self, wanted: Mapping[str, int]) -> dict[str, int]:
        """Listen on all wanted ports.

        Args:
            wanted: numbers by name; 0 takes a free one, a port that is not named stays closed.

        Returns:
            The numbers. Those that need privileges may be missing.

        Raises:
            PortError: one of them cannot be opened; `close` closes the others.
        """
        self._spare.take()
        for name, port in self._ports.items():
            if name not in wanted:
                continue
            try:
                self._listeners[name] = self._listener(name, port, wanted[name])
            except PortPermissionError as error:
                if name not in _PRIVILEGED:
                    raise
                self.notices.append(f"no {_PRIVILEGED[name]}: {error}")
        return {name: listener.number for name, listener in self._listeners.items()}

    def close(self) -> None:
        """Close all ports and connections; harmless if closed already."""
        self._spare.close()
        for listener in self._listeners.values():
            listener.close()

    def _listener(self, name: str, port: Port, number: int) -> Listener:
        """Listen; lockstep does not wait for clients of the control API, and they do not fill the log.

        They have places of their own: a box whose other ports are full can still be controlled.
        """
        box, places, backlog, notice = self._box, self._places, self._box.backlog, self._lines.write
        if name == CONTROL:
            places, backlog, notice = Places(), set(), _no_line
        return Listener(
            self._loop,
            self._host,
            number,
            port,
            backlog,
            notice,
            box.report,
            name,
            places,
            self._spare,
            speaks_http=name in _WEB,
        )


def _no_line(text: str) -> None:
    """Leave out a line."""
