"""XML-RPC calls of scripts: the servers that `scripting` asks for, each with a worker thread of its own.

The worker owns the connection; a result reaches the loop only through its call queue.
"""

from __future__ import annotations

import contextlib
import http.client
import queue
import socket
import threading
import xmlrpc.client
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError

from ur_emulator.realtime.event_loop import EventLoop
from ur_emulator.scripting.network import RemoteCallError

# A server that cannot be reached fails the call after this [s]; an answer may take any time.
CONNECT_TIMEOUT = 5.0
# Path of a URL without one, as the standard library's clients have it.
DEFAULT_PATH = "/RPC2"


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


class _Connection(http.client.HTTPConnection):
    """A connection that waits for answers without limit."""

    def __init__(self, host: str, is_stopped: Callable[[], bool]) -> None:
        super().__init__(host, timeout=CONNECT_TIMEOUT)
        self._is_stopped = is_stopped

    def connect(self) -> None:
        super().connect()
        self.sock.settimeout(None)
        if self._is_stopped():  # before there was a socket to break off
            raise OSError("the connection was closed")


class _Transport(xmlrpc.client.Transport):
    """Keeps its connection where another thread can break it off."""

    def __init__(self) -> None:
        super().__init__()
        self.connection: _Connection | None = None
        self.is_stopped = False

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        if self.is_stopped:
            raise OSError("the connection was closed")
        if self.connection is None:
            self.connection = _Connection(host, lambda: self.is_stopped)
        return self.connection

    def close(self) -> None:
        connection, self.connection = self.connection, None
        if connection is not None:
            connection.close()

    def abort(self) -> None:
        """Break the connection off, from any thread."""
        self.is_stopped = True
        connection = self.connection
        sock = None if connection is None else connection.sock
        if sock is not None:
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)


class _Worker:
    """Makes the calls of one handle, one after the other."""

    def __init__(self, loop: EventLoop, url: str) -> None:
        self._loop = loop
        self._url = url
        self._transport = _Transport()
        self._jobs: queue.SimpleQueue[tuple[XmlRpcCall, str, tuple[Any, ...]] | None] = queue.SimpleQueue()
        threading.Thread(target=self._run, name="script-xmlrpc", daemon=True).start()

    def submit(self, method: str, arguments: tuple[Any, ...]) -> XmlRpcCall:
        """Queue a call."""
        call = XmlRpcCall()
        self._jobs.put((call, method, arguments))
        return call

    def stop(self) -> None:
        """Let the thread end, soon."""
        self._jobs.put(None)
        self._transport.abort()

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            call, method, arguments = job
            value, error = self._call(method, arguments)
            self._loop.call_soon_threadsafe(partial(call.finish, value, error))
        self._transport.close()

    def _call(self, method: str, arguments: tuple[Any, ...]) -> tuple[Any, str]:
        """Return the result and an empty text, or why there is none."""
        try:
            url = urlsplit(self._url)
            if url.scheme != "http" or not url.netloc:
                return None, f"{self._url} is no address, write http://host:port/path"
            body = xmlrpc.client.dumps(arguments, method).encode()
            values = self._transport.request(url.netloc, url.path or DEFAULT_PATH, body)
        except xmlrpc.client.Fault as fault:
            return None, fault.faultString
        except xmlrpc.client.ProtocolError as problem:
            return None, f"the server answered {problem.errcode} {problem.errmsg}"
        except OSError as problem:
            return None, f"{self._url} does not answer: {problem.strerror or problem}"
        except (http.client.HTTPException, xmlrpc.client.Error, ExpatError, ValueError, TypeError) as problem:
            return None, f"the answer makes no sense: {problem}"
        return (values[0] if len(values) == 1 else list(values)), ""
