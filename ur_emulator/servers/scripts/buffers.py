"""What waits in all connections that the scripts of one box have opened, and when nothing more is read."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Final, Protocol
from weakref import WeakSet

from ur_emulator.budgets import BUDGETS, CYCLE, KIB
from ur_emulator.realtime.barrier import Report
from ur_emulator.realtime.event_loop import EventLoop

# A connection with no more than this can always receive and send: one that is stuck does not stop the others.
SHARE: Final = 4 * KIB
# Reading goes on when this part of the budget is free again.
_FREE_PART = 0.25
# How often a full box looks whether its scripts have read [s].
_LOOK_EVERY = 0.004


class Buffered(Protocol):
    """A connection as its buffers are counted."""

    @property
    def n_received(self) -> int:
        """Bytes that its script has not read."""
        ...

    def read_on(self) -> None:
        """Read from the peer, or stop reading, as the budgets say now."""
        ...

    def close(self) -> None:
        """Close the connection."""
        ...


class Buffers:
    """Counts the bytes of the connections of one box.

    Scripts take bytes out of their inboxes without a word, so the count of received bytes is an upper bound;
    it is made anew when it reaches the budget.

    Attributes:
        connections: all that somebody still has, closed ones included.
        unsent: bytes that wait to be sent.
        is_full: the budget of bytes that wait is used up.
    """

    def __init__(self, loop: EventLoop, report: Report) -> None:
        self._loop = loop
        self._report = report
        self._received = 0
        self._window_end = 0.0
        self._in_window = 0
        self._has_read_enough = False
        self.connections: WeakSet[Buffered] = WeakSet()
        self.unsent = 0
        self.is_full = False

    def received(self, n_bytes: int) -> None:
        """Count bytes that have come; if they are too many all connections stop reading for a while."""
        now = time.monotonic()
        if now >= self._window_end:
            self._window_end, self._in_window = now + CYCLE, 0
        self._in_window += n_bytes
        self._received += n_bytes
        if self._received >= BUDGETS.all_inboxes_bytes:
            self._received = sum(self._sizes())
        self._stop_reading(
            is_full=self._received >= BUDGETS.all_inboxes_bytes,
            has_read_enough=self._in_window >= BUDGETS.received_bytes,
        )

    def advance(self, now: float) -> float:
        """Look whether it is time to read on; the loop calls this while connections do not read."""
        if now < self._window_end:
            return self._window_end
        had_read_enough, self._has_read_enough = self._has_read_enough, False
        if self.is_full:
            self._received = sum(self._sizes())
            self.is_full = self._received > (1.0 - _FREE_PART) * BUDGETS.all_inboxes_bytes
        if had_read_enough or not self.is_full:
            self._tell()
        if not self.is_full:
            self._loop.remove(self)
        return now + _LOOK_EVERY

    def failed(self, error: Exception) -> None:
        """Close all connections after an error of ours."""
        self._report("the connections of scripts are closed", error)
        self.close()
        for connection in tuple(self.connections):
            connection.close()

    def close(self) -> None:
        """Do not look any more."""
        self.is_full = self._has_read_enough = False
        self._loop.remove(self)

    def may_receive(self, waiting: int) -> bool:
        """Whether a connection with so many bytes in its inbox may read on."""
        return not self._has_read_enough and waiting < (SHARE if self.is_full else BUDGETS.inbox_bytes)

    def may_send(self, waiting: int, n_bytes: int) -> bool:
        """Whether a connection with so many unsent bytes may send as many more as given."""
        return waiting + n_bytes <= SHARE or self.unsent + n_bytes <= BUDGETS.all_unsent_bytes

    def _stop_reading(self, *, is_full: bool, has_read_enough: bool) -> None:
        if (is_full and not self.is_full) or (has_read_enough and not self._has_read_enough):
            if not (self.is_full or self._has_read_enough):
                self._loop.add(self)
            self.is_full |= is_full
            self._has_read_enough |= has_read_enough
            self._tell()

    def _sizes(self) -> Iterator[int]:
        return (connection.n_received for connection in self.connections)

    def _tell(self) -> None:
        for connection in tuple(self.connections):
            connection.read_on()
