"""Whole programs on a controller without ports: sent as bytes, with peers that answer what programs dial.

A peer is a function of the bytes that came since it last answered: it returns what it took and what it says.
Nothing comes within the cycle in which it is asked for.
"""

from box_support import Bench, FakeNetwork

from protocol.script_channel import ControlLine, ProgramText, ScriptChannel
from ur_emulator.machine.commands.programs import StartProgram, StopProgram
from ur_emulator.machine.scripting.network import RemoteCallError
from urscript import compile_program
from urscript.catalogue import catalogue_for
from urscript.errors import ScriptError


class PeerSocket:
    """A script's connection to a peer; None is a port where nobody listens."""

    def __init__(self, peer):
        self.problem = ""
        self.inbox = bytearray()
        self.sent = bytearray()
        self.is_connecting = True
        self.is_open = False
        self._peer = peer
        self._unread = b""

    def deliver(self):
        if self.is_connecting:
            self.is_connecting = False
            self.is_open = self._peer is not None
            if self.is_open:
                self.inbox += getattr(self._peer, "greeting", b"")
        elif self.is_open:
            used, said = self._peer(self._unread)
            self._unread = self._unread[used:]
            self.inbox += said

    def send(self, data):
        if self.is_open:
            self.sent += data
            self._unread += data
        return self.is_open

    def close(self):
        self.is_open = self.is_connecting = False


class _Call:
    def __init__(self, server, method, arguments):
        self.is_done = False
        self._server, self._method, self._arguments = server, method, arguments

    def result(self):
        procedure = getattr(self._server, self._method, None)
        if procedure is None:
            raise RemoteCallError(f"no method {self._method}")
        return procedure(*self._arguments)


class _RemoteServer:
    def __init__(self, server):
        self._server = server
        self._calls = []

    def call(self, method, arguments):
        self._calls.append(_Call(self._server, method, arguments))
        return self._calls[-1]

    def deliver(self):
        for call in self._calls:
            call.is_done = True
        self._calls.clear()

    def close(self):
        self._calls.clear()


class PeerNetwork(FakeNetwork):
    """Peers by port, servers of remote procedures by URL."""

    def __init__(self, peers, servers):
        super().__init__()
        self.peers, self.servers = peers, servers
        self.ends = []

    def open(self, host, port):
        self.ends.append(PeerSocket(self.peers.get(port)))
        return self.ends[-1]

    def remote_server(self, url):
        self.ends.append(_RemoteServer(self.servers.get(url)))
        return self.ends[-1]

    def deliver(self):
        for end in self.ends:
            end.deliver()

    def sent_to(self, port):
        """What scripts sent to a port, all connections in order."""
        peer = self.peers[port]
        return b"".join(bytes(end.sent) for end in self.ends if getattr(end, "_peer", None) is peer)


class Box(Bench):
    """A bench that takes bytes as a script port does."""

    def __init__(self, *, peers=None, servers=None, software="3.15", fidelity="exact"):
        super().__init__(fidelity=fidelity, network=PeerNetwork(peers or {}, servers or {}))
        self._channel = ScriptChannel()
        self._catalogue = catalogue_for(software)
        self.compile_errors = []

    def tick(self, n=1, *commands):
        for _ in range(n):
            self.network.deliver()
            super().tick(1, *commands)
            commands = ()
        return self.now

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
