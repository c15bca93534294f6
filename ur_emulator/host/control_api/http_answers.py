"""The control API over HTTP: `GET /v1/state`, `POST /v1/push` with a JSON object, and so on.

Where the port has a token, a request must show it.
"""

import hmac
from collections.abc import Callable, Mapping
from typing import Any
from urllib.parse import parse_qsl

from ur_emulator.errors import ArgumentError, EmulatorError, NotRunningError, RefusedError, WaitTimeoutError
from ur_emulator.host.control_api.operations import OPERATIONS, describe, make
from ur_emulator.host.control_api.step_operations import WaitUntil
from ur_emulator.host.ports.http import HttpAnswer, HttpError, HttpRequest, check_origin
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.operation import Operation

PREFIX = "/v1/"
LIST = "operations"
# The first that an error is; the status of others is 500.
_STATUS = ((ArgumentError, 400), (WaitTimeoutError, 408), (RefusedError, 409), (NotRunningError, 503))
_GONE = HttpAnswer(503, {"error": "the client has gone"})


class ControlAnswers:
    """Does the operations that requests name.

    `operate` does one in steps; `own_host` is the address that the port is bound to; each request must show
    the token, if there is one.
    """

    def __init__(
        self, operate: Callable[[Operation[Any]], Steps[Any]], own_host: str, token: str | None
    ) -> None:
        self._operate = operate
        self._own_host = own_host
        self._token = token

    def answer(self, request: HttpRequest, connection: Connection) -> Steps[HttpAnswer]:
        """Do an operation; a client that has gone does not keep a wait alive."""
        self._check(request.headers)
        method, name = request.method, request.path.removeprefix(PREFIX)
        if not request.path.startswith(PREFIX) or name not in (LIST, *OPERATIONS):
            text = f"there is no {ascii(request.path)[:60]}: GET {PREFIX}operations lists what there is"
            raise HttpError(404, text)
        allowed = "GET" if name == LIST or OPERATIONS[name].only_reads else "POST"
        if method != allowed:
            raise HttpError(405, f"{name} is asked with {allowed}, not {method[:20]}", ("Allow", allowed))
        if name == LIST:
            return HttpAnswer(200, {"operations": describe()})
        try:
            given = _from_query(name, request.query) if method == "GET" else request.json_object()
            operation = make(name, given)
            steps = self._operate(operation)
            while True:
                next(steps)
                if connection.has_ended and isinstance(operation, WaitUntil):
                    connection.close()  # it may have gone, and the wait may take an hour
                if not connection.is_open:
                    return _GONE
                yield
        except StopIteration as end:
            return HttpAnswer(200, end.value)
        except EmulatorError as error:
            status = next((status for kind, status in _STATUS if isinstance(error, kind)), 500)
            raise HttpError(status, str(error)) from None

    def _check(self, headers: Mapping[str, str]) -> None:
        check_origin(headers, self._own_host)
        if self._token is not None and not shows_token(headers.get("authorization", ""), self._token):
            raise HttpError(
                401,
                "this port needs its token: ctl --token TOKEN, or the header Authorization: Bearer TOKEN",
                ("WWW-Authenticate", "Bearer"),
            )


def shows_token(authorization: str, token: str) -> bool:
    """Return whether a header `Authorization: Bearer TOKEN` shows the token."""
    scheme, _, shown = authorization.partition(" ")
    is_equal = hmac.compare_digest(shown.strip().encode("utf-8"), token.encode("utf-8"))
    return scheme.lower() == "bearer" and is_equal


def _from_query(name: str, query: str) -> dict[str, object]:
    parameters = {parameter.name: parameter for parameter in OPERATIONS[name].parameters}
    try:
        given = parse_qsl(query, keep_blank_values=True, max_num_fields=20)
    except ValueError:
        raise HttpError(400, "the query has too many fields") from None
    return {key: parameters[key].parse(text) if key in parameters else text for key, text in given}
