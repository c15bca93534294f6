"""The control API over HTTP: `GET /v1/state`, `POST /v1/push` with a JSON object, and so on.

h11 knows HTTP/1.1; `runner` does the operations. One request of a client is answered after the other. A page
in somebody's browser must not reach a box by accident or on purpose, so a request has to name the box's own
address as its host (a foreign name that resolves to 127.0.0.1 is refused), and must not come from a page of
another origin. Everything is bounded: header, body, what a client sends ahead, and the number of clients, the
one that has been silent longest makes room for a new one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, is_dataclass
from ipaddress import ip_address
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import h11

from ur_emulator.box_log import LogEntry
from ur_emulator.commands.operation import Operation
from ur_emulator.control.operations import OPERATIONS, describe
from ur_emulator.control.runner import Job, OperationRunner
from ur_emulator.controller.events import Event
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.errors import ArgumentError, EmulatorError, NotRunningError, RefusedError
from ur_emulator.servers.tcp.connection import Connection

MAX_HEADER = 16 * 1024
MAX_BODY = 1024 * 1024
# Bytes that a client may send ahead while its last request is being answered.
MAX_AHEAD = MAX_BODY + MAX_HEADER
MAX_CLIENTS = 64
PREFIX = "/v1/"
_LIST = "operations"
_JSON = "application/json"


class _HttpError(Exception):
    """A request that is answered with an error."""

    def __init__(self, status: int, text: str, allow: str = "") -> None:
        super().__init__(text)
        self.status = status
        self.allow = allow


@dataclass(slots=True)
class _Session:
    """A client: its HTTP state, the request that comes in, the operation that is under way."""

    http: h11.Connection
    request: h11.Request | None = None
    body: bytearray = field(default_factory=bytearray)
    job: Job | None = None
    is_busy: bool = False
    is_waiting: bool = False
    n_ahead: int = 0
    in_serve: bool = False


class HttpPort:
    """Answers HTTP requests.

    Args:
        runner: runs the operations.
        host: address that the port is bound to.
    """

    def __init__(self, runner: OperationRunner, host: str) -> None:
        self._runner = runner
        self._host = host.lower()
        self._sessions: dict[Connection, _Session] = {}

    @property
    def clients(self) -> tuple[Connection, ...]:
        """Connected clients, the one that has been silent longest first."""
        return tuple(self._sessions)

    def opened(self, connection: Connection) -> None:
        """Take in a client; if there are too many, the most silent one has to go."""
        if len(self._sessions) >= MAX_CLIENTS:
            idle = [other for other, session in self._sessions.items() if not session.is_busy]
            (idle or list(self._sessions))[0].close()
        self._sessions[connection] = _Session(
            h11.Connection(h11.SERVER, max_incomplete_event_size=MAX_HEADER)
        )
        connection.hear_out(self.ended)

    def received(self, connection: Connection, data: bytes) -> None:
        """Take bytes and answer what can be answered now."""
        session = self._sessions[connection]
        if session.is_busy:
            session.n_ahead += len(data)
            if session.n_ahead > MAX_AHEAD:
                connection.close()
                return
        session.http.receive_data(data)
        self._serve(connection, session)

    def ended(self, connection: Connection) -> None:
        """A client says no more; it may wait for an answer still, but not for what may take an hour."""
        session = self._sessions.get(connection)
        if session is not None and session.is_waiting:
            connection.close()
        elif session is not None:
            session.http.receive_data(b"")
            self._serve(connection, session)

    def closed(self, connection: Connection) -> None:
        """Forget the client; what it waits for is forgotten, what it has begun takes its course."""
        session = self._sessions.pop(connection, None)
        if session is not None and session.job is not None:
            self._runner.cancel(session.job)

    def publish(self, snapshot: Snapshot) -> None:
        """Nothing is streamed on this port."""

    def say(self, event: Event) -> None:
        """Nothing is said unasked on this port."""

    # --- requests

    def _serve(self, connection: Connection, session: _Session) -> None:
        """Read requests and answer them, one after the other, until more bytes are needed."""
        if session.in_serve:
            return
        session.in_serve = True
        try:
            while connection.is_open and not session.is_busy and self._read(connection, session):
                pass
        except h11.RemoteProtocolError as error:
            self._reject(connection, session, error.error_status_hint, f"not understood: {error}")
        except _HttpError as error:
            self._reject(connection, session, error.status, str(error))
        except Exception as error:  # a defect of ours must not end the box
            self._runner.complain(f"a request of {connection.peer} could not be answered: {error!r}")
            connection.close()
        finally:
            session.in_serve = False

    def _read(self, connection: Connection, session: _Session) -> bool:
        """Take the next event of a client; return False when there is none."""
        event = session.http.next_event()
        if isinstance(event, h11.Request):
            session.request = event
            _check_head(event)
            if session.http.they_are_waiting_for_100_continue:
                self._send(connection, session, h11.InformationalResponse(status_code=100, headers=[]))
        elif isinstance(event, h11.Data):
            session.body += event.data
            if len(session.body) > MAX_BODY:
                raise _HttpError(413, f"the body is longer than {MAX_BODY} bytes")
        elif isinstance(event, h11.EndOfMessage):
            self._dispatch(connection, session)
        elif event is h11.PAUSED:
            connection.close_when_sent()
            return False
        else:
            if isinstance(event, h11.ConnectionClosed):
                connection.close_when_sent()
            return False
        return True

    def _dispatch(self, connection: Connection, session: _Session) -> None:
        """Answer a request that is complete, or begin what it asks for."""
        self._sessions[connection] = self._sessions.pop(connection)  # it is not silent
        session.is_busy, session.n_ahead = True, 0
        request, body, session.body = session.request, bytes(session.body), bytearray()
        assert request is not None
        try:
            name, arguments = self._understand(request, body)
        except _HttpError as error:
            self._finish(connection, session, error.status, {"error": str(error)}, error.allow)
            return
        if name == _LIST:
            self._finish(connection, session, 200, {"operations": describe()})
            return

        def done(result: Any, error: EmulatorError | None) -> None:
            session.job, session.is_waiting = None, False
            if error is None:
                self._finish(connection, session, 200, result)
            else:
                self._finish(connection, session, _status_of(error), {"error": str(error)})
            self._serve(connection, session)

        session.job = self._runner.begin(name, arguments, done)
        session.is_waiting = session.job is not None and name == "wait_until"
        if session.is_waiting and connection.has_ended:
            connection.close()

    def _understand(self, request: h11.Request, body: bytes) -> tuple[str, Mapping[str, Any]]:
        """Return the name of what a request asks for, and what it is given."""
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in request.headers}
        self._check_origin(headers)
        path, _, query = request.target.decode("latin-1").partition("?")
        name = path.removeprefix(PREFIX) if path.startswith(PREFIX) else ""
        operation = OPERATIONS.get(name)
        if operation is None and name != _LIST:
            raise _HttpError(
                404, f"there is no {ascii(path)[:60]}: GET {PREFIX}operations lists what there is"
            )
        method = request.method.decode("latin-1")
        allowed = "GET" if operation is None or operation.only_reads else "POST"
        if method != allowed:
            raise _HttpError(405, f"{name} is asked with {allowed}, not {method[:20]}", allowed)
        if operation is None:
            return name, {}
        if method == "GET":
            return name, _from_query(operation, query)
        return name, _from_body(headers.get("content-type", ""), body)

    def _check_origin(self, headers: Mapping[str, str]) -> None:
        host = headers.get("host", "")
        if not self._is_own(host):
            raise _HttpError(
                403, f"host {ascii(host)[:60]} given: name the box by its address or as localhost"
            )
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            raise _HttpError(403, f"pages of {ascii(origin)[:60]} may not control this box")

    def _is_own(self, host: str) -> bool:
        """Return whether a Host header names the address that the port is bound to, or this machine."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
            if name in ("localhost", self._host):
                return True
            # Bound to all addresses: any address will do, but no name: it could resolve to any of them.
            return ip_address(self._host).is_unspecified and bool(ip_address(name))
        except ValueError:
            return False

    # --- answers

    def _finish(
        self, connection: Connection, session: _Session, status: int, result: Any, allow: str = ""
    ) -> None:
        """Send an answer; then the next request may be read."""
        if connection.is_open:
            self._respond(connection, session, status, result, allow)
        session.is_busy = False
        if connection.is_open and session.http.our_state is h11.MUST_CLOSE:
            connection.close_when_sent()
        elif session.http.our_state is h11.DONE and session.http.their_state is h11.DONE:
            session.http.start_next_cycle()
            session.request = None

    def _reject(self, connection: Connection, session: _Session, status: int, text: str) -> None:
        """Answer what cannot be read on, and close."""
        if session.http.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self._respond(connection, session, status, {"error": " ".join(text.split())}, close=True)
        connection.close_when_sent()

    def _respond(
        self,
        connection: Connection,
        session: _Session,
        status: int,
        result: Any,
        allow: str = "",
        close: bool = False,
    ) -> None:
        body = json.dumps(result, default=_as_json).encode() + b"\n"
        headers = [
            ("Content-Type", _JSON),
            ("Content-Length", str(len(body))),
            ("Cache-Control", "no-store"),
            ("X-Content-Type-Options", "nosniff"),
        ]
        if allow:
            headers.append(("Allow", allow))
        if close:
            headers.append(("Connection", "close"))
        events: list[h11.Event] = [h11.Response(status_code=status, headers=headers)]
        if session.request is None or session.request.method != b"HEAD":
            events.append(h11.Data(data=body))
        self._send(connection, session, *events, h11.EndOfMessage())

    def _send(self, connection: Connection, session: _Session, *events: h11.Event) -> None:
        """Send events in one package; a client that does not read its answers is closed."""
        data = b"".join(session.http.send(event) or b"" for event in events)
        if not connection.send(data):
            connection.close()


def _check_head(request: h11.Request) -> None:
    if request.http_version not in (b"1.0", b"1.1"):
        raise _HttpError(505, f"HTTP {request.http_version.decode('latin-1')} given: this port speaks 1.1")
    if len(request.target) + sum(len(name) + len(value) for name, value in request.headers) > MAX_HEADER:
        raise _HttpError(431, f"the header is longer than {MAX_HEADER} bytes")


def _status_of(error: EmulatorError) -> int:
    if isinstance(error, ArgumentError):
        return 400
    if isinstance(error, RefusedError):
        return 409
    return 503 if isinstance(error, NotRunningError) else 500


def _from_query(operation: type[Operation[Any]], query: str) -> dict[str, Any]:
    parameters = {parameter.name: parameter for parameter in operation.parameters}
    try:
        given = parse_qsl(query, keep_blank_values=True, max_num_fields=20)
    except ValueError:
        raise _HttpError(400, "the query has too many fields") from None
    return {name: parameters[name].parse(text) if name in parameters else text for name, text in given}


def _from_body(content_type: str, body: bytes) -> dict[str, Any]:
    if (body or content_type) and content_type.partition(";")[0].strip().lower() != _JSON:
        raise _HttpError(400, f"content type {ascii(content_type)[:60]} given: the body must be {_JSON}")
    if not body:
        return {}
    try:
        arguments = json.loads(body, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise _HttpError(400, f"the body is no JSON: {' '.join(str(error).split())[:100]}") from None
    if not isinstance(arguments, dict):
        raise _HttpError(400, "the body must be a JSON object, such as {}")
    return arguments


def _refuse(word: str) -> Any:
    raise ValueError(f"{word} is no number")


def _as_json(value: Any) -> Any:
    if isinstance(value, LogEntry):
        return {
            "tick": value.tick,
            "time": value.time,
            "level": value.level.name,
            "source": value.source,
            "text": value.text,
            "code": value.code,
        }
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    return list(value)
