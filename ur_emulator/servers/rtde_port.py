"""Port 30004: RTDE. Every client gets the variables it asked for at its own rate, and writes inputs.

The order of packages is in `protocol.rtde.server_connection`; here are rates, owners of inputs, and sockets.
"""

from __future__ import annotations

from collections.abc import Callable

from protocol.errors import RemoteProtocolError
from protocol.rtde.messages import RtdeTextMessage, SetupInputs, SetupOutputs
from protocol.rtde.server_connection import InputReceived, RtdeServerConnection
from protocol.rtde.states import cycles_per_package
from protocol.rtde.types import TextLevel
from ur_emulator.commands.client_writes import WriteInputs
from ur_emulator.controller.command import Command
from ur_emulator.controller.controller import Controller
from ur_emulator.controller.events import Event, LogAdded
from ur_emulator.controller.snapshot import Snapshot
from ur_emulator.models.software import Software
from ur_emulator.servers.tcp.connection import Connection

# Sender of text messages.
SOURCE = "RTDE"
# The one variable that costs something to find: only looked up once a client has asked for it.
_SCRIPT_LINE = "script_control_line"
# What one client may cost in one go, more would keep the control cycle waiting: about 1 ms. A unit is what a
# data package costs; bytes that make no sense cost as they are taken apart, in portions.
_BUDGET = 256
_REQUEST_COST = 8
_PORTION, _PORTION_COST = 4 * 1024, 64
# Bytes of a client that may wait for that; who sends more, and faster, is cut off.
MAX_WAITING = 256 * 1024


class RtdePort:
    """Streams data packages and takes inputs."""

    def __init__(
        self,
        software: Software,
        controller: Controller,
        submit: Callable[[Command], None],
        announce: Callable[[Event], None] = lambda event: None,
    ) -> None:
        """Prepare for clients.

        Args:
            software: told to clients that ask; decides which variables there are.
            controller: told when a client wants the script line, otherwise left alone.
            submit: takes a command for the next cycle.
            announce: takes what clients want in the log.
        """
        self._software = software
        self._controller = controller
        self._submit = submit
        self._announce = announce
        self._sessions: dict[Connection, _Session] = {}
        self._streams: tuple[_Session, ...] = ()
        self._owners: dict[str, Connection] = {}
        self._behind: dict[_Session, None] = {}

    def opened(self, connection: Connection) -> None:
        """The client speaks first."""
        software = self._software
        protocol = RtdeServerConnection(software.version, software.rtde_outputs, software.rtde_inputs)
        self._sessions[connection] = _Session(connection, protocol, self._controller.generation.cycle_rate)

    def received(self, connection: Connection, data: bytes) -> None:
        """Answer requests in order, hand inputs on; what is no RTDE ends the connection."""
        session = self._sessions[connection]
        if session.is_lost:
            return
        session.inbox += data
        if len(session.inbox) > MAX_WAITING:
            connection.close()
        elif session not in self._behind:
            self._serve(session)

    def _serve(self, session: _Session) -> None:
        """Look at some packages; the rest waits for the next cycle."""
        connection, protocol = session.connection, session.protocol
        self._behind.pop(session, None)
        try:
            budget = _BUDGET
            while budget > 0:
                if not connection.is_open:
                    return
                event = protocol.next_event()
                if event is None:
                    if not session.inbox:
                        return
                    protocol.receive_data(bytes(session.inbox[:_PORTION]))
                    del session.inbox[:_PORTION]
                    budget -= _PORTION_COST
                    continue
                budget -= 1
                match event:
                    case InputReceived(names, values):
                        self._submit(WriteInputs(tuple(zip(names, values, strict=True))))
                    case RtdeTextMessage(text, source):
                        self._announce(LogAdded(" ".join(source.split()) or SOURCE, " ".join(text.split())))
                        budget -= _REQUEST_COST
                    case _:
                        self._answer(connection, event)
                        budget -= _REQUEST_COST
            if connection.is_open:
                self._behind[session] = None
        except RemoteProtocolError as problem:
            session.is_lost = True
            session.inbox.clear()
            connection.send(protocol.text(RtdeTextMessage(str(problem), SOURCE, TextLevel.ERROR)))
            connection.close_when_sent()

    def closed(self, connection: Connection) -> None:
        """Forget the client; its input variables are free at once."""
        session = self._sessions.pop(connection, None)
        if session is not None:
            self._behind.pop(session, None)
        self._owners = {name: owner for name, owner in self._owners.items() if owner is not connection}
        self._find_streams()

    def publish(self, snapshot: Snapshot) -> None:
        """Send the data packages that are due in this cycle; a recipe is encoded once for all who have it."""
        packages: dict[Callable[[Snapshot], bytes], bytes] = {}
        for session in self._streams:
            encode = session.due(snapshot.tick)
            if encode is not None:
                package = packages.get(encode)
                if package is None:
                    package = packages[encode] = encode(snapshot)
                session.connection.send(package)
        if self._behind:
            for session in tuple(self._behind):
                self._serve(session)

    def _answer(self, connection: Connection, request: object) -> None:
        session = self._sessions[connection]
        in_use: tuple[str, ...] = ()
        if isinstance(request, SetupInputs):
            in_use = tuple(n for n in request.names if self._owners.get(n, connection) is not connection)
        n_recipes = len(session.protocol.input_recipes)
        reply = session.protocol.reply(in_use)
        if isinstance(request, SetupInputs) and len(session.protocol.input_recipes) > n_recipes:
            self._owners.update(dict.fromkeys(request.names, connection))
        if isinstance(request, SetupOutputs) and _SCRIPT_LINE in request.names:
            self._controller.programs.reports_line = True
        session.restart()
        self._find_streams()
        if not connection.send(reply):
            connection.close()  # without its reply, everything after would answer the wrong request

    def _find_streams(self) -> None:
        self._streams = tuple(s for s in self._sessions.values() if s.encode is not None)


class _Session:
    """One client: its connection, its protocol, and when its next data package is due.

    Attributes:
        encode: makes its data packages; None while it gets none. Sessions with the same recipe have the same.
        inbox: bytes that were not looked at yet.
        is_lost: what comes from it makes no sense any more; it is told so, then the connection ends.
    """

    def __init__(self, connection: Connection, protocol: RtdeServerConnection, cycle_rate: int) -> None:
        self._cycle_rate = cycle_rate
        self.protocol = protocol
        self.encode: Callable[[Snapshot], bytes] | None = None
        self.inbox = bytearray()
        self.is_lost = False
        self.connection = connection
        self._divisor = 1
        self._first_tick = -1
        self._last_tick = -1
        self._repeats = 0

    def restart(self) -> None:
        """Take over what the last request has changed; a new stream begins in the next cycle."""
        encode = self.protocol.encoder
        if encode is not self.encode:
            self.encode = encode
            self._first_tick = self._last_tick = -1
        self._divisor = cycles_per_package(self.protocol.frequency, self._cycle_rate)

    def due(self, tick: int) -> Callable[[Snapshot], bytes] | None:
        """Return what makes the package that is due now, None if none is.

        Packages are due in every n-th cycle after the first one. While time stands still, snapshots repeat
        themselves at real pace: then every n-th repetition is sent, so that the client is fed at its rate.
        """
        if tick == self._last_tick:
            self._repeats += 1
            is_due = self._repeats % self._divisor == 0
        else:
            if self._first_tick < 0:
                self._first_tick = tick
            self._last_tick, self._repeats = tick, 0
            is_due = (tick - self._first_tick) % self._divisor == 0
        return self.encode if is_due else None
