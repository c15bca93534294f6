"""XML-RPC calls of the scripts of one box: made in the loop, which calls this only while there are any."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from protocol.errors import LocalProtocolError
from protocol.xmlrpc import encode_call
from ur_emulator.budgets import BUDGETS
from ur_emulator.realtime.barrier import Report
from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.scripting.network import RemoteCallError, ScriptSocket
from ur_emulator.servers.scripts.xmlrpc_exchange import (
    Exchange,
    HttpChannel,
    ServerAddress,
    UnansweredError,
)

# How often time-outs are looked at [s]; bytes that come wake the loop.
_LOOK_EVERY = 0.05


class XmlRpcCall:
    """One call (see `scripting.network.RemoteCall`)."""

    def __init__(self) -> None:
        self.is_done = False
        self._value: Any = None
        self._error = ""

    def result(self) -> Any:
        """Return what the procedure returned; RemoteCallError if the call failed."""
        if self._error:
            raise RemoteCallError(self._error)
        return self._value

    def finish(self, value: Any, error: str = "") -> None:
        """Take the end of the call."""
        self._value, self._error, self.is_done = value, error, True


class XmlRpcClient:
    """The servers that the scripts of one box call, and the connections to them."""

    def __init__(self, loop: EventLoop, connect: Callable[[str, int], ScriptSocket], report: Report) -> None:
        """Prepare; nothing is connected before the first call.

        Args:
            loop: advances the calls.
            connect: begins to connect to a host and port.
            report: called with an error of ours and what it has ended.
        """
        self._loop = loop
        self._report = report
        self.connect = connect
        # Those with a connection; the one that was called last is last.
        self._connected: dict[XmlRpcServer, None] = {}
        self._busy: dict[XmlRpcServer, None] = {}

    def advance(self, now: float) -> float:
        """Go on with all calls; after a piece of an answer, the other calls go on in the next turn."""
        for server in tuple(self._busy):
            has_read = server.advance()
            del self._busy[server]
            if server.is_busy:
                self._busy[server] = None
            if has_read:
                return now
        if not self._busy:
            self._loop.remove(self)
        return now + _LOOK_EVERY

    def failed(self, error: Exception) -> None:
        """End all calls after an error of ours."""
        self._report("the remote procedure calls of scripts are ended", error)
        for server in tuple(self._busy):
            server.give_up(repr(error))
        self.close()

    def close(self) -> None:
        """Close everything."""
        for server in (*self._busy, *self._connected):
            server.close()

    # --- what the servers report

    def begin(self, server: XmlRpcServer) -> None:
        """A server has a call to make."""
        if not self._busy:
            self._loop.add(self)
        self._busy[server] = None

    def make_room(self, server: XmlRpcServer) -> None:
        """A server is about to connect; RemoteCallError if there are too many connections that are in use."""
        if len(self._connected) >= BUDGETS.remote_connections:
            idle = next((other for other in self._connected if not other.is_busy), None)
            if idle is None:
                raise RemoteCallError(
                    f"{BUDGETS.remote_connections} remote procedures of other handles are being called, "
                    "wait for one of them"
                )
            idle.close()
        self._connected[server] = None

    def disconnected(self, server: XmlRpcServer) -> None:
        """A server has no connection any more."""
        self._connected.pop(server, None)

    def used(self, server: XmlRpcServer) -> None:
        """A server that is connected was called."""
        self._connected[server] = self._connected.pop(server)


class XmlRpcServer:
    """A server as one script handle knows it (see `scripting.network.RemoteServer`)."""

    def __init__(self, client: XmlRpcClient, url: str) -> None:
        self._client = client
        self._url = url
        self._channel: HttpChannel | None = None
        self._calls: deque[tuple[XmlRpcCall, bytes]] = deque()
        self._exchange: Exchange | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a call is running."""
        return bool(self._calls)

    def call(self, method: str, arguments: Sequence[Any]) -> XmlRpcCall:
        """Begin to call a procedure; calls are made one after the other."""
        call = XmlRpcCall()
        try:
            self._calls.append((call, encode_call(method, arguments)))
        except LocalProtocolError as error:
            call.finish(None, str(error))
            return call
        self._client.begin(self)
        if len(self._calls) == 1:
            self.advance()
        return call

    def close(self) -> None:
        """Close the connection and forget the running calls."""
        self._calls.clear()
        self._end_exchange()
        self._disconnect()

    def give_up(self, why: str) -> None:
        """Fail the running calls."""
        for call, _ in self._calls:
            call.finish(None, why)
        self.close()

    def advance(self) -> bool:
        """Go on with the call that is the first; return whether a piece of an answer was read."""
        if not self._calls:
            return False
        call, body = self._calls[0]
        if self._exchange is None:
            self._exchange = self._make(body)
        try:
            return next(self._exchange)
        except StopIteration as end:
            call.finish(end.value)
        except RemoteCallError as error:
            self._disconnect()
            call.finish(None, str(error))
        self._end_exchange()
        self._calls.popleft()
        return True

    def _make(self, body: bytes) -> Exchange:
        """Make a call, on the connection that there is or on a new one."""
        address = ServerAddress(self._url)
        if self._channel is not None and self._channel.is_reusable:
            self._client.used(self)
            # The server may close a connection that was idle just when it is used again.
            with suppress(UnansweredError):
                return (yield from self._channel.call(address, body, time.monotonic))
        self._disconnect()
        self._client.make_room(self)
        self._channel = HttpChannel(self._client.connect(address.host, address.port))
        yield from self._channel.connect(address, time.monotonic)
        return (yield from self._channel.call(address, body, time.monotonic))

    def _end_exchange(self) -> None:
        if self._exchange is not None:
            self._exchange.close()
            self._exchange = None

    def _disconnect(self) -> None:
        if self._channel is not None:
            self._channel.socket.close()
            self._channel = None
        self._client.disconnected(self)
