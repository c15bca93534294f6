"""Port 29999: the dashboard server. The lines of a client are answered in order, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from protocol.dashboard.connection import MAX_LINE, CommandReceived, DashboardConnection
from protocol.errors import ProtocolError
from ur_emulator.servers.box_access import BoxAccess
from ur_emulator.servers.dashboard.answers import DashboardAnswers
from ur_emulator.servers.steps import Steps
from ur_emulator.servers.tcp.connection import Connection

# Lines of one client that are answered in a turn; more would keep the control cycle waiting.
LINES_PER_TURN = 200


@dataclass(slots=True)
class _Session:
    """A client: its lines, and whether they are being answered."""

    lines: DashboardConnection
    is_busy: bool = False


class DashboardPort:
    """Answers dashboard lines."""

    def __init__(self, access: BoxAccess, answers: DashboardAnswers) -> None:
        """Serve a box.

        Args:
            access: to the box.
            answers: to the commands.
        """
        self._access = access
        self._answers = answers
        self._sessions: dict[Connection, _Session] = {}

    def opened(self, connection: Connection) -> None:
        """Send the greeting line; a client that has closed its sending side still gets its answers."""
        connection.allow_half_close(self.ended)
        session = _Session(DashboardConnection(self._access.identity.software.dashboard))
        self._sessions[connection] = session
        connection.send(session.lines.greet())

    def received(self, connection: Connection, data: bytes) -> None:
        """Take lines and answer what can be answered now; a client that sends too much is disconnected."""
        session = self._sessions[connection]
        try:
            session.lines.receive_data(data)
        except ProtocolError:
            connection.close()
            return
        if not session.is_busy:
            session.is_busy = True

            def finished(_: Any, error: Exception | None) -> None:
                session.is_busy = False
                if error is not None:
                    connection.close()
                elif connection.has_ended:
                    connection.close_when_sent()

            self._access.steps.start(self._serve(connection, session.lines), finished)

    def ended(self, connection: Connection) -> None:
        """A client sends nothing more: close it when all its lines are answered."""
        if not self._sessions[connection].is_busy:
            connection.close_when_sent()

    def closed(self, connection: Connection) -> None:
        """Forget the client; what it has begun goes on."""
        self._sessions.pop(connection, None)

    def _serve(self, connection: Connection, lines: DashboardConnection) -> Steps[None]:
        """Answer all lines that have come."""
        n_answered = 0
        while connection.is_open and (event := lines.next_event()) is not None:
            if n_answered and n_answered % LINES_PER_TURN == 0:
                yield
            n_answered += 1
            if not isinstance(event, CommandReceived):
                text = event.answer
            else:
                answer = self._answers.answer(event, connection.host)
                text = answer if isinstance(answer, str) else (yield from answer)
            self._reply(connection, lines, text)

    def _reply(self, connection: Connection, lines: DashboardConnection, text: str) -> None:
        # A reply may repeat what the client sent, and must stay one line of allowed length.
        line = text.replace("\r", " ").replace("\n", " ")[: MAX_LINE - 1]
        connection.send(lines.reply(line))
        if connection.dropped:
            connection.close()  # it does not read, and a reply less would shift all that follow
        if lines.is_closed:
            connection.close_when_sent()
