"""Port 29999: the dashboard server. Lines of a client are answered one after the other, whatever it takes."""

from __future__ import annotations

from dataclasses import dataclass, field

from protocol.dashboard.connection import MAX_LINE, CommandReceived, DashboardConnection, UnknownCommand
from protocol.errors import ProtocolError
from ur_emulator.controller.events import Event
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.servers.box_access import BoxAccess
from ur_emulator.servers.dashboard.answers import Answer, DashboardAnswers, Steps
from ur_emulator.servers.tcp.connection import Connection

# Lines of one client that are answered in a turn; more would keep the control cycle waiting.
LINES_PER_TURN = 200


@dataclass(slots=True)
class _Session:
    """A client: its lines, and the steps towards the reply to the line that is being answered."""

    lines: DashboardConnection
    steps: Steps | None = None
    detached: list[Steps] = field(default_factory=list)


class DashboardPort:
    """Answers dashboard lines."""

    def __init__(self, access: BoxAccess, answers: DashboardAnswers) -> None:
        """Serve a box.

        Args:
            access: of the box; it is told whom to tell of jobs.
            answers: to the commands.
        """
        self._access = access
        self._answers = answers
        self._sessions: dict[Connection, _Session] = {}
        # Clients with lines that are not answered yet, and steps that nobody waits for any more.
        self._busy: dict[Connection, _Session] = {}
        self._detached: list[Steps] = []
        access.on_job_done.append(self.go_on)

    @property
    def clients(self) -> tuple[Connection, ...]:
        """Connected clients."""
        return tuple(self._sessions)

    def opened(self, connection: Connection) -> None:
        """Send the greeting line; a client that says no more may still hear."""
        connection.hear_out(self.ended)
        session = _Session(DashboardConnection(self._access.identity.software.version))
        self._sessions[connection] = session
        connection.send(session.lines.greet())

    def received(self, connection: Connection, data: bytes) -> None:
        """Take lines and answer what can be answered now; who sends no lines, or too many, is cut off."""
        session = self._sessions[connection]
        try:
            session.lines.receive_data(data)
        except ProtocolError:
            connection.close()
            return
        if connection not in self._busy:
            self._busy[connection] = session
            self._serve(connection, session)

    def ended(self, connection: Connection) -> None:
        """A client says no more; it is closed when all that it has said is answered."""
        if connection not in self._busy:
            connection.close_when_sent()

    def closed(self, connection: Connection) -> None:
        """Forget the client; what it has begun goes on."""
        session = self._sessions.pop(connection, None)
        self._busy.pop(connection, None)
        if session is not None and session.steps is not None:
            self._detached.append(session.steps)

    def publish(self, snapshot: Snapshot) -> None:
        """Look at what takes its time; nothing is streamed on this port."""
        if self._busy or self._detached:
            self.go_on()

    def say(self, event: Event) -> None:
        """Nothing is said unasked on this port."""

    def go_on(self) -> None:
        """Take all steps that can be taken now."""
        for connection, session in tuple(self._busy.items()):
            self._serve(connection, session)
        detached, self._detached = self._detached, []
        self._detached += [steps for steps in detached if not _ends(steps)]

    def _serve(self, connection: Connection, session: _Session) -> None:
        """Answer lines in order until one takes longer, or for a turn."""
        for _ in range(LINES_PER_TURN):
            if not connection.is_open:
                return
            if session.steps is None:
                answer = self._next_answer(connection, session)
                if answer is None:
                    self._busy.pop(connection, None)
                    if connection.has_ended:
                        connection.close_when_sent()
                    return
                if isinstance(answer, str):
                    self._reply(connection, session, answer)
                    continue
                session.steps = answer
            steps = session.steps
            try:
                text = next(steps)
            except StopIteration as end:
                text = str(end.value)
            else:
                if text is None:
                    return
                self._detached.append(steps)
            session.steps = None
            self._reply(connection, session, text)

    def _next_answer(self, connection: Connection, session: _Session) -> Answer | None:
        """Return the answer to the next line, None if there is none."""
        while (event := session.lines.next_event()) is not None:
            match event:
                case CommandReceived():
                    return self._answers.answer(event, connection.host)
                case UnknownCommand(_, text):
                    return text
        return None

    def _reply(self, connection: Connection, session: _Session, text: str) -> None:
        # A reply may repeat what the client sent, and must stay one line of allowed length.
        line = text.replace("\r", " ").replace("\n", " ")[: MAX_LINE - 1]
        connection.send(session.lines.reply(line))
        if connection.dropped:
            connection.close()  # it does not read, and a reply less would shift all that follow
        if session.lines.is_closed:
            connection.close_when_sent()


def _ends(steps: Steps) -> bool:
    """Take a step that nobody waits for; return whether it was the last."""
    try:
        next(steps)
    except StopIteration:
        return True
    return False
