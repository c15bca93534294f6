"""What ports 30001 to 30003 and their read-only twins share: they send packages and take scripts."""

from __future__ import annotations

from ur_emulator.servers.programs.intake import ProgramIntake
from ur_emulator.servers.programs.sender import Sender
from ur_emulator.servers.tcp.connection import Connection


class ScriptPort:
    """Sends packages to all clients, takes script text of each."""

    def __init__(self, intake: ProgramIntake | None) -> None:
        """Prepare; `intake` takes script text, None makes the port read-only."""
        self._intake = intake
        self._clients: dict[Connection, Sender] = {}

    def opened(self, connection: Connection) -> None:
        """The client gets the next package."""
        self._clients[connection] = Sender() if self._intake is None else self._intake.new_sender()

    def received(self, connection: Connection, data: bytes) -> None:
        """Take script text."""
        if self._intake is not None:
            self._intake.received(self._clients[connection], data)

    def closed(self, connection: Connection) -> None:
        """Forget the client; a program it sent goes on."""
        sender = self._clients.pop(connection, None)
        if self._intake is not None and sender is not None:
            self._intake.closed(sender)

    def _send(self, *packages: bytes) -> None:
        for connection in tuple(self._clients):
            for package in packages:
                connection.send(package)
