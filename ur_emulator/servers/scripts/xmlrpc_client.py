"""XML-RPC calls of scripts: the servers that `scripting` asks for, each with a worker thread of its own.

The worker owns the connection; a result reaches the loop only through its call queue.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.scripting.network import RemoteCallError

if TYPE_CHECKING:
    from ur_emulator.servers.scripts.xmlrpc_transport import XmlRpcTransport


class XmlRpcCall:
    """One call; done once the loop has heard of its end."""

    def __init__(self) -> None:
        self.is_done = False
        self._value: Any = None
        self._error = ""

    def result(self) -> Any:
        """Return what the procedure returned; RemoteCallError if the call failed."""
        if self._error:
            raise RemoteCallError(self._error)
        return self._value

    def failed(self, error: Exception) -> None:
        """End the call with an error of ours."""
        self.finish(None, repr(error))

    def finish(self, value: Any, error: str) -> None:
        """Take the end of the call; in the loop's thread."""
        self._value, self._error, self.is_done = value, error, True


class XmlRpcServer:
    """A server as one script handle knows it."""

    def __init__(self, loop: EventLoop, url: str) -> None:
        self._loop = loop
        self._url = url
        self._worker: _Worker | None = None

    def call(self, method: str, arguments: Sequence[Any]) -> XmlRpcCall:
        """Begin to call a procedure."""
        if self._worker is None:
            self._worker = _Worker(self._loop, self._url)
        return self._worker.submit(method, tuple(arguments))

    def close(self) -> None:
        """Close the connection; a worker that waits for an answer gives up."""
        if self._worker is not None:
            self._worker.stop()
            self._worker = None


class _Worker:
    """Makes the calls of one handle, one after the other."""

    def __init__(self, loop: EventLoop, url: str) -> None:
        self._loop = loop
        self._url = url
        self._transport: XmlRpcTransport | None = None
        self._is_stopped = False
        self._jobs: queue.SimpleQueue[tuple[XmlRpcCall, str, tuple[Any, ...]] | None] = queue.SimpleQueue()
        threading.Thread(target=self._run, name="script-xmlrpc", daemon=True).start()

    def submit(self, method: str, arguments: tuple[Any, ...]) -> XmlRpcCall:
        """Queue a call."""
        call = XmlRpcCall()
        self._jobs.put((call, method, arguments))
        return call

    def stop(self) -> None:
        """Let the thread end, soon."""
        self._is_stopped = True
        self._jobs.put(None)
        if self._transport is not None:
            self._transport.abort()

    def _run(self) -> None:
        from ur_emulator.servers.scripts.xmlrpc_transport import XmlRpcTransport

        self._transport = transport = XmlRpcTransport(self._url)
        if self._is_stopped:  # before there was a transport to break off
            transport.abort()
        while (job := self._jobs.get()) is not None:
            call, method, arguments = job
            value, error = transport.call(method, arguments)
            self._loop.call_soon_threadsafe(partial(call.finish, value, error), call.failed)
        transport.close()
