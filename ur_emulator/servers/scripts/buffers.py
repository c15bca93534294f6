"""All connections that the scripts of one box have opened: what waits to be sent, and how fast they read."""

from __future__ import annotations

import time
from typing import Final, Protocol
from weakref import WeakSet

from ur_emulator.budgets import BUDGETS, CYCLE, KIB
from ur_emulator.realtime.barrier import Report
from ur_emulator.realtime.event_loop import EventLoop

# A connection with no more than this can always send: one that is stuck does not stop the others.
_SHARE: Final = 4 * KIB


class Buffered(Protocol):
    """A connection as its buffers are counted."""

    def read_on(self) -> None:
        """Read from the peer, or stop reading, as the budgets say now."""
        ...

    def close(self) -> None:
        """Close the connection."""
        ...


class Buffers:
    """Counts the bytes of the connections of one box.

    Attributes:
        connections: all that somebody still has, closed ones included.
        unsent: bytes that wait to be sent.
    """

    def __init__(self, loop: EventLoop, report: Report) -> None:
        self._loop = loop
        self._report = report
        self._window_end = 0.0
        self._in_window = 0
        self._has_read_enough = False
        self.connections: WeakSet[Buffered] = WeakSet()
        self.unsent = 0

    def received(self, n_bytes: int) -> None:
        """Count bytes that have come; if they are too many all connections stop reading for a cycle."""
        now = time.monotonic()
        if now >= self._window_end:
            self._window_end, self._in_window = now + CYCLE, 0
        self._in_window += n_bytes
        if self._in_window >= BUDGETS.received_bytes and not self._has_read_enough:
            self._has_read_enough = True
            self._loop.add(self)
            self._tell()

    def advance(self, now: float) -> float:
        """Read on when it is time; the loop calls this while connections do not read."""
        if now < self._window_end:
            return self._window_end
        self.close()
        self._tell()
        return now + CYCLE

    def failed(self, error: Exception) -> None:
        """Close all connections after an error of ours."""
        self._report("the connections of scripts are closed", error)
        self.close()
        for connection in tuple(self.connections):
            connection.close()

    def close(self) -> None:
        """Do not look any more."""
        self._has_read_enough = False
        self._loop.remove(self)

    def may_receive(self, waiting: int) -> bool:
        """Whether a connection with so many bytes in its inbox may read on."""
        return not self._has_read_enough and waiting < BUDGETS.inbox_bytes

    def may_send(self, waiting: int, n_bytes: int) -> bool:
        """Whether a connection with so many unsent bytes may send as many more as given."""
        return waiting + n_bytes <= _SHARE or self.unsent + n_bytes <= BUDGETS.all_unsent_bytes

    def _tell(self) -> None:
        for connection in tuple(self.connections):
            connection.read_on()
