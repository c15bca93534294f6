"""The control API over HTTP: `GET /v1/state`, `POST /v1/push` with a JSON object, and so on.

Where the port has a token, a request must show it.
"""

import hmac
from collections.abc import Mapping
from typing import Any
from urllib.parse import parse_qsl

from ur_emulator.errors import ArgumentError, EmulatorError, NotRunningError, RefusedError, WaitTimeoutError
from ur_emulator.host.control_api.operations import OPERATIONS, describe
from ur_emulator.host.control_api.runner import OperationRunner
from ur_emulator.host.ports.http import HttpAnswer, HttpError, HttpRequest, check_origin
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.operation import Operation

PREFIX = "/v1/"
LIST = "operations"
_GONE = HttpAnswer(503, {"error": "the client has gone"})


class ControlAnswers:
    """Does the operations that requests name.

    `own_host` is the address that the port is bound to; each request must show the token, if there is one.
    """

    def __init__(self, runner: OperationRunner, own_host: str, token: str | None) -> None:
        self._runner = runner
        self._own_host = own_host
        self._token = token

    def answer(self, request: HttpRequest, connection: Connection) -> Steps[HttpAnswer]:
        """Do an operation; a client that has gone does not keep a wait alive."""
        self._check(request.headers)
        name, arguments = parse_request(request)
        if name == LIST:
            return HttpAnswer(200, {"operations": describe()})
        steps = self._runner.steps(name, arguments)
        try:
            while True:
                next(steps)
                if connection.has_ended and name == "wait_until":
                    connection.close()  # it may have gone, and the wait may take an hour
                if not connection.is_open:
                    return _GONE
                yield
        except StopIteration as end:
            return HttpAnswer(200, end.value)
        except EmulatorError as error:
            raise HttpError(_status_of(error), str(error)) from None

    def _check(self, headers: Mapping[str, str]) -> None:
        check_origin(headers, self._own_host)
        if self._token is not None and not shows_token(headers.get("authorization", ""), self._token):
            raise HttpError(
                401,
                "this port needs its token: ctl --token TOKEN, or the header Authorization: Bearer TOKEN",
                ("WWW-Authenticate", "Bearer"),
            )


def parse_request(request: HttpRequest) -> tuple[str, Mapping[str, Any]]:
    """Return the operation that a request names, or `LIST`, and its arguments, not yet checked.

    HttpError if the request is refused.
    """
    path = request.path
    name = path.removeprefix(PREFIX) if path.startswith(PREFIX) else ""
    operation = OPERATIONS.get(name)
    if operation is None and name != LIST:
        raise HttpError(404, f"there is no {ascii(path)[:60]}: GET {PREFIX}operations lists what there is")
    allowed = "GET" if operation is None or operation.only_reads else "POST"
    if request.method != allowed:
        raise HttpError(405, f"{name} is asked with {allowed}, not {request.method[:20]}", ("Allow", allowed))
    if operation is None:
        return name, {}
    if allowed == "GET":
        return name, _from_query(operation, request.query)
    return name, request.json_object()


def shows_token(authorization: str, token: str) -> bool:
    """Return whether a header `Authorization: Bearer TOKEN` shows the token."""
    scheme, _, shown = authorization.partition(" ")
    is_equal = hmac.compare_digest(shown.strip().encode("utf-8"), token.encode("utf-8"))
    return scheme.lower() == "bearer" and is_equal


def _from_query(operation: type[Operation[Any]], query: str) -> dict[str, Any]:
    parameters = {parameter.name: parameter for parameter in operation.parameters}
    try:
        given = parse_qsl(query, keep_blank_values=True, max_num_fields=20)
    except ValueError:
        raise HttpError(400, "the query has too many fields") from None
    return {name: parameters[name].parse(text) if name in parameters else text for name, text in given}


def _status_of(error: EmulatorError) -> int:
    if isinstance(error, ArgumentError):
        return 400
    if isinstance(error, RefusedError):
        return 408 if isinstance(error, WaitTimeoutError) else 409
    return 503 if isinstance(error, NotRunningError) else 500
