"""An RTDE client without a library, for the tests of the box."""

from protocol.dashboard.connection import Role
from protocol.rtde import messages as M
from protocol.rtde.connection import DataReceived, RtdeConnection


class RtdeClient:
    """Talks RTDE over a socket. Replies and data are told apart, nothing is skipped unseen."""

    def __init__(self, sock, version=2):
        self.sock = sock
        self.protocol = RtdeConnection(Role.PC)
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
        return self.ask(M.SetupInputs(names)).recipe_id

    def write(self, recipe_id, *values):
        self.sock.sendall(self.protocol.send_values(recipe_id, values))

    def data(self):
        """The next data package, as a dictionary."""
        event = self.next()
        assert isinstance(event, DataReceived), event
        return event.as_dict()

    def until(self, condition, limit=50_000):
        for _ in range(limit):
            if condition(values := self.data()):
                return values
        raise AssertionError("the package that was waited for did not come")
