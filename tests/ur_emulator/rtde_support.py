"""An RTDE client without a library, for the tests of the box."""

import struct
from itertools import chain

from protocol.rtde import codec as M
from protocol.rtde.client_connection import DataReceived, RtdeClientConnection
from protocol.rtde.codec import encode_message
from protocol.rtde.types import RtdeType


def input_package(recipe_id, types, *values):
    """The bytes that write the inputs of a recipe."""
    letters = "".join(RtdeType(word).letters for word in types)
    numbers = chain.from_iterable(value if isinstance(value, tuple) else (value,) for value in values)
    data = M.DataPackage(struct.pack(">" + letters, *numbers), recipe_id)
    return encode_message(data, M.Role.PC, 2)


class RtdeClient:
    """Talks RTDE over a socket. Replies and data are told apart, nothing is skipped unseen."""

    def __init__(self, sock, version=2):
        self.sock = sock
        self.protocol = RtdeClientConnection()
        self.input_types = {}
        if version == 2:
            assert self.ask(M.RequestProtocolVersion(2)) == M.RequestProtocolVersionReply(True)

    def next(self):
        while (event := self.protocol.next_event()) is None:
            data = self.sock.recv(65536)
            if not data:
                raise EOFError
            self.protocol.receive_data(data)
        return event

    def ask(self, request):
        """One request; the reply, data packages that were on their way being skipped."""
        self.sock.sendall(self.protocol.send(request))
        while isinstance(event := self.next(), DataReceived):
            pass
        return event

    def subscribe(self, *names, frequency=125.0):
        assert self.ask(M.SetupOutputs(names, frequency)).recipe_id
        assert self.ask(M.Start()) == M.StartReply(True)

    def own(self, *names):
        """Set up an input recipe; its id, 0 if it was refused."""
        reply = self.ask(M.SetupInputs(names))
        self.input_types[reply.recipe_id] = reply.types
        return reply.recipe_id

    def write(self, recipe_id, *values):
        self.sock.sendall(input_package(recipe_id, self.input_types[recipe_id], *values))

    def data(self):
        """The next data package, as a dictionary."""
        event = self.next()
        assert isinstance(event, DataReceived), event
        return dict(zip(event.names, event.values, strict=True))

    def until(self, condition, limit=50_000):
        for _ in range(limit):
            if condition(values := self.data()):
                return values
        raise AssertionError("the package that was waited for did not come")
