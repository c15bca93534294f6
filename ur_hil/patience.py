"""The duration of a wait for a peer, without the time in which this process did not run.

When a process was stopped (SIGSTOP, a debugger, a suspended machine) or got no processor, its clock jumps.
The jump says nothing about the peer, so at most `LONGEST_STEP` counts between two readings of the clock. This
module reads no clock: the time is an argument.
"""

import math

LONGEST_STEP = 0.1
"""Most that counts between two readings [s]. A waiting caller reads at least as often."""


class Patience:
    """The duration of one wait."""

    __slots__ = ("_last", "_spent")

    def __init__(self) -> None:
        self._spent = 0.0
        self._last = math.nan

    def spent(self, now: float) -> float:
        """Take a reading of the clock; the first one begins the wait.

        Args:
            now: monotonic time [s].

        Returns:
            Duration of the wait [s], without jumps of the clock.
        """
        if not math.isnan(self._last):
            self._spent += min(now - self._last, LONGEST_STEP)
        self._last = now
        return self._spent

    def restart(self) -> None:
        """End this wait; the next reading begins another."""
        self._spent = 0.0
        self._last = math.nan
