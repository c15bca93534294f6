"""An HTTP client of the control port, down to the bytes."""

import json
import socket
from contextlib import contextmanager

from box_support import TIMEOUT

from ur_emulator import ControlBox


@contextmanager
def control_box(**options):
    with ControlBox(
        **{"pace": "lockstep", "seed": 7, "port_base": None, "control_port": 0, **options}
    ) as box:
        yield box


class Http:
    """A client that sends what it is told and reads answers as they come."""

    def __init__(self, box):
        self.host = f"{box.host}:{box.control_port}"
        self.sock = socket.create_connection((box.host, box.control_port), timeout=TIMEOUT)
        self.stream = self.sock.makefile("rb")

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.stream.close()
        self.sock.close()

    def send(self, data):
        self.sock.sendall(data)

    def request(self, method, path, body=None, *, host=None, headers=()):
        """Return the bytes of a request."""
        lines = [f"{method} {path} HTTP/1.1", f"Host: {self.host if host is None else host}", *headers]
        data = b""
        if body is not None:
            data = body if isinstance(body, bytes) else json.dumps(body).encode()
            lines += [f"Content-Length: {len(data)}"]
            if not any(header.lower().startswith("content-type") for header in headers):
                lines += ["Content-Type: application/json"]
        return "\r\n".join([*lines, "", ""]).encode() + data

    def answer(self):
        """Read an answer; return its status and what its body holds."""
        status = int(self.stream.readline().split()[1])
        self.headers = {}
        while line := self.stream.readline().strip():
            name, value = line.decode().split(": ", 1)
            self.headers[name.lower()] = value
        if status == 100:
            return status, None
        return status, json.loads(self.stream.read(int(self.headers["content-length"])))

    def ask(self, method, path, body=None, **more):
        self.send(self.request(method, path, body, **more))
        return self.answer()

    def is_closed(self):
        try:
            return self.stream.read(1) == b""
        except ConnectionResetError:
            return True
