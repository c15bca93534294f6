"""Ports that speak HTTP: requests are read and checked, an `Answer` says what is sent back.

h11 knows HTTP/1.1. The requests of a client are answered in order, one after the other. Everything is
bounded: header, body, an answer, and the number of clients: the one that has been silent longest is closed
for a new one.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache, partial
from http import HTTPStatus
from ipaddress import ip_address
from typing import Any, NoReturn

import h11

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import NotRunningError
from ur_emulator.host.box_log import LogEntry
from ur_emulator.host.ports.session import Session, SessionPort
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps

MAX_HEADER = 16 * 1024
JSON = "application/json"
# A name or an address, and a port; nothing else that a URL may have there.
_HOST = re.compile(r"(\[[0-9A-Za-z:.%]+\]|[A-Za-z0-9.-]+)(?::[0-9]{1,5})?")
# What a browser says of where a request comes from: from the user, or from a page of this box.
_OWN_SITES = ("none", "same-origin")


class HttpError(Exception):
    """A request that is answered with an error; `headers` are what the answer says beside its text."""

    def __init__(self, status: int, text: str, *headers: tuple[str, str]) -> None:
        super().__init__(text)
        self.status = status
        self.headers = headers


@dataclass(frozen=True, slots=True)
class HttpRequest:
    """A whole request: path without the query, query not decoded, headers by name in lower case."""

    method: str
    path: str
    query: str
    headers: Mapping[str, str]
    body: bytes

    def json_object(self) -> dict[str, Any]:
        """Return the body as a JSON object, empty without content; HttpError if it is something else."""
        content_type = self.headers.get("content-type", "")
        if (self.body or content_type) and content_type.partition(";")[0].strip().lower() != JSON:
            raise HttpError(400, f"content type {ascii(content_type)[:60]} given: the body must be {JSON}")
        if not self.body:
            return {}
        if len(self.body) > BUDGETS.body_bytes:
            raise too_long(BUDGETS.body_bytes)
        try:
            arguments = json.loads(self.body, parse_constant=_refuse)
        except (ValueError, RecursionError) as error:
            raise HttpError(400, f"the body is not JSON: {' '.join(str(error).split())[:100]}") from None
        if not isinstance(arguments, dict):
            raise HttpError(400, "the body must be a JSON object, such as {}")
        return arguments

    def text(self, key: str) -> str:
        """Return a text of the JSON object in the body; HttpError if there is none."""
        try:
            text = self.json_object().get(key)
        except HttpError as error:
            raise HttpError(422, str(error)) from None
        if not isinstance(text, str):
            raise HttpError(422, f'the body needs a text {key!r}: {{"{key}": "..."}}')
        return text

    def word(self, key: str, allowed: Iterable[str]) -> str:
        """Return a text of the body that must be one of some words; HttpError if it is none of them."""
        word, words = self.text(key), tuple(allowed)
        if word not in words:
            raise HttpError(422, f"{key} {ascii(word)[:60]} given: choose one of {', '.join(words)}")
        return word


@dataclass(frozen=True, slots=True)
class HttpAnswer:
    """An answer.

    Attributes:
        result: sent as JSON; bytes are sent as they are, of the content type, and nothing with status 204.
        headers: beside the usual ones.
    """

    status: int
    result: Any
    headers: tuple[tuple[str, str], ...] = ()
    content_type: str = "application/octet-stream"


def too_long(limit: int) -> HttpError:
    """Return the error about a body with more bytes than `limit`."""
    return HttpError(413, f"the body is longer than {limit} bytes")


def check_origin(headers: Mapping[str, str], own_host: str) -> None:
    """Refuse the requests of web pages with an HttpError: they must not control a box.

    A request must name the address of the box, `own_host`, as its host (another name that resolves to
    127.0.0.1 is refused), and must not come from a page of another origin.
    """
    host = headers.get("host", "")
    if not _is_own(host, own_host.lower()):
        raise HttpError(403, f"host {ascii(host)[:60]} given: name the box by its address or as localhost")
    origin = headers.get("origin")
    if origin is not None and origin != f"http://{host}":
        raise HttpError(403, f"pages of {ascii(origin)[:60]} may not control this box")
    if headers.get("sec-fetch-site", "none") not in _OWN_SITES:
        raise HttpError(403, "pages of other sites may not control this box")


def _is_own(host: str, own_host: str) -> bool:
    """Return whether a Host header names the address that the port is bound to, or this machine."""
    match = _HOST.fullmatch(host)
    if match is None:
        return False
    name = match[1].strip("[]").lower()
    try:
        if name in ("localhost", "127.0.0.1", own_host):
            return True
        # Bound to all addresses: any address will do, but no name: it could resolve to any of them.
        return ip_address(own_host).is_unspecified and bool(ip_address(name))
    except ValueError:
        return False


def _refuse(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")


# Units of work for a piece of a request; its answer takes the rest of the turn.
_PIECE_COST = 4


# Does what a request of a client asks for; an HttpError is the answer, too.
Answer = Callable[[HttpRequest, Connection], Steps[HttpAnswer]]


class HttpPort(SessionPort["_HttpSession"]):
    """Answers HTTP requests whose bodies have at most `most_bytes`."""

    def __init__(self, box: ServedBox, answer: Answer, most_bytes: int = BUDGETS.body_bytes) -> None:
        session = partial(_HttpSession, answer=answer, most_bytes=most_bytes, on_request=self._is_not_silent)
        super().__init__(box, session)  # the session that has been silent longest is the first

    def opened(self, connection: Connection) -> None:
        """Take in a client; if there are too many, close the one that has been silent longest."""
        if len(self._sessions) >= BUDGETS.control_clients:
            idle = [other for other, session in self._sessions.items() if not session.is_busy]
            (idle or list(self._sessions))[0].close()
        super().opened(connection)

    def _is_not_silent(self, connection: Connection) -> None:
        """A client has sent a whole request."""
        self._sessions[connection] = self._sessions.pop(connection)


class _HttpSession(Session):
    """A client: its HTTP state, and the request that is read or answered."""

    allows_half_close = True

    def __init__(
        self,
        connection: Connection,
        box: ServedBox,
        answer: Answer,
        most_bytes: int,
        on_request: Callable[[Connection], None],
    ) -> None:
        super().__init__(connection, box)
        self._do = answer
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
                yield from self._answer()
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
            if event.http_version not in (b"1.0", b"1.1"):
                raise HttpError(
                    505, f"HTTP {event.http_version.decode('latin-1')} given: this port speaks 1.1"
                )
            if len(event.target) + sum(len(name) + len(value) for name, value in event.headers) > MAX_HEADER:
                raise HttpError(431, f"the header is longer than {MAX_HEADER} bytes")
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

    def _answer(self) -> Steps[None]:
        """Do what a request asks for, and answer it; then the next request may be read."""
        head, body = self._request, bytes(self._body)
        assert head is not None
        self._body.clear()
        path, _, query = head.target.decode("latin-1").partition("?")
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in head.headers}
        request = HttpRequest(head.method.decode("latin-1"), path, query, headers, body)
        try:
            answer = yield from self._do(request, self.connection)
        except HttpError as error:
            answer = HttpAnswer(error.status, {"error": str(error)}, error.headers)
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


@cache
def _names(kind: type) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _as_json(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type):
        # `asdict` copies all that is inside, too, which takes longer than to write it.
        values = {name: getattr(value, name) for name in _names(type(value))}
        return values | {"level": value.level.name} if isinstance(value, LogEntry) else values
    return list(value)
