"""Port 30004: RTDE. Every client gets the variables it asked for at its own rate, and writes inputs.

The order of packages is in `protocol.rtde.server_connection`; here are rates, owners of inputs, and sockets.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from protocol.errors import RemoteProtocolError
from protocol.rtde.codec import RtdeTextMessage, SetupInputs, SetupOutputs
from protocol.rtde.server_connection import InputReceived, RtdeServerConnection, cycles_per_package
from protocol.rtde.types import TextLevel
from ur_emulator.budgets import BUDGETS
from ur_emulator.host.ports.session import Session, SessionPort
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps
from ur_emulator.machine.commands.client_writes import WriteInputs
from ur_emulator.machine.commands.programs import ReportLine
from ur_emulator.machine.controller.events import LogAdded
from ur_emulator.machine.controller.snapshot import Snapshot

# Sender of text messages.
SOURCE = "RTDE"
# The one variable that costs something to find: only looked up while a client asks for it.
_SCRIPT_LINE = "script_control_line"
# Units of work for input data, for a request, and for one that sets up a recipe: 0.2 ms and more.
_INPUT_COST, _REQUEST_COST, _RECIPE_COST = 2, 8, 64


class RtdePort(SessionPort["_RtdeSession"]):
    """Streams data packages and takes inputs."""

    def __init__(self, box: ServedBox) -> None:
        super().__init__(box, partial(_RtdeSession, answer=self._answer))
        self._streams: tuple[_RtdeSession, ...] = ()
        self._owners: dict[str, Connection] = {}
        self._reports_line = False

    def closed(self, connection: Connection) -> None:
        """Forget the client; its input variables are free at once."""
        super().closed(connection)
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

    def _answer(self, session: _RtdeSession, request: object) -> None:
        connection, protocol = session.connection, session.protocol
        if isinstance(request, SetupInputs):
            in_use = [name for name in request.names if self._owners.get(name, connection) is not connection]
            n_recipes = len(protocol.input_recipes)
            reply = protocol.reply(in_use, has_room=session.has_room(len(request.names)))
            if len(protocol.input_recipes) > n_recipes:
                self._owners.update(dict.fromkeys(request.names, connection))
        else:
            reply = protocol.reply()
            if isinstance(request, SetupOutputs):
                session.wants_line = _SCRIPT_LINE in request.names
        session.restart()
        self._find_streams()
        if not connection.send(reply):
            connection.close()  # without its reply, everything after would answer the wrong request

    def _find_streams(self) -> None:
        sessions = self._sessions.values()
        self._streams = tuple(s for s in sessions if s.encode is not None)
        wants_line = any(s.wants_line for s in sessions)
        if wants_line is not self._reports_line:
            self._reports_line = wants_line
            self._box.submit_quietly(ReportLine(wants_line))


class _RtdeSession(Session):
    """One client: its protocol, and when its next data package is due.

    Attributes:
        protocol: what it has asked for.
        encode: makes its data packages; None while it gets none. Sessions with the same recipe have the same.
        wants_line: its recipe has the line that the program executes.
        is_lost: it has sent bytes that are not RTDE; it gets a text message, then the connection is closed.
    """

    def __init__(
        self, connection: Connection, box: ServedBox, answer: Callable[[_RtdeSession, object], None]
    ) -> None:
        """Prepare; `answer` replies to a request for recipes, start, pause and the like."""
        super().__init__(connection, box)
        software = box.identity.software
        self.protocol = RtdeServerConnection(software.version, software.rtde_outputs, software.rtde_inputs)
        self.encode: Callable[[Snapshot], bytes] | None = None
        self.wants_line = False
        self.is_lost = False
        self._answer = answer
        self._cycle_rate = box.controller.generation.cycle_rate
        self._divisor = 1
        self._first_tick = -1
        self._last_tick = -1
        self._repeats = 0

    def _take(self, data: bytes) -> None:
        if not self.is_lost:
            self.protocol.receive_data(data)

    def _answer_next(self) -> Steps[int]:
        if self.is_lost:
            return 0
        try:
            event = self.protocol.next_event()
        except RemoteProtocolError as problem:
            self.is_lost = True
            self.connection.send(self.protocol.text(RtdeTextMessage(str(problem), SOURCE, TextLevel.ERROR)))
            self.connection.close_when_sent()
            return 0
        match event:
            case None:
                return 0
            case InputReceived(names, values):
                self._box.note_input(self.connection)
                while not self._box.takes_commands:
                    yield
                self._box.submit(WriteInputs(tuple(zip(names, values, strict=True))))
                return _INPUT_COST
            case RtdeTextMessage(text, source):
                entry = LogAdded(" ".join(source.split()) or SOURCE, " ".join(text.split()))
                self._box.announce(entry)
                return _REQUEST_COST
        self._answer(self, event)
        return _RECIPE_COST if isinstance(event, SetupInputs | SetupOutputs) else _REQUEST_COST

    def has_room(self, n_variables: int) -> bool:
        """Whether the client may have one more input recipe, of so many variables."""
        recipes = self.protocol.input_recipes.values()
        n_variables += sum(len(recipe.names) for recipe in recipes)
        return len(recipes) < BUDGETS.rtde_recipes and n_variables <= BUDGETS.rtde_variables

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
