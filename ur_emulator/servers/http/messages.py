"""Requests and answers over HTTP as the ports that speak it have them, and what is refused before that."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any, NoReturn

import h11

from ur_emulator.budgets import BUDGETS

MAX_HEADER = 16 * 1024
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
class HttpRequest:
    """A whole request.

    Attributes:
        method: in capitals.
        path: without the query.
        query: behind the question mark, not decoded.
        headers: by name in lower case.
        body: all of it.
    """

    method: str
    path: str
    query: str
    headers: Mapping[str, str]
    body: bytes

    @classmethod
    def of(cls, head: h11.Request, body: bytes) -> HttpRequest:
        """Return a request from its head and its body."""
        path, _, query = head.target.decode("latin-1").partition("?")
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in head.headers}
        return cls(head.method.decode("latin-1"), path, query, headers, body)

    def json_object(self) -> dict[str, Any]:
        """Return the body as a JSON object; one without content is empty.

        Raises:
            HttpError: it is something else.
        """
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
        """Return a text of the JSON object in the body.

        Raises:
            HttpError: there is none.
        """
        try:
            text = self.json_object().get(key)
        except HttpError as error:
            raise HttpError(422, str(error)) from None
        if not isinstance(text, str):
            raise HttpError(422, f'the body needs a text {key!r}: {{"{key}": "..."}}')
        return text

    def word(self, key: str, allowed: Iterable[str]) -> str:
        """Return a text of the body that must be one of some words.

        Raises:
            HttpError: it is another, or there is none.
        """
        word, words = self.text(key), tuple(allowed)
        if word not in words:
            raise HttpError(422, f"{key} {ascii(word)[:60]} given: choose one of {', '.join(words)}")
        return word


@dataclass(frozen=True, slots=True)
class HttpAnswer:
    """An answer.

    Attributes:
        status: code.
        result: sent as JSON; bytes are sent as they are, and nothing with status 204.
        headers: beside the usual ones.
        content_type: of bytes.
    """

    status: int
    result: Any
    headers: tuple[tuple[str, str], ...] = ()
    content_type: str = "application/octet-stream"


def too_long(limit: int) -> HttpError:
    """Return the error about a body with more bytes than `limit`."""
    return HttpError(413, f"the body is longer than {limit} bytes")


def check_head(request: h11.Request) -> None:
    """Refuse other versions of HTTP and long headers, before the body is read.

    Raises:
        HttpError: says why.
    """
    if request.http_version not in (b"1.0", b"1.1"):
        raise HttpError(505, f"HTTP {request.http_version.decode('latin-1')} given: this port speaks 1.1")
    if len(request.target) + sum(len(name) + len(value) for name, value in request.headers) > MAX_HEADER:
        raise HttpError(431, f"the header is longer than {MAX_HEADER} bytes")


def check_origin(headers: Mapping[str, str], own_host: str) -> None:
    """Refuse the requests of web pages: they must not control a box.

    A request must name the address of the box as its host (another name that resolves to 127.0.0.1 is
    refused), and must not come from a page of another origin.

    Args:
        headers: of the request.
        own_host: address that the port is bound to.

    Raises:
        HttpError: says why.
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
        if name in ("localhost", own_host):
            return True
        # Bound to all addresses: any address will do, but no name: it could resolve to any of them.
        return ip_address(own_host).is_unspecified and bool(ip_address(name))
    except ValueError:
        return False


def _refuse(word: str) -> NoReturn:
    raise ValueError(f"{word} is not a number")
