"""The network of a chunk: peers of sockets, remote procedures, Modbus units, as its marks describe them.

Nothing comes within the cycle in which it is asked for.
"""

from ast import literal_eval

from box_support import FakeNetwork, FakeSocket
from chunk_marks import latin

from ur_emulator.machine.controller.io.network import CallEnded


class ChunkSocket(FakeSocket):
    """A socket that connects between cycles, unless its peer refuses or is silent."""

    def __init__(self, number, peer, replies):
        super().__init__(number)
        self.is_connecting, self.is_open = True, False
        self._peer = peer
        self._replies = replies
        self._answered = 0
        if peer not in ("refuses", "silent"):
            self.inbox += latin(peer)

    def arrivals(self):
        if self.is_connecting and self._peer != "silent":
            self.is_connecting = False
            self.is_open = self._peer != "refuses"
        return super().arrivals()

    def receive(self, data):
        self.inbox += data

    def send(self, data):
        super().send(data)
        for asked, text in self._replies:
            if self.sent[self._answered :].endswith(asked):
                self._answered = len(self.sent)
                self.inbox += text


class ChunkNetwork(FakeNetwork):
    """What the programs of one chunk connect to."""

    def __init__(self, chunk):
        super().__init__()
        self._peers = list(chunk.peers)
        self._replies = chunk.replies
        self._procedures = chunk.procedures
        self._wanted = []
        self.called = []
        self.modbus_memory = {}
        self.modbus_trouble = ""

    def make_socket(self, number, host, port):
        return ChunkSocket(number, self._peers.pop(0) if self._peers else '""', self._replies)

    def call(self, request, method, arguments):
        self.called.append(f"{method} {arguments}")
        result = self._procedures.get(method, f"fails no method {method}")
        error = result.removeprefix("fails ") if result.startswith("fails ") else ""
        self._arrivals.append(CallEnded(request.call, None if error else literal_eval(result), error))

    def modbus_unit(self, address):
        unit = super().modbus_unit(address)
        unit.memory = self.modbus_memory
        return unit

    def serve(self, unit, request):
        self._wanted.append((unit, request))

    def arrivals(self):
        wanted, self._wanted = self._wanted, []
        for unit, request in wanted:
            unit.trouble = self.modbus_trouble
            super().serve(unit, request)
        return super().arrivals()

    @property
    def sent(self):
        return b"".join(bytes(sock.sent) for sock in self.sockets)

    @property
    def custom(self):
        """Requests that programs have composed."""
        units = self.modbus_units.values()
        sent = [entry for unit in units for entry in unit.log if len(entry) == 3]
        return [f"{slave} {code} {list(data)}" for slave, code, data in sent]
