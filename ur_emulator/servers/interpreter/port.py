"""Port 30020: each line gets an answer; words get theirs before lines that wait."""

from __future__ import annotations

from protocol.errors import ProtocolError
from protocol.interpreter import InterpreterConnection, Statements
from ur_emulator.servers.interpreter.intake import InterpreterIntake
from ur_emulator.servers.tcp.connection import Connection


class InterpreterPort:
    """Takes the lines of its clients."""

    def __init__(self, intake: InterpreterIntake) -> None:
        """Serve a box; `intake` gets the lines of all its clients."""
        self._intake = intake
        self._lines: dict[Connection, InterpreterConnection] = {}

    def opened(self, connection: Connection) -> None:
        """Wait for lines; a client that has closed its sending side still gets its answers."""
        connection.allow_half_close(self._intake.ended)
        self._lines[connection] = InterpreterConnection()

    def received(self, connection: Connection, data: bytes) -> None:
        """Take lines; a client whose line has no end is disconnected."""
        lines = self._lines[connection]
        try:
            lines.receive_data(data)
        except ProtocolError:
            connection.close()
            return
        while (event := lines.next_event()) is not None:
            if isinstance(event, Statements):
                self._intake.take(connection, event.text)
            else:
                self._intake.take_word(connection, event)

    def closed(self, connection: Connection) -> None:
        """Forget the client; its lines are executed, as programs are whose sender has gone."""
        self._lines.pop(connection, None)
