"""XML-RPC calls of the scripts of one box, over HTTP; the loop looks at them only while there are any.

A request goes out, and the answer is read piece by piece as it comes. Everything that comes is bounded:
bytes, time, values, depth. Packed answers are not offered and not taken, redirects are not followed.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import suppress
from typing import Any, Final
from urllib.parse import urlsplit

import h11

from protocol.errors import RemoteProtocolError
from protocol.xmlrpc import AnswerReader, RemoteFaultError
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.runtime.barrier import Report
from ur_emulator.host.runtime.event_loop import EventLoop
from ur_emulator.host.script_network.sockets import OutgoingConnection
from ur_emulator.machine.controller.io.network import Arrival, CallEnded, CallProcedure, RemoteCallError

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
    """Where a server listens; `netloc` is host and port as the URL has them."""

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

    def __init__(self, address: ServerAddress, socket: OutgoingConnection) -> None:
        self.socket = socket
        self._address = address
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

    def connect(self) -> Exchange:
        """Wait until the connection stands."""
        end = time.monotonic() + CONNECT_TIMEOUT
        while self.socket.is_connecting and time.monotonic() < end:
            yield False
        if not self.socket.is_open:
            late = f"no connection within {CONNECT_TIMEOUT:g} s" if self.socket.is_connecting else ""
            why = late or self.socket.problem or "Connection refused"
            raise RemoteCallError(f"{self._address.netloc} does not answer: {why}")

    def call(self, body: bytes) -> Exchange:
        """Send a call and read its answer."""
        address = self._address
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
            value = yield from self._answer()
        except RemoteFaultError as fault:
            raise RemoteCallError(str(fault)) from None
        except (h11.RemoteProtocolError, RemoteProtocolError) as problem:
            raise RemoteCallError(f"the answer makes no sense: {problem}") from None
        if self._http.our_state is h11.DONE and self._http.their_state is h11.DONE:
            self._http.start_next_cycle()
        return value

    def _answer(self) -> Exchange:
        reader = AnswerReader(BUDGETS.remote_values)
        n_bytes, end = 0, 0.0
        while True:
            event = self._http.next_event()
            if event is h11.NEED_DATA:
                while self.socket.is_open and not self.socket.inbox:
                    if end and time.monotonic() > end:
                        raise RemoteCallError(
                            f"the answer takes longer than {BUDGETS.remote_answer_time:g} s"
                        )
                    yield False
                if not n_bytes and not self.socket.inbox:
                    raise UnansweredError(_CLOSED)
                end = end or time.monotonic() + BUDGETS.remote_answer_time
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


# How often time-outs are looked at [s]; bytes that come wake the loop.
_LOOK_EVERY = 0.05


class XmlRpcClient:
    """The servers that the scripts of one box call, by their numbers."""

    def __init__(
        self,
        loop: EventLoop,
        connect: Callable[[str, int], OutgoingConnection],
        arrive: Callable[[Arrival], None],
        report: Report,
    ) -> None:
        """Prepare; nothing is connected before the first call. `report` gets errors of ours."""
        self._loop = loop
        self._report = report
        self.connect = connect
        self.arrive = arrive
        self._servers: dict[int, XmlRpcServer] = {}
        self._busy: dict[XmlRpcServer, None] = {}

    def call(self, request: CallProcedure) -> None:
        """Begin a call; those of a server are made one after the other."""
        server = self._servers.get(request.server)
        if server is None:
            server = self._servers[request.server] = XmlRpcServer(self, request.url)
        if not self._busy:
            self._loop.add(self)
        self._busy[server] = None
        server.call(request)

    def close_server(self, number: int) -> None:
        """Close the connection to a server and forget its calls; harmless if none was made."""
        server = self._servers.pop(number, None)
        if server is not None:
            server.close()

    def advance(self, now: float) -> float:
        """Go on with all calls; after a piece of an answer, the other calls go on in the next turn."""
        for server in tuple(self._busy):
            has_read = server.advance()
            del self._busy[server]
            if server.calls:
                self._busy[server] = None
            if has_read:
                return now
        if not self._busy:
            self._loop.remove(self)
        return now + _LOOK_EVERY

    def failed(self, error: Exception) -> None:
        """End all calls after an error of ours."""
        self._report("the remote procedure calls of scripts are ended", error)
        for server in self._busy:
            for request in server.calls:
                self.arrive(CallEnded(request.call, None, repr(error)))
        self.close()

    def close(self) -> None:
        """Close everything; calls may be made anew."""
        for server in self._servers.values():
            server.close()
        self._busy.clear()
        self._loop.remove(self)


class XmlRpcServer:
    """A server as one script handle knows it; of its calls the first is made, the others wait."""

    def __init__(self, client: XmlRpcClient, url: str) -> None:
        self._client = client
        self._url = url
        self._channel: HttpChannel | None = None
        self.calls: deque[CallProcedure] = deque()
        self._exchange: Exchange | None = None

    def call(self, request: CallProcedure) -> None:
        """Begin a call, or let it wait for the one before it."""
        self.calls.append(request)
        if len(self.calls) == 1:
            self.advance()

    def close(self) -> None:
        """Close the connection and forget the running calls."""
        self.calls.clear()
        self._end_exchange()
        self._disconnect()

    def advance(self) -> bool:
        """Go on with the call that is the first; return whether a piece of an answer was read."""
        if not self.calls:
            return False
        request = self.calls[0]
        if self._exchange is None:
            self._exchange = self._make(request.body)
        try:
            return next(self._exchange)
        except StopIteration as end:
            self._client.arrive(CallEnded(request.call, end.value, ""))
        except RemoteCallError as error:
            self._disconnect()
            self._client.arrive(CallEnded(request.call, None, str(error)))
        self._end_exchange()
        self.calls.popleft()
        return True

    def _make(self, body: bytes) -> Exchange:
        """Make a call, on the connection that there is or on a new one."""
        if self._channel is not None and self._channel.is_reusable:
            # The server may close a connection that was idle just when it is used again.
            with suppress(UnansweredError):
                return (yield from self._channel.call(body))
        self._disconnect()
        address = ServerAddress(self._url)
        self._channel = HttpChannel(address, self._client.connect(address.host, address.port))
        yield from self._channel.connect()
        return (yield from self._channel.call(body))

    def _end_exchange(self) -> None:
        if self._exchange is not None:
            self._exchange.close()
            self._exchange = None

    def _disconnect(self) -> None:
        if self._channel is not None:
            self._channel.socket.close()
            self._channel = None
