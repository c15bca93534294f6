"""Port 29999: the dashboard server. The lines of a client are answered in order, one after the other."""

from __future__ import annotations

from protocol.dashboard.commands import REMOTE_CONTROL_ONLY
from protocol.dashboard.connection import MAX_LINE, CommandReceived, DashboardConnection
from protocol.errors import ProtocolError
from ur_emulator.servers.box_access import BoxAccess
from ur_emulator.servers.dashboard.answers import DashboardAnswers
from ur_emulator.servers.session import Session
from ur_emulator.servers.steps import Steps
from ur_emulator.servers.tcp.connection import Connection

# Units of work for a line, and for so many bytes of it.
_LINE_COST, _BYTES_PER_UNIT = 2, 1024


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
        self._sessions: dict[Connection, _DashboardSession] = {}

    def opened(self, connection: Connection) -> None:
        """Send the greeting line; a client that has closed its sending side still gets its answers."""
        connection.allow_half_close(self.ended)
        session = _DashboardSession(connection, self._access, self._answers)
        self._sessions[connection] = session
        connection.send(session.lines.greet())

    def received(self, connection: Connection, data: bytes) -> None:
        """Take lines and answer what can be answered now; a client whose line has no end is disconnected."""
        self._sessions[connection].receive(data)

    def ended(self, connection: Connection) -> None:
        """A client sends nothing more: close it when all its lines are answered."""
        self._sessions[connection].answer_requests()

    def closed(self, connection: Connection) -> None:
        """Forget the client; what it has begun goes on."""
        self._sessions.pop(connection, None)


class _DashboardSession(Session):
    """A client.

    Attributes:
        lines: what it has sent, and how answers are written.
    """

    def __init__(self, connection: Connection, access: BoxAccess, answers: DashboardAnswers) -> None:
        super().__init__(connection, access)
        self.lines = DashboardConnection(access.identity.software.dashboard)
        self._answers = answers
        self._remote_period = self._period_now()

    def _period_now(self) -> int:
        return self._access.controller.state.pendant.remote_period

    def _take(self, data: bytes) -> None:
        try:
            self.lines.receive_data(data)
        except ProtocolError:
            self.connection.close()

    def _answer_next(self) -> Steps[int]:
        event = self.lines.next_event()
        if event is None:
            return 0
        if not isinstance(event, CommandReceived):
            text = event.answer
        elif event.command.needs_remote and not 0 < self._remote_period == self._period_now():
            text = REMOTE_CONTROL_ONLY
        else:
            answer = self._answers.answer(event, self.connection.host)
            text = answer if isinstance(answer, str) else (yield from answer)
        self._reply(text)
        return _LINE_COST + len(text) // _BYTES_PER_UNIT

    def _reply(self, text: str) -> None:
        # A reply may repeat what the client sent, and must stay one line of allowed length.
        line = text.replace("\r", " ").replace("\n", " ")[: MAX_LINE - 1]
        self.connection.send(self.lines.reply(line))
        if self.connection.dropped:
            self.connection.close()  # it does not read, and a reply less would shift all that follow
        if self.lines.is_closed:
            self.connection.close_when_sent()
