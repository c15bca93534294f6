"""A port that speaks HTTP: reads requests, and sends what `answers` has to say.

h11 knows HTTP/1.1. The requests of a client are answered in order, one after the other. Everything is
bounded: header, body, an answer, and the number of clients: the one that has been silent longest is closed
for a new one.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, fields, is_dataclass
from http import HTTPStatus
from typing import Any, Protocol

import h11

from ur_emulator.box_log import LogEntry
from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import NotRunningError
from ur_emulator.servers.box_access import BoxAccess
from ur_emulator.servers.http.messages import (
    JSON,
    MAX_HEADER,
    HttpAnswer,
    HttpError,
    HttpRequest,
    check_head,
    too_long,
)
from ur_emulator.servers.session import Session
from ur_emulator.servers.steps import Steps
from ur_emulator.servers.tcp.connection import Connection

# Units of work for a piece of a request; its answer takes the rest of the turn.
_PIECE_COST = 4


class Answers(Protocol):
    """What a port has to say."""

    def answer(self, request: HttpRequest, connection: Connection) -> Steps[HttpAnswer]:
        """Do what a request asks for.

        Raises:
            HttpError: it is answered with this error.
        """
        ...


class HttpPort:
    """Answers HTTP requests.

    Args:
        access: to the box.
        answers: to requests.
        most_bytes: of a body.
    """

    def __init__(self, access: BoxAccess, answers: Answers, most_bytes: int = BUDGETS.body_bytes) -> None:
        self._access = access
        self._answers = answers
        self._most_bytes = most_bytes
        # The one that has been silent longest first.
        self._sessions: dict[Connection, _HttpSession] = {}

    def opened(self, connection: Connection) -> None:
        """Take in a client; if there are too many, the one that has been silent longest is closed."""
        if len(self._sessions) >= BUDGETS.control_clients:
            idle = [other for other, session in self._sessions.items() if not session.is_busy]
            (idle or list(self._sessions))[0].close()
        self._sessions[connection] = _HttpSession(
            connection, self._access, self._answers, self._most_bytes, self._is_not_silent
        )
        connection.allow_half_close(self.ended)

    def received(self, connection: Connection, data: bytes) -> None:
        """Take bytes and answer what can be answered now."""
        self._sessions[connection].receive(data)

    def ended(self, connection: Connection) -> None:
        """A client sends nothing more; its requests are still answered."""
        self._sessions[connection].receive(b"")

    def closed(self, connection: Connection) -> None:
        """Forget the client; what it has begun takes its course."""
        self._sessions.pop(connection, None)

    def _is_not_silent(self, connection: Connection) -> None:
        """A client has sent a whole request."""
        self._sessions[connection] = self._sessions.pop(connection)


class _HttpSession(Session):
    """A client: its HTTP state, and the request that is read or answered.

    Attributes:
        http: reads requests, writes answers.
    """

    def __init__(
        self,
        connection: Connection,
        access: BoxAccess,
        answers: Answers,
        most_bytes: int,
        on_request: Callable[[Connection], None],
    ) -> None:
        super().__init__(connection, access)
        self._answers = answers
        self._most_bytes = most_bytes
        self._on_request = on_request
        self.http = h11.Connection(h11.SERVER, max_incomplete_event_size=MAX_HEADER)
        self._request: h11.Request | None = None
        self._body = bytearray()

    def _take(self, data: bytes) -> None:
        self.http.receive_data(data)

    def _finished(self, goes_on: bool | None, error: Exception | None) -> None:
        if isinstance(error, NotRunningError):
            self.is_busy = False
            self._reject(503, str(error))
        else:
            super()._finished(goes_on, error)

    def _answer_next(self) -> Steps[int]:
        """Read the next piece of a request; after the last one, answer it."""
        try:
            event = self.http.next_event()
            if isinstance(event, h11.EndOfMessage):
                self._on_request(self.connection)
                body, self._body = bytes(self._body), bytearray()
                yield from self._answer(body)
                return BUDGETS.client_work
            return self._read(event)
        except h11.RemoteProtocolError as error:
            self._reject(error.error_status_hint, f"not understood: {error}")
        except HttpError as error:
            self._reject(error.status, str(error))
        return 0

    def _read(self, event: h11.Event | type[h11.NEED_DATA] | type[h11.PAUSED]) -> int:
        """Take a piece of a request; return what it costs, 0 if more bytes are needed or none will come."""
        if isinstance(event, h11.Request):
            self._request = event
            check_head(event)
            if self.http.they_are_waiting_for_100_continue:
                self._send(h11.InformationalResponse(status_code=100, headers=[]))
        elif isinstance(event, h11.Data):
            self._body += event.data
            if len(self._body) > self._most_bytes:
                raise too_long(self._most_bytes)
        else:
            if event is not h11.NEED_DATA:
                self.connection.close_when_sent()
            return 0
        return _PIECE_COST

    def _answer(self, body: bytes) -> Steps[None]:
        """Do what a request asks for, and answer it."""
        assert self._request is not None
        try:
            answer = yield from self._answers.answer(HttpRequest.of(self._request, body), self.connection)
        except HttpError as error:
            answer = HttpAnswer(error.status, {"error": str(error)}, error.headers)
        self._finish(answer)

    # --- answers

    def _finish(self, answer: HttpAnswer) -> None:
        """Send an answer; then the next request may be read."""
        if not self.connection.is_open:
            return
        self._respond(answer)
        if self.http.our_state is h11.MUST_CLOSE:
            self.connection.close_when_sent()
        elif self.http.our_state is h11.DONE and self.http.their_state is h11.DONE:
            self.http.start_next_cycle()
            self._request = None

    def _reject(self, status: int, text: str) -> None:
        """Answer with an error after which nothing more can be read, and close."""
        if self.http.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self._respond(HttpAnswer(status, {"error": " ".join(text.split())}, (("Connection", "close"),)))
        self.connection.close_when_sent()

    def _respond(self, answer: HttpAnswer) -> None:
        content_type, body = answer.content_type, answer.result
        headers = [("Cache-Control", "no-store"), ("X-Content-Type-Options", "nosniff"), *answer.headers]
        has_body = answer.status != HTTPStatus.NO_CONTENT
        if has_body:
            if not isinstance(body, bytes):
                content_type = JSON
                body = json.dumps(body, default=_as_json, separators=(",", ":")).encode() + b"\n"
            headers += [("Content-Type", content_type), ("Content-Length", str(len(body)))]
        events: list[h11.Event] = [h11.Response(status_code=answer.status, headers=headers)]
        if has_body and (self._request is None or self._request.method != b"HEAD"):
            events.append(h11.Data(data=body))
        self._send(*events, h11.EndOfMessage())

    def _send(self, *events: h11.Event) -> None:
        """Send events in one package; a client that does not read its answers is closed."""
        data = b"".join(self.http.send(event) or b"" for event in events)
        if not self.connection.send(data):
            self.connection.close()


_LOG_FIELDS = tuple(field.name for field in fields(LogEntry))


def _as_json(value: Any) -> Any:
    if isinstance(value, LogEntry):
        values = {name: getattr(value, name) for name in _LOG_FIELDS}
        return values | {"level": value.level.name}
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return list(value)
