"""A client of one port on a real socket, which never waits: what it sends has arrived when the loop turns next."""

import socket
import struct

_TIMEOUT = 20.0  # s; a limit for hangs
_RESET = struct.pack("ii", 1, 0)


class Wire:
    """One end of a TCP connection to a box.

    Attributes:
        number: of the client's TCP port.
        is_open: the box has not closed the connection, as far as this end has seen.
        reads: what comes is taken; False lets the buffers of the box fill.
    """

    @classmethod
    def to(cls, address):
        """Connect to a port."""
        return cls(socket.create_connection(address, timeout=_TIMEOUT))

    def __init__(self, sock):
        self.sock = sock
        self.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.sock.setblocking(False)
        self.number = self.sock.getsockname()[1]
        self.is_open = True
        self.reads = True

    def send(self, data):
        """Send what the kernel takes."""
        if self.is_open:
            try:
                self.sock.send(data)
            except BlockingIOError:
                pass
            except OSError:  # closed by the box, or ended by this client
                pass

    def end(self):
        """Say no more, and listen on."""
        if self.is_open:
            try:
                self.sock.shutdown(socket.SHUT_WR)
            except OSError:
                self.close()

    def reset(self):
        """Go without a word."""
        if self.is_open:
            self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            self.close()

    def close(self):
        self.is_open = False
        self.sock.close()

    def take(self):
        """Return what has come since."""
        taken = bytearray()
        while self.is_open and self.reads:
            try:
                data = self.sock.recv(1 << 16)
            except BlockingIOError:
                break
            except OSError:
                data = b""
            if not data:
                self.close()
            taken += data
        return bytes(taken)
