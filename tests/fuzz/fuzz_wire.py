"""A network without sockets: real `Connection` objects on fake sockets, whose other end is the test."""

import selectors

from ur_emulator.servers.tcp.connection import Connection


class FakeSocket:
    """One end of a TCP connection; it takes `room` more bytes, None for any number."""

    def __init__(self, number):
        self.number = number
        self.incoming = []
        self.taken = bytearray()
        self.room = None
        self.is_reset = False
        self.is_closed = False

    def setblocking(self, flag):
        pass

    def setsockopt(self, *args):
        pass

    def getpeername(self):
        return ("127.0.0.1", self.number)

    def send(self, data):
        assert not self.is_closed, "bytes for a closed socket"
        if self.is_reset:
            raise BrokenPipeError
        n = len(data) if self.room is None else min(self.room, len(data))
        if not n and len(data):
            raise BlockingIOError
        if self.room is not None:
            self.room -= n
        self.taken += data[:n]
        return n

    def recv(self, size):
        assert not self.is_closed, "a closed socket is read"
        if self.is_reset:
            raise ConnectionResetError
        if not self.incoming:
            raise BlockingIOError
        data = self.incoming.pop(0)
        if len(data) > size:
            self.incoming.insert(0, data[size:])
        return data[:size]

    def close(self):
        self.is_closed = True

    @property
    def ready(self):
        reads = selectors.EVENT_READ if self.incoming or self.is_reset else 0
        writes = selectors.EVENT_WRITE if self.room is None or self.room or self.is_reset else 0
        return reads | writes


class FakeLoop:
    """Watches fake sockets."""

    def __init__(self):
        self.watched = {}

    def watch(self, sock, events, callback, failed):
        assert not sock.is_closed, "a closed socket is watched"
        self.watched[sock] = (events, callback)

    def unwatch(self, sock):
        self.watched.pop(sock, None)

    def turn(self):
        """Hand on what is ready, as one turn of the loop."""
        for sock, (events, callback) in tuple(self.watched.items()):
            ready = sock.ready & events
            if ready and sock in self.watched:
                callback(ready)


def _raise(what, error):
    raise error


class Wire:
    """A client of one port: what it sends arrives in the pieces in which it is sent."""

    def __init__(self, loop, port, backlog, number):
        self.loop, self.port = loop, port
        self.sock = FakeSocket(number)
        self.n_closed = 0
        self.connection = Connection(loop, self.sock, port.received, self._closed, backlog, _raise)
        port.opened(self.connection)

    def _closed(self, connection):
        self.n_closed += 1
        self.port.closed(connection)

    @property
    def is_open(self):
        return self.connection.is_open

    def send(self, data):
        if data and self.is_open:
            self.sock.incoming.append(data)

    def end(self):
        """Say no more, and listen on."""
        self.sock.incoming.append(b"")

    def reset(self):
        self.sock.is_reset = True

    def take(self):
        """Return what has come since."""
        data, self.sock.taken = bytes(self.sock.taken), bytearray()
        return data
