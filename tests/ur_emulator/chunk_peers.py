"""The network of a chunk: peers of sockets, remote procedures, Modbus units, as its marks describe them.

Nothing comes within the cycle in which it is asked for: `deliver` is called between cycles.
"""

from ast import literal_eval

from box_support import FakeModbusUnit
from chunk_marks import latin

from ur_emulator.machine.scripting.network import RemoteCallError


class ChunkSocket:
    """A socket that connects between cycles, unless its peer refuses or is silent."""

    def __init__(self, peer, replies):
        self.problem = ""
        self.inbox = bytearray()
        self.sent = bytearray()
        self.is_connecting, self.is_own = True, False
        self.is_open = False
        self._peer = peer
        self._replies = replies
        self._answered = 0
        self._coming = b"" if peer in ("refuses", "silent") else latin(peer)

    def deliver(self):
        if self.is_connecting and self._peer != "silent":
            self.is_connecting = False
            self.is_open = self._peer != "refuses"
        if self.is_open:
            self.inbox += self._coming
            self._coming = b""

    def receive(self, data):
        self._coming += data

    def send(self, data):
        if not self.is_open:
            return False
        self.sent += data
        for asked, text in self._replies:
            if self.sent[self._answered :].endswith(asked):
                self._answered = len(self.sent)
                self._coming += text
        return True

    def close(self):
        self.is_open = self.is_connecting = False


class _Call:
    def __init__(self, result):
        self._result = result
        self.is_done = False

    def result(self):
        if self._result.startswith("fails "):
            raise RemoteCallError(self._result.removeprefix("fails "))
        return literal_eval(self._result)


class _Server:
    def __init__(self, network):
        self._network = network
        self._calls = []

    def call(self, method, arguments):
        self._network.called.append(f"{method} {list(arguments)}")
        self._calls.append(_Call(self._network.procedures.get(method, f"fails no method {method}")))
        return self._calls[-1]

    def deliver(self):
        for call in self._calls:
            call.is_done = True
        self._calls = []

    def close(self):
        self._calls = []


class _ModbusUnit(FakeModbusUnit):
    """A unit that answers between cycles."""

    def __init__(self, network):
        super().__init__()
        self._network = network
        self.memory = network.modbus_memory
        self._wanted = []

    def want(self, signal):
        self._wanted.append(signal)

    def deliver(self):
        self.trouble = self._network.modbus_trouble
        wanted, self._wanted = self._wanted, []
        for signal in wanted:
            super().want(signal)

    def send(self, slave, function_code, data):
        self._network.custom.append(f"{slave} {function_code} {list(data)}")


class ChunkNetwork:
    """What the programs of one chunk connect to."""

    def __init__(self, chunk):
        self._peers = list(chunk.peers)
        self._replies = chunk.replies
        self.procedures = chunk.procedures
        self.sockets = []
        self.servers = []
        self.called = []
        self.modbus_units = []
        self.modbus_memory = {}
        self.modbus_trouble = ""
        self.custom = []

    def open(self, host, port):
        peer = self._peers.pop(0) if self._peers else '""'
        self.sockets.append(ChunkSocket(peer, self._replies))
        return self.sockets[-1]

    def remote_server(self, url):
        self.servers.append(_Server(self))
        return self.servers[-1]

    def modbus_unit(self, address):
        self.modbus_units.append(_ModbusUnit(self))
        return self.modbus_units[-1]

    def deliver(self):
        for end in (*self.sockets, *self.servers, *self.modbus_units):
            end.deliver()

    @property
    def sent(self):
        return b"".join(bytes(socket.sent) for socket in self.sockets)
