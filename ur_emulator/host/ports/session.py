"""A client whose requests are answered in order, however many cycles each takes."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from typing import ClassVar, Generic, TypeVar

from ur_emulator.budgets import BUDGETS
from ur_emulator.errors import NotRunningError
from ur_emulator.host.runtime.barrier import guarded
from ur_emulator.host.runtime.connection import Connection
from ur_emulator.host.served_box import ServedBox
from ur_emulator.host.steps import Steps, result_of


class Session(ABC):
    """One client of a port.

    It answers for one turn (`client_work` of the budgets), then all other clients have theirs. A client that
    sends ahead is not read meanwhile: what it sends waits in the buffers of the system, not in the box.

    Attributes:
        is_busy: its requests are being answered.
        most_of_the_gone: how many requests are still answered when their client is gone.
        allows_half_close: a client that has closed its sending side still gets its answers.
    """

    most_of_the_gone: ClassVar[int] = 0
    allows_half_close: ClassVar[bool] = False

    def __init__(self, connection: Connection, box: ServedBox) -> None:
        self.connection = connection
        self.is_busy = False
        self._box = box
        self._n_of_the_gone = 0

    def receive(self, data: bytes) -> None:
        """Take what has arrived, and answer what can be answered now."""
        if self.is_busy:
            self.connection.set_reading(False)
        self._take(data)
        if not self.is_busy:
            self.is_busy = True
            self._answer_for_a_turn()

    @abstractmethod
    def _take(self, data: bytes) -> None:
        """Keep what has arrived."""

    @abstractmethod
    def _answer_next(self) -> int | Steps[int]:
        """Answer the next request; return what it has cost in units of work, 0 if none is there."""

    def _answer_for_a_turn(self) -> None:
        self._box.steps.start(self._serve(), partial(guarded, self.connection.failed, self._finished))

    def _serve(self) -> Steps[bool]:
        """Answer requests; return True when the turn is over, False when none is left.

        A request that has waited for a cycle is the last of a turn: it is answered within the next cycle.
        """
        snapshot, work = self._box.snapshot, BUDGETS.client_work
        while self._is_served():
            if work <= 0 or self._box.snapshot is not snapshot:
                return True
            cost = yield from result_of(self._answer_next())
            if not cost:
                break
            work -= cost
        return False

    def _is_served(self) -> bool:
        """Whether its next request is answered."""
        if self.connection.is_open and self.connection.can_send:
            return True
        self._n_of_the_gone += 1
        return self._n_of_the_gone <= self.most_of_the_gone

    def _finished(self, goes_on: bool | None, error: Exception | None) -> None:
        """The turn is over, all are answered, the box has ended, or an error of ours the answering."""
        if goes_on:
            self.connection.call_soon(self._answer_for_a_turn)
            return
        self.is_busy = False
        if isinstance(error, NotRunningError):
            self.connection.close()
        elif error is not None:
            self.connection.failed(error)
        elif not self.connection.can_send:
            self.connection.close()  # gone: what else it has sent ahead is not executed
        elif self.connection.has_ended:
            self.connection.close_when_sent()
        else:
            self.connection.set_reading(True)


_S = TypeVar("_S", bound=Session)


class SessionPort(Generic[_S]):
    """A port whose clients speak first; each has a session, which answers its requests in order."""

    def __init__(self, box: ServedBox, begin: Callable[[Connection, ServedBox], _S]) -> None:
        """Serve a box; `begin` makes the session of a new client."""
        self._box = box
        self._begin = begin
        self._sessions: dict[Connection, _S] = {}

    def opened(self, connection: Connection) -> None:
        """Take in a client."""
        session = self._sessions[connection] = self._begin(connection, self._box)
        if session.allows_half_close:
            connection.allow_half_close(self._ended)

    def received(self, connection: Connection, data: bytes) -> None:
        """Take bytes and answer what can be answered now."""
        self._sessions[connection].receive(data)

    def closed(self, connection: Connection) -> None:
        """Forget the client; what it has begun goes on."""
        self._sessions.pop(connection, None)

    def _ended(self, connection: Connection) -> None:
        """The client sends nothing more; it is closed when its requests are answered."""
        self._sessions[connection].receive(b"")
