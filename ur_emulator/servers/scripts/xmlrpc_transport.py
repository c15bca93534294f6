"""How an XML-RPC call travels: the part that needs the library, which a worker loads with its first call."""

from __future__ import annotations

import contextlib
import http.client
import socket
import xmlrpc.client
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError

# A server that cannot be reached fails the call after this [s]; an answer may take any time.
CONNECT_TIMEOUT = 5.0
# Path of a URL without one, as the standard library's clients have it.
DEFAULT_PATH = "/RPC2"


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


class XmlRpcTransport(xmlrpc.client.Transport):
    """Calls the procedures of one server; keeps its connection where another thread can break it off."""

    def __init__(self, url: str) -> None:
        super().__init__()
        self._url = url
        self.connection: _Connection | None = None
        self.is_stopped = False

    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        """Return the connection, a new one if there is none."""
        if self.is_stopped:
            raise OSError("the connection was closed")
        if self.connection is None:
            self.connection = _Connection(host, lambda: self.is_stopped)
        return self.connection

    def close(self) -> None:
        """Close the connection; the next call makes a new one."""
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

    def call(self, method: str, arguments: tuple[Any, ...]) -> tuple[Any, str]:
        """Call a procedure; return the result and an empty text, or why there is none."""
        try:
            url = urlsplit(self._url)
            if url.scheme != "http" or not url.netloc:
                return None, f"{self._url} is not an address, write http://host:port/path"
            body = xmlrpc.client.dumps(arguments, method).encode()
            values = self.request(url.netloc, url.path or DEFAULT_PATH, body)
        except xmlrpc.client.Fault as fault:
            return None, fault.faultString
        except xmlrpc.client.ProtocolError as problem:
            return None, f"the server answered {problem.errcode} {problem.errmsg}"
        except OSError as problem:
            return None, f"{self._url} does not answer: {problem.strerror or problem}"
        except (http.client.HTTPException, xmlrpc.client.Error, ExpatError, ValueError, TypeError) as problem:
            return None, f"the answer makes no sense: {problem}"
        return (values[0] if len(values) == 1 else list(values)), ""
