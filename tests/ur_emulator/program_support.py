"""Whole programs on a controller without ports: sent as bytes, with peers that answer what programs dial.

A peer is a function of the bytes that came since it last answered: it returns what it took and what it says.
Nothing comes within the cycle in which it is asked for.
"""

from box_support import Bench, FakeNetwork, FakeSocket

from protocol.script_channel import ControlLine, ProgramText, ScriptChannel
from ur_emulator.machine.commands.programs import StartProgram, StopProgram
from ur_emulator.machine.controller.io.network import CallEnded
from urscript import compile_program
from urscript.catalogue import catalogue_for
from urscript.errors import ScriptError


class PeerSocket(FakeSocket):
    """A script's connection to a peer; None is a port where nobody listens."""

    def __init__(self, number, peer):
        super().__init__(number)
        self.is_connecting, self.is_open = True, False
        self.peer = peer
        self._unread = b""

    def arrivals(self):
        if self.is_connecting:
            self.is_connecting = False
            self.is_open = self.peer is not None
            self.inbox += getattr(self.peer, "greeting", b"")
        elif self.is_open:
            used, said = self.peer(self._unread)
            self._unread = self._unread[used:]
            self.inbox += said
        return super().arrivals()

    def send(self, data):
        self._unread += data
        return super().send(data)


class PeerNetwork(FakeNetwork):
    """Peers by port, servers of remote procedures by URL."""

    def __init__(self, peers, servers):
        super().__init__()
        self.peers, self.servers = peers, servers

    def make_socket(self, number, host, port):
        return PeerSocket(number, self.peers.get(port))

    def call(self, request, method, arguments):
        procedure = getattr(self.servers.get(request.url), method, None)
        if procedure is None:
            super().call(request, method, arguments)
        else:
            self._arrivals.append(CallEnded(request.call, procedure(*arguments), ""))

    def sent_to(self, port):
        """What scripts sent to a port, all connections in order."""
        peer = self.peers[port]
        return b"".join(bytes(sock.sent) for sock in self.sockets if sock.peer is peer)


class Box(Bench):
    """A bench that takes bytes as a script port does."""

    def __init__(self, *, peers=None, servers=None, software="3.15", fidelity="exact"):
        super().__init__(fidelity=fidelity, network=PeerNetwork(peers or {}, servers or {}))
        self._channel = ScriptChannel()
        self._catalogue = catalogue_for(software)
        self.compile_errors = []

    def send(self, data):
        """Take bytes; each program in them starts in a cycle of its own."""
        for item in self._channel.feed(data):
            match item:
                case ProgramText(text):
                    try:
                        self.tick(1, StartProgram(compile_program(text, catalogue=self._catalogue)))
                    except ScriptError as error:
                        self.compile_errors.append(error)
                case ControlLine(word="stop program"):
                    self.tick(1, StopProgram())

    def run_until(self, condition, limit=30_000):
        """Tick until `condition(box)` holds."""
        for _ in range(limit):
            if condition(self):
                return
            self.tick()
        raise AssertionError(f"it did not come to pass; texts: {self.texts}, errors: {self.failures}")

    def finish(self, limit=30_000):
        """Tick until no program runs and the arm stands."""
        programs = self.controller.programs
        self.run_until(lambda box: not programs.has_work and not box.controller.state.motion.is_moving, limit)
        return self.texts

    @property
    def failures(self):
        """Run-time errors, `line:column text`."""
        found = [event for event in self.events if type(event).__name__ == "ScriptFailed"]
        return [f"{event.line}:{event.column} {event.text}" for event in found]

    @property
    def reports(self):
        """Error codes of the controller."""
        found = [event for event in self.events if type(event).__name__ == "ErrorReported"]
        return [f"C{event.code}A{event.argument} {event.text}" for event in found]


def frames(*messages, size=4):
    """A peer that sends one message a cycle, whatever it hears."""
    queue = list(messages)

    def peer(unread):
        return len(unread), queue.pop(0) if queue else b""

    return peer
