"""Pacers: when may the next cycle begin? Each answers with a time; none of them ticks by itself.

| pace       | the next cycle begins                                                                        |
|------------|----------------------------------------------------------------------------------------------|
| realtime   | at absolute deadlines t0 + k * period (divided by the speed), so lateness does not add up     |
| lockstep   | at once while something is going on, never past a script that waits for the outside           |
"""

import math
from enum import StrEnum
from typing import Protocol

from ur_hil.patience import Patience

# A box that could not tick for this long (a suspended laptop, a debugger) starts a new time base instead of
# racing after the old one.
MAX_BACKLOG = 0.5  # s
# Both limits below count the time in which this process ran. A client whose bytes a script waits for may be
# stopped for half a minute, by SIGSTOP or in a debugger, and lose nothing.
# In lockstep, a script that has waited this long in real seconds for bytes gets time anyway, at real pace,
# so that its own time-out can end the hang.
HANG_LIMIT = 60.0  # s
# In lockstep, a client that has not read for this long in real seconds is not waited for any more, unless a
# script waits for its bytes; one that has not read anything yet, for the shorter time only: many clients,
# such as ur_rtde at port 30003, send programs and never read.
READER_LIMIT, FIRST_READ_LIMIT = 5.0, 0.2  # s


def reader_limit(client_has_read: bool) -> float:
    """Return how long to wait for a client [s]."""
    return READER_LIMIT if client_has_read else FIRST_READ_LIMIT


class Pace(StrEnum):
    """Names of the pacers on the command line."""

    REALTIME = "realtime"
    LOCKSTEP = "lockstep"


class Situation(Protocol):
    """State of the box for its pacer."""

    @property
    def is_active(self) -> bool:
        """The box is active: a command waits, a program runs, the arm moves."""

    @property
    def waits_outside(self) -> bool:
        """A script waits for bytes that have not come."""

    @property
    def readers_full(self) -> bool:
        """A client that reads has not taken its frames yet."""

    def give_up_readers(self, waited: float) -> None:
        """Stop waiting for clients after so long [s]; they lose frames until they have caught up."""

    def fell_behind(self, n_cycles: int) -> None:
        """Report that the machine was too slow: real time is so many cycles ahead of the box."""


class Pacer(Protocol):
    """Decides when a cycle may begin."""

    @property
    def publish_at(self) -> float:
        """Not before this time may the cycle that was computed last be published [s]."""

    def may_tick(self, now: float, situation: Situation) -> bool:
        """True if a cycle may begin at monotonic time `now` [s]; the caller then ticks once."""

    def next_call(self, now: float) -> float:
        """When to ask again at the latest, if nothing comes from the sockets before [s]."""


class RealtimePacer:
    """Cycles at absolute deadlines.

    A cycle may be computed a little before its deadline; what comes of it leaves at the deadline, whether the
    processor was slow or fast. What clients send in between counts in the next cycle.

    Attributes:
        publish_at: deadline of the cycle that was computed last [s].
    """

    def __init__(self, period_s: float, speed: float = 1.0, phase: float = 0.0, lead: float = 0.0) -> None:
        """Set the rate.

        Args:
            period_s: control cycle [s].
            speed: how many times as fast as real time, > 0.
            phase: which part of a period to wait before the first cycle, 0 to 1: boxes that share a loop take
                turns instead of all having their cycle at once.
            lead: how long before the deadline a cycle may be computed [s]; at most a quarter of the period.
        """
        self._period = period_s / speed
        self._phase = phase
        self._lead = min(lead, 0.25 * self._period)
        self._deadline = math.nan
        self.publish_at = -math.inf

    def may_tick(self, now: float, situation: Situation) -> bool:
        """True from the lead before the deadline on; each call that returns True uses one deadline."""
        if math.isnan(self._deadline):
            self._deadline = now + self._phase * self._period
        if now < self._deadline - self._lead:
            return False
        behind = now - self._deadline
        if behind > MAX_BACKLOG:
            skipped = int(behind / self._period)
            self._deadline += skipped * self._period
            situation.fell_behind(skipped)
        self.publish_at = self._deadline
        self._deadline += self._period
        return True

    def next_call(self, now: float) -> float:
        """The next deadline."""
        return self._deadline


class LockstepPacer:
    """Cycles as fast as the processor allows, every one caused by a program; time stands still otherwise."""

    publish_at = -math.inf

    def __init__(self, period_s: float) -> None:
        self._period = period_s
        self._outside = Patience()
        self._readers = Patience()
        self._last_tick = -math.inf

    def may_tick(self, now: float, situation: Situation) -> bool:
        """True when the box is active and no script waits for the outside."""
        if not situation.is_active:
            self._outside.restart()
            self._readers.restart()
            return False
        hangs = situation.waits_outside
        if not hangs:
            self._outside.restart()
        elif self._outside.spent(now) < HANG_LIMIT or now - self._last_tick < self._period:
            return False  # time stands still: a client that does not read loses nothing
        if situation.readers_full:
            situation.give_up_readers(math.inf if hangs else self._readers.spent(now))
            if situation.readers_full:
                return False
        self._readers.restart()
        self._last_tick = now
        return True

    def next_call(self, now: float) -> float:
        """One real period on: time for the heartbeat and for the real-seconds limits."""
        return now + self._period
