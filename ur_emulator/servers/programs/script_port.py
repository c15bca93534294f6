"""What ports 30001 to 30003 and their read-only twins share: they send packages and take scripts."""

from __future__ import annotations

from protocol.script_channel import ScriptChannel
from ur_emulator.servers.programs.intake import ProgramIntake
from ur_emulator.servers.tcp.connection import Connection


class ScriptPort:
    """Sends packages to all clients, takes script text of each."""

    def __init__(self, intake: ProgramIntake | None) -> None:
        """Prepare; `intake` takes script text, None makes the port read-only."""
        self._intake = intake
        self._channels: dict[Connection, ScriptChannel] = {}

    def opened(self, connection: Connection) -> None:
        """The client gets the next package."""
        self._channels[connection] = ScriptChannel()

    def received(self, connection: Connection, data: bytes) -> None:
        """Take script text."""
        if self._intake is not None:
            self._intake.take(connection, self._channels[connection].feed(data))

    def closed(self, connection: Connection) -> None:
        """Forget the client; a program it sent goes on."""
        self._channels.pop(connection, None)

    def _send(self, *packages: bytes) -> None:
        for connection in tuple(self._channels):
            for package in packages:
                connection.send(package)
