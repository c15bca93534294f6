"""One XML-RPC call over HTTP: a request goes out, the answer is read piece by piece as it comes.

Everything that comes is bounded: bytes, time, values, depth. Packed answers are not offered and not taken,
redirects are not followed.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, Final
from urllib.parse import urlsplit

import h11

from protocol.errors import RemoteProtocolError
from protocol.xmlrpc import AnswerReader, RemoteFaultError
from ur_emulator.budgets import BUDGETS
from ur_emulator.scripting.network import RemoteCallError, ScriptSocket

# A server that cannot be reached fails the call after this [s]; an answer may begin at any time.
CONNECT_TIMEOUT: Final = 5.0
# Path of a URL without one, as the clients of Python's library have it.
DEFAULT_PATH: Final = "/RPC2"
# Bytes of an answer that are read in a turn of the loop; they take 1 ms.
_PIECE: Final = 8 * 1024
_CLOSED: Final = "the server has closed the connection"

Exchange = Generator[bool, None, Any]
"""Yields whether it has read a piece, False when it waits; returns the value, raises RemoteCallError."""


class UnansweredError(RemoteCallError):
    """The connection ended before an answer began."""


class ServerAddress:
    """Where a server listens.

    Attributes:
        host: name or address.
        port: number.
        netloc: both, as the URL has them.
        target: path and query.
    """

    def __init__(self, url: str) -> None:
        """Read a URL; RemoteCallError if it is not one of an XML-RPC server."""
        try:
            parts = urlsplit(url)
            self.host = parts.hostname or ""
            self.port = 80 if parts.port is None else parts.port
        except ValueError:  # of the port, or of brackets
            self.host = ""
        if not self.host or parts.scheme != "http" or parts.username is not None:
            raise RemoteCallError(f"{url[:200]} is not an address, write http://host:port/path")
        self.netloc = parts.netloc
        self.target = (parts.path or DEFAULT_PATH) + (f"?{parts.query}" if parts.query else "")


class HttpChannel:
    """A connection to a server, on which one call follows the other."""

    def __init__(self, socket: ScriptSocket) -> None:
        self.socket = socket
        self._http = h11.Connection(h11.CLIENT)

    @property
    def is_reusable(self) -> bool:
        """Whether another call may be made: it stands, and nothing has come that was not asked for."""
        return (
            self.socket.is_open
            and not self.socket.inbox
            and self._http.our_state is h11.IDLE
            and not self._http.trailing_data[0]
        )

    def connect(self, address: ServerAddress, clock: Callable[[], float]) -> Exchange:
        """Wait until the connection stands."""
        end = clock() + CONNECT_TIMEOUT
        while self.socket.is_connecting and clock() < end:
            yield False
        if not self.socket.is_open:
            late = f"no connection within {CONNECT_TIMEOUT:g} s" if self.socket.is_connecting else ""
            why = late or self.socket.problem or "Connection refused"
            raise RemoteCallError(f"{address.netloc} does not answer: {why}")

    def call(self, address: ServerAddress, body: bytes, clock: Callable[[], float]) -> Exchange:
        """Send a call and read its answer."""
        try:
            request = h11.Request(
                method="POST",
                target=address.target,
                headers=[
                    ("Host", address.netloc),
                    ("Content-Type", "text/xml"),
                    ("Content-Length", str(len(body))),
                ],
            )
        except (h11.LocalProtocolError, UnicodeEncodeError):
            raise RemoteCallError(f"{address.netloc}{address.target} is not an address") from None
        events: tuple[h11.Event, ...] = (request, h11.Data(data=body), h11.EndOfMessage())
        if not self.socket.send(b"".join(self._http.send(event) or b"" for event in events)):
            if not self.socket.is_open:
                raise UnansweredError(_CLOSED)
            raise RemoteCallError("the call could not be sent: too many bytes wait to be sent")
        try:
            value = yield from self._answer(clock)
        except RemoteFaultError as fault:
            raise RemoteCallError(str(fault)) from None
        except (h11.RemoteProtocolError, RemoteProtocolError) as problem:
            raise RemoteCallError(f"the answer makes no sense: {problem}") from None
        if self._http.our_state is h11.DONE and self._http.their_state is h11.DONE:
            self._http.start_next_cycle()
        return value

    def _answer(self, clock: Callable[[], float]) -> Exchange:
        reader = AnswerReader(BUDGETS.remote_values)
        n_bytes, end = 0, 0.0
        while True:
            event = self._http.next_event()
            if event is h11.NEED_DATA:
                while self.socket.is_open and not self.socket.inbox:
                    if end and clock() > end:
                        raise RemoteCallError(
                            f"the answer takes longer than {BUDGETS.remote_answer_time:g} s"
                        )
                    yield False
                if not n_bytes and not self.socket.inbox:
                    raise UnansweredError(_CLOSED)
                end = end or clock() + BUDGETS.remote_answer_time
                data = bytes(self.socket.inbox[:_PIECE])
                del self.socket.inbox[:_PIECE]
                n_bytes += len(data)
                if n_bytes > BUDGETS.remote_answer_bytes:
                    raise _too_long()
                self._http.receive_data(data)
            elif isinstance(event, h11.Response):
                _check_head(event)
            elif isinstance(event, h11.Data):
                reader.feed(event.data)
                yield True
            elif isinstance(event, h11.EndOfMessage):
                return reader.result()
            elif not isinstance(event, h11.InformationalResponse):
                raise RemoteCallError(_CLOSED)


def _too_long() -> RemoteCallError:
    return RemoteCallError(f"the answer is longer than {BUDGETS.remote_answer_bytes} bytes")


def _check_head(head: h11.Response) -> None:
    """Refuse an answer that is none, or that would be too long."""
    if head.status_code != 200:
        reason = head.reason.decode("latin-1")
        raise RemoteCallError(f"the server answered {head.status_code} {reason}"[:200])
    for name, value in head.headers:
        if name == b"content-encoding" and value != b"identity":
            raise RemoteCallError(f"the answer is packed with {value[:40].decode('latin-1')}; it must not be")
        if name == b"content-length" and int(value) > BUDGETS.remote_answer_bytes:
            raise _too_long()
