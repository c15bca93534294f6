"""What a request to the control API asks for: an operation and its arguments, or why it is refused.

Web pages must not control a box. So a request must name the address of the box as its host (another name that
resolves to 127.0.0.1 is refused), and must not come from a page of another origin. Where the port has a
token, a request must show it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any
from urllib.parse import parse_qsl

import h11

from ur_emulator.commands.operation import Operation
from ur_emulator.control.operations import OPERATIONS
from ur_emulator.control.token import shows_token

MAX_HEADER = 16 * 1024
PREFIX = "/v1/"
LIST = "operations"
JSON = "application/json"
# A name or an address, and a port; nothing else that a URL may have there.
_HOST = re.compile(r"(\[[0-9A-Za-z:.%]+\]|[A-Za-z0-9.-]+)(?::[0-9]{1,5})?")
# What a browser says of where a request comes from: from the user, or from a page of this box.
_OWN_SITES = ("none", "same-origin")


class HttpError(Exception):
    """A request that is answered with an error.

    Attributes:
        status: code of the answer.
        headers: what the answer says beside its text.
    """

    def __init__(self, status: int, text: str, *headers: tuple[str, str]) -> None:
        super().__init__(text)
        self.status = status
        self.headers = headers


@dataclass(frozen=True, slots=True)
class Gate:
    """Whose requests are answered.

    Attributes:
        own_host: address that the port is bound to.
        token: what each request must show; None: nothing.
    """

    own_host: str
    token: str | None

    def check(self, headers: Mapping[str, str]) -> None:
        """Refuse the requests of web pages, and those without the token.

        Raises:
            HttpError: says why.
        """
        host = headers.get("host", "")
        if not _is_own(host, self.own_host.lower()):
            raise HttpError(
                403, f"host {ascii(host)[:60]} given: name the box by its address or as localhost"
            )
        origin = headers.get("origin")
        if origin is not None and origin != f"http://{host}":
            raise HttpError(403, f"pages of {ascii(origin)[:60]} may not control this box")
        if headers.get("sec-fetch-site", "none") not in _OWN_SITES:
            raise HttpError(403, "pages of other sites may not control this box")
        if self.token is not None and not shows_token(headers.get("authorization", ""), self.token):
            raise HttpError(
                401,
                "this port needs its token: ctl --token TOKEN, or the header Authorization: Bearer TOKEN",
                ("WWW-Authenticate", "Bearer"),
            )


def check_head(request: h11.Request) -> None:
    """Refuse other versions of HTTP and long headers, before the body is read.

    Raises:
        HttpError: says why.
    """
    if request.http_version not in (b"1.0", b"1.1"):
        raise HttpError(505, f"HTTP {request.http_version.decode('latin-1')} given: this port speaks 1.1")
    if len(request.target) + sum(len(name) + len(value) for name, value in request.headers) > MAX_HEADER:
        raise HttpError(431, f"the header is longer than {MAX_HEADER} bytes")


def parse_request(request: h11.Request, body: bytes, gate: Gate) -> tuple[str, Mapping[str, Any]]:
    """Return the name of what a request asks for, and its arguments.

    Args:
        request: the head.
        body: all of it.
        gate: decides whether it is answered.

    Returns:
        The name of an operation, or `LIST`; the arguments are not checked yet.

    Raises:
        HttpError: it is refused.
    """
    headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in request.headers}
    gate.check(headers)
    path, _, query = request.target.decode("latin-1").partition("?")
    name = path.removeprefix(PREFIX) if path.startswith(PREFIX) else ""
    operation = OPERATIONS.get(name)
    if operation is None and name != LIST:
        raise HttpError(404, f"there is no {ascii(path)[:60]}: GET {PREFIX}operations lists what there is")
    method = request.method.decode("latin-1")
    allowed = "GET" if operation is None or operation.only_reads else "POST"
    if method != allowed:
        raise HttpError(405, f"{name} is asked with {allowed}, not {method[:20]}", ("Allow", allowed))
    if operation is None:
        return name, {}
    if method == "GET":
        return name, _from_query(operation, query)
    return name, _from_body(headers.get("content-type", ""), body)


def _is_own(host: str, own_host: str) -> bool:
    """Return whether a Host header names the address that the port is bound to, or this machine."""
    match = _HOST.fullmatch(host)
    if match is None:
        return False
    name = match[1].strip("[]").lower()
    try:
        if name in ("localhost", own_host):
            return True
        # Bound to all addresses: any address will do, but no name: it could resolve to any of them.
        return ip_address(own_host).is_unspecified and bool(ip_address(name))
    except ValueError:
        return False


def _from_query(operation: type[Operation[Any]], query: str) -> dict[str, Any]:
    parameters = {parameter.name: parameter for parameter in operation.parameters}
    try:
        given = parse_qsl(query, keep_blank_values=True, max_num_fields=20)
    except ValueError:
        raise HttpError(400, "the query has too many fields") from None
    return {name: parameters[name].parse(text) if name in parameters else text for name, text in given}


def _from_body(content_type: str, body: bytes) -> dict[str, Any]:
    if (body or content_type) and content_type.partition(";")[0].strip().lower() != JSON:
        raise HttpError(400, f"content type {ascii(content_type)[:60]} given: the body must be {JSON}")
    if not body:
        return {}
    try:
        arguments = json.loads(body, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise HttpError(400, f"the body is not JSON: {' '.join(str(error).split())[:100]}") from None
    if not isinstance(arguments, dict):
        raise HttpError(400, "the body must be a JSON object, such as {}")
    return arguments


def _refuse(word: str) -> Any:
    raise ValueError(f"{word} is not a number")
